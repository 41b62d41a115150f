"""Outcomes of episodes by hand: the right declaration, the wrong one, none, and what they cost."""

import numpy as np
import pytest

from training.learning.outcomes import CENSORED, HEALTHY_SHARE, Outcome, Outcomes, figures

INF = float("inf")
NORMAL = 0
PORT = 4
SPEED = 11


def info(true=NORMAL, declared=NORMAL, cost=0.0):
    return {"cost": cost, "declared_class": declared, "true_class": true}


def followed(onset, *seconds):
    """Outcomes of a lane that ends with the last of these seconds."""
    outcomes = Outcomes(np.array([onset]))
    for k, second in enumerate(seconds, start=1):
        is_last = k == len(seconds)
        outcomes.update([second], np.array([is_last]), np.array([INF if is_last else onset]))
    return outcomes.ended


def test_right_declaration_counts_from_onset():
    seconds = info(cost=0.01), info(PORT, cost=0.02), info(PORT, PORT, cost=0.03)
    assert followed(1.5, *seconds) == [Outcome(0, 3, pytest.approx(0.06), True, True, 1.5)]


def test_a_burst_may_be_over_when_it_is_declared():
    assert followed(0.0, info(PORT), info(NORMAL, PORT))[0].delay == 2.0


@pytest.mark.parametrize(
    ("onset", "last", "faulty"),
    [
        (0.5, info(PORT, SPEED), True),
        (0.5, info(PORT), True),
        (30.0, info(NORMAL, PORT), True),
        (INF, info(NORMAL, PORT), False),
    ],
    ids=["wrong", "none", "before onset", "healthy"],
)
def test_any_other_end_is_censored(onset, last, faulty):
    (outcome,) = followed(onset, last)
    assert outcome.delay == CENSORED == 30.0
    assert outcome.faulty is faulty


def test_lanes_begin_anew_by_themselves():
    outcomes = Outcomes(np.array([0.0, INF]))
    healthy = np.array([INF, INF])
    first = [info(PORT, PORT, cost=0.1), info(cost=0.2)]
    cost, true_class = outcomes.update(first, np.array([True, False]), healthy)
    assert cost.tolist() == [0.1, 0.2] and true_class.tolist() == [PORT, NORMAL]
    outcomes.update([info(cost=0.4), info(cost=0.3)], np.array([True, True]), healthy)
    ended = outcomes.ended
    assert [(outcome.lane, outcome.decisions, outcome.faulty) for outcome in ended] == [
        (0, 1, True),
        (0, 1, False),
        (1, 2, False),
    ]
    assert [outcome.cost for outcome in ended] == pytest.approx([0.1, 0.4, 0.5])


def test_figures_by_hand():
    outcomes = [
        Outcome(0, 10, 0.1, True, True, 4.0),
        Outcome(1, 10, 0.3, True, True, CENSORED),
        Outcome(2, 20, 0.0, False, False, CENSORED),
        Outcome(3, 10, 0.1, False, True, CENSORED),
    ]
    got = figures(outcomes, budget=0.1)
    assert got["delay"] == pytest.approx(17.0)
    assert got["isolated"] == 0.5 and got["mistaken"] == 0.5
    assert got["rms"] == pytest.approx(0.1) and got["healthy_rms"] == pytest.approx(
        (0.1 / 30) ** 0.5
    )
    assert got["loss"] == pytest.approx(17.0 * got["healthy_rms"] / (HEALTHY_SHARE * 0.1))
    assert figures(outcomes, budget=2.0)["loss"] == pytest.approx(17.0)


def test_no_episode_is_the_worst_and_costs_nothing():
    got = figures([], budget=0.1)
    assert got["loss"] == got["delay"] == CENSORED
    assert got["isolated"] == got["rms"] == got["healthy_rms"] == 0.0
