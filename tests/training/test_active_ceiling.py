import numpy as np
import pytest

from training.active_ceiling import LIMITS, WINDOW, best_profile, least_rates, offsets, rates_of
from training.seeds import seeds
from training.stimuli import Cruise

BUDGET = 0.0762


@pytest.mark.parametrize("profile", [(1, 0.5, 0.0), (4, 0.2, 0.0), (2.7, 0.5, 1.0), (LIMITS[0][1], 0.8, 0.4)])
def test_profiles_keep_the_budget_and_the_mean(profile):
    values = np.array([offsets(np.array([profile]), time, BUDGET)[0] for time in np.arange(6000) * WINDOW / 6000])
    assert values.mean() == pytest.approx(0.0, abs=3e-4)
    assert np.sqrt(np.square(values).mean()) == pytest.approx(BUDGET, rel=5e-3)


def test_the_best_stimulus_of_a_lag_is_the_slowest_sine():
    """Lag x' = a (u - x): evidence gathers as mean(x^2), and of all u with mean 0 and mean square 1 the slowest sine,
    with 1 / (1 + (omega / a)^2), gives the most: every other one has a share in higher frequencies, which lag more.
    """
    a, n = 1.0, 1000

    def rate(profiles):
        x, total = np.zeros(len(profiles)), np.zeros(len(profiles))
        decay = np.exp(-a * WINDOW / n)
        for k in range(2 * n):
            x = decay * x + (1.0 - decay) * offsets(profiles, (k % n) * WINDOW / n, 1.0)
            total += (k >= n) * x * x / n
        return total

    ideal = 1.0 / (1.0 + (2.0 * np.pi / WINDOW / a) ** 2)
    best = best_profile(rate, seed=0)
    assert best.cycles == 1
    assert 0.9 * ideal < rate(np.array([best]))[0] < 1.01 * ideal
    assert rate(np.array([[1.0, 0.5, 1.0]]))[0] == pytest.approx(ideal, rel=0.01)


def test_a_square_wave_tells_drag_from_its_rivals_sooner_than_cruise():
    judged = seeds("test", 8, 700_000_100)
    passive = least_rates("increased_drag", Cruise(), judged).mean(axis=0).min()
    active = rates_of("increased_drag", np.array([[1.0, 0.5, 0.0], [1.0, 0.5, 0.0]]), judged)
    assert active[0] == active[1] > passive > 0.0
