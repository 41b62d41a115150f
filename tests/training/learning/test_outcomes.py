"""Outcomes of episodes by hand: the right declaration, the wrong one, none, and what they cost."""

import numpy as np
import pytest

from training.learning.outcomes import CENSORED, HEALTHY_SHARE, Outcome, Outcomes, figures

INF = float("inf")
PORT = "propeller_loss:port"
SPEED = "sensor:speed"


def info(label="normal", declared="normal", onset=INF, cost=0.0):
    return {"cost": cost, "declared": declared, "truth": {"label": label, "onset": onset}}


def followed(*seconds):
    """Outcomes of second lane that ends with the last of these."""
    outcomes = Outcomes(1)
    for k, second in enumerate(seconds, start=1):
        outcomes.update([second], np.array([k == len(seconds)]))
    return outcomes.ended


def test_right_declaration_counts_from_onset():
    first = info(onset=1.5, cost=0.01)
    second = info(PORT, onset=1.5, cost=0.02)
    last = info(PORT, PORT, onset=1.5, cost=0.03)
    assert followed(first, second, last) == [Outcome(0, 3, pytest.approx(0.06), True, True, 1.5)]


def test_a_burst_may_be_over_when_it_is_declared():
    assert followed(info(PORT, onset=0.0), info("normal", PORT, onset=0.0))[0].delay == 2.0


@pytest.mark.parametrize(
    ("last", "faulty"),
    [
        (info(PORT, SPEED, onset=0.5), True),
        (info(PORT, onset=0.5), True),
        (info("normal", PORT, onset=30.0), True),
        (info("normal", PORT), False),
    ],
    ids=["wrong", "none", "before onset", "healthy"],
)
def test_any_other_end_is_censored(last, faulty):
    (outcome,) = followed(last)
    assert outcome.delay == CENSORED == 30.0
    assert outcome.faulty is faulty


def test_lanes_begin_anew_by_themselves():
    outcomes = Outcomes(2)
    first = [info(PORT, PORT, onset=0.0, cost=0.1), info(cost=0.2)]
    cost, label = outcomes.update(first, np.array([True, False]))
    assert cost.tolist() == [0.1, 0.2] and label.tolist() == [PORT, "normal"]
    outcomes.update([info(cost=0.4), info(cost=0.3)], np.array([True, True]))
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
