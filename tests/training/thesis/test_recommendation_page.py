from types import SimpleNamespace

import numpy as np
import pytest

from auv_fault_env.faults import classes
from training.metrics import Times
from training.thesis import recommendation_page as page

CLASSES = classes()
VERDICT = 5
LABEL = np.array([1, 2, 3, 4] * 10)


def assessment(time, right):
    """What the page needs of a diagnoser that isolates all after this time, or whose decisions are
    all wrong.
    """
    times = Times(np.full(40, time), np.full(40, not right))
    return SimpleNamespace(
        isolation=times, label=LABEL, decision=LABEL if right else np.roll(LABEL, 1)
    )


def score(one):
    mean = float(one.isolation.time.mean())
    isolation = {
        "restricted_mean": mean,
        "interval": (mean, mean),
        "probability": 1.0 - one.isolation.censored.mean(),
    }
    return {
        "isolation": isolation,
        "macro_f1": 0.5,
        "false_alarms_per_hour": 1.0,
        "severity_mae": 0.1,
        "ece": 0.02,
    }


def rows_of(found, failures):
    scores = {name: score(one) for name, one in found.items()}
    return page.section_of_assessments(found, scores, failures)


def test_the_better_one_is_named():
    found = {
        name: assessment(20.0, False) for name in ("raw_network", "kalman_network", "parallel")
    }
    section = rows_of(found | {"integrated": assessment(4.0, True)}, {})
    rows = {row[1].split(":")[0]: row for row in section["table"]["rows"]}
    assert "-16.0 s" in rows["integrated minus parallel"][4]
    assert "integrated is better on both" in rows["integrated minus parallel"][6]
    assert rows["integrated"][4].startswith("4.0 s; 100 %; ")
    assert section["figures"]


def isolating(n_right):
    """What the verdict needs of a diagnoser that isolates the first faults of 40 with a mode.

    As many faults without a mode, which it isolates all, count nothing.
    """
    known = [CLASSES.index(name) for name in ("increased_drag", "seal_friction:port")]
    label = np.array(known * 20 + [CLASSES.index("sensor:speed")] * 40 + [0] * 20)
    censored = np.concatenate([np.arange(40) >= n_right, np.zeros(40, bool)])
    return SimpleNamespace(isolation=Times(np.full(80, 5.0), censored), label=label)


@pytest.mark.parametrize(
    ("raw", "kalman", "parallel", "verdict", "why"),
    [
        (10, 8, 30, "agrees", "surely more than the better part, raw_network"),
        (2, 3, 15, "agrees in part", "less than half"),
        (26, 3, 26, "agrees in part", "not surely more than the better part, raw_network"),
        (3, 14, 14, "differs", "not surely more than the better part, kalman_network"),
    ],
)
def test_the_verdict_comes_from_the_shares(raw, kalman, parallel, verdict, why):
    shares = dict(raw_network=raw, kalman_network=kalman, parallel=parallel)
    found = {name: isolating(n_right) for name, n_right in shares.items()}
    row = page.capability_row(found)
    assert row[VERDICT] == verdict and why in row[6]
    assert row[4].startswith(f"{100 * parallel / 40:.0f} %; ")


@pytest.mark.parametrize("present", [(), ("parallel",), ("raw_network", "kalman_network")])
def test_what_could_not_take_part_is_said(present):
    missing = [name for name in page.NAMES if name not in present]
    section = rows_of(
        dict.fromkeys(present, assessment(5.0, True)), dict.fromkeys(missing, "Gone: not there")
    )
    text = " ".join(section["text"])
    for name in missing:
        assert f"{name} could not take part: Gone: not there" in text
        (row,) = [row for row in section["table"]["rows"] if row[1].startswith(f"{name}:")]
        assert row[VERDICT] == "not judged"
    assert {row[VERDICT] for row in section["table"]["rows"][-4:]} == {"not judged"}
    assert bool(section["figures"]) == bool(present)


def test_a_small_comparison_runs(monkeypatch):
    monkeypatch.setattr(page, "NAMES", ("null", "random"))
    monkeypatch.setattr(page, "LANES", 4)
    monkeypatch.setattr(page, "HOURS", 0.05)
    section = page.section()
    assert section["table"]["rows"][0][1].startswith("null:")
    assert "could not take part" not in " ".join(section["text"])
