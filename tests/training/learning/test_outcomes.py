"""Figures of training episodes by hand."""

import pytest

from training.learning.outcomes import PRICE, WHOLE_BUDGET, Outcome, figures
from training.stimuli.base import EPISODE_TIME


def test_figures_by_hand():
    outcomes = [
        Outcome(0, 0.1, True, 4.0, 20.0, 0.02),
        Outcome(1, 0.2, True, 10.0, 30.0, 0.4),
        Outcome(2, 0.1, False, 0.0, 50.0, 0.08),
    ]
    got = figures(outcomes)
    assert got["delay"] == pytest.approx(7.0)
    assert got["healthy_rms"] == pytest.approx((0.5 / 100.0) ** 0.5)
    squared_share = (2.0 + 10.0 + 8.0) / 100.0
    assert got["healthy_share"] == pytest.approx(squared_share**0.5)
    assert got["loss"] == pytest.approx(7.0 + WHOLE_BUDGET * squared_share)


def test_a_healthy_episode_that_spends_its_budget_costs_the_price_of_it():
    budget = 0.05
    spent = Outcome(0, budget, False, 0.0, EPISODE_TIME, EPISODE_TIME * budget**2)
    assert figures([spent])["loss"] == pytest.approx(WHOLE_BUDGET)
    # the same sum of rewards
    assert PRICE * spent.healthy_cost / budget**2 == pytest.approx(WHOLE_BUDGET)


def test_no_episode_costs_nothing():
    assert set(figures([]).values()) == {0.0}
