"""The targets: met, not met, or not judged where somebody is missing."""

import pytest

from diagnosers import ranked
from training.benchmark.validation import UNTOLD
from training.benchmark.verdicts import (
    BELOW_FILTER_BANK,
    FILTER_BANK,
    INTEGRATED,
    MET,
    MISSED,
    OPEN,
    ORACLE,
    Difference,
    verdicts,
)

BETTER = Difference((-2.0, -3.0, -1.0), (0.1, 0.05, 0.15))
WORSE = Difference((-2.0, -3.0, 0.1), (0.1, 0.05, 0.15))
BEATS, RATIO, SEVERITY, CALIBRATED, BANK, QUICK = range(6)


def score(isolation=4.0, severity=0.1, ece=0.03, p99=300.0):
    return {
        "isolation": {"restricted_mean": isolation},
        "severity_mae": severity,
        "ece": ece,
        "p99_us": p99,
    }


def judged(scores=None, against=None):
    scores = {INTEGRATED: score(), ORACLE: score(3.0), ORACLE + UNTOLD: score()} | (scores or {})
    others = [name for name in ranked() if name != INTEGRATED]
    won = {
        INTEGRATED: dict.fromkeys(others, BETTER),
        FILTER_BANK: dict.fromkeys(BELOW_FILTER_BANK, BETTER),
    }
    return [row[1] for row in verdicts(scores, won | (against or {}))]


def test_all_can_be_met():
    assert judged() == [MET] * 6


@pytest.mark.parametrize(
    ("target", "scores"),
    [
        (RATIO, {INTEGRATED: score(isolation=4.6)}),
        (SEVERITY, {INTEGRATED: score(severity=0.16)}),
        (CALIBRATED, {INTEGRATED: score(ece=0.05)}),
        (QUICK, {"rules": score(p99=1000.0)}),
    ],
)
def test_each_figure_can_miss_its_target(target, scores):
    assert [k for k, verdict in enumerate(judged(scores)) if verdict == MISSED] == [target]


@pytest.mark.parametrize(("target", "name"), [(BEATS, INTEGRATED), (BANK, FILTER_BANK)])
def test_one_that_is_not_surely_beaten_is_enough_to_miss(target, name):
    others = {
        INTEGRATED: [one for one in ranked() if one != INTEGRATED],
        FILTER_BANK: BELOW_FILTER_BANK,
    }[name]
    assert (
        judged(against={name: dict.fromkeys(others, BETTER) | {others[0]: WORSE}})[target] == MISSED
    )
    assert judged(against={name: dict.fromkeys(others[1:], BETTER)})[target] == OPEN
    assert judged(against={name: {}})[target] == OPEN


def test_what_is_missing_is_not_judged():
    found = [row[1] for row in verdicts({"rules": score()}, {})]
    assert found == [OPEN] * 5 + [MET]
