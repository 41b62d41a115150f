import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS, INDEX, MAXIMUM_COMMAND
from training.bounds import active_ceiling
from training.bounds.active_ceiling import (
    LEVELS,
    LIMITS,
    TIMES,
    WINDOW,
    RepeatedOffsets,
    best_free_levels,
    best_profile,
    free_ceiling,
    least_rates,
    level_offsets,
    profile_offsets,
    rates_of,
    scale_to_budget,
)
from training.seeds import seeds
from training.stimuli import Cruise, Thesis

BUDGET = 0.0762


@pytest.mark.parametrize(
    "profile", [(1, 0.5, 0.0), (4, 0.2, 0.0), (2.7, 0.5, 1.0), (LIMITS[0][1], 0.8, 0.4)]
)
def test_profiles_keep_the_budget_and_the_mean(profile):
    values = profile_offsets(np.array([profile]), np.arange(6000) * WINDOW / 6000, BUDGET)
    assert values.mean() == pytest.approx(0.0, abs=3e-4)
    assert np.sqrt(np.square(values).mean()) == pytest.approx(BUDGET, rel=5e-3)


def test_the_best_stimulus_of_a_lag_is_the_slowest_sine():
    """Lag x' = a (u - x): evidence gathers as mean(x^2), and of all u with mean 0 and mean square 1
    the slowest sine, with 1 / (1 + (omega / a)^2), gives the most: every other one has a share in
    higher frequencies, which lag more.
    """
    a = 1.0
    n = 1000

    def rate(profiles):
        x = np.zeros(len(profiles))
        total = np.zeros(len(profiles))
        decay = np.exp(-a * WINDOW / n)
        offsets = profile_offsets(profiles, np.arange(n) * WINDOW / n, 1.0)
        for k in range(2 * n):
            x = decay * x + (1.0 - decay) * offsets[:, k % n]
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
    offsets = profile_offsets(np.array([[1.0, 0.5, 0.0]] * 2), TIMES, BUDGET)
    active = rates_of("increased_drag", offsets, judged)
    assert active[0] == active[1] > passive > 0.0


def test_free_profiles_keep_the_budget_and_the_mean():
    scaled = scale_to_budget(np.random.default_rng(0).normal(3.0, 1.0, (4, LEVELS)), BUDGET)
    np.testing.assert_allclose(scaled.mean(axis=1), 0.0, atol=1e-15)
    np.testing.assert_allclose(np.sqrt(np.mean(scaled**2, axis=1)), BUDGET)


def test_a_free_profile_gets_nearer_to_the_best_and_never_further():
    """What counts is how alike the levels are to a ramp: the rate is at most BUDGET, and 0 to start
    from.
    """
    ramp = scale_to_budget(np.arange(LEVELS)[None] * 1.0, 1.0)[0]
    start = scale_to_budget(np.square(np.arange(LEVELS) - 7.0)[None], BUDGET)[0]
    seen = []

    def rate(tried):
        seen.append((tried @ ramp / LEVELS).max())
        return tried @ ramp / LEVELS

    best = best_free_levels(rate, start, 0)
    assert abs(start @ ramp) < 1e-12 and (np.diff(seen) >= -1e-15).all()
    assert best @ ramp / LEVELS == pytest.approx(seen[-1])
    assert 0.5 * BUDGET < seen[-1] <= BUDGET
    np.testing.assert_array_equal(best, best_free_levels(rate, start, 0))


def test_offsets_are_repeated_as_far_as_the_channel_goes():
    observation = np.zeros((2, len(CHANNELS)))
    observation[:, INDEX["mission_speed"]] = 0.3, 0.9
    stimulus = RepeatedOffsets(profiles=np.array([[0.1, -0.4], [0.2, -0.4]]))
    np.testing.assert_allclose(stimulus.offset(0, observation, None), [0.1, MAXIMUM_COMMAND - 0.9])
    np.testing.assert_allclose(stimulus.offset(3, observation, None), [-0.3, -0.4])


def test_a_square_wave_is_as_good_as_levels_as_it_is_as_a_profile():
    judged = seeds("test", 3, 700_000_200)
    # changes after 8 s, the profile after 8.0025 s
    square = BUDGET * np.repeat([1.0, -1.0], [8, 7])
    square = scale_to_budget(square[None], BUDGET)
    profile = np.array([[1.0, 8.0025 / WINDOW, 0.0]])
    offsets = np.vstack([profile_offsets(profile, TIMES, BUDGET), level_offsets(square)])
    as_profile, as_levels = rates_of("increased_drag", offsets, judged)
    assert as_levels == pytest.approx(as_profile, rel=0.05)


def test_the_free_ceiling_is_no_lower_than_either_profile_and_stands_beside_the_thesis(monkeypatch):
    for name, value in (
        ("GENERATIONS", 1),
        ("TRIES", 2),
        ("ROUNDS", 1),
        ("TRIED_ON", 1),
        ("JUDGED_ON", 2),
    ):
        monkeypatch.setattr(active_ceiling, name, value)
    ceiling = free_ceiling("increased_drag", 5, 0.1)
    judged = seeds("test", 2, 700_000_006)
    assert ceiling["best"] == max(ceiling["free"], ceiling["active"])
    assert ceiling["thesis"] == pytest.approx(
        least_rates("increased_drag", Thesis(0.1), judged).mean(axis=0).min()
    )
    assert ceiling["thesis_speed_up"] == pytest.approx(ceiling["best"] / ceiling["thesis"])
    assert np.sqrt(np.mean(np.square(ceiling["levels"]))) == pytest.approx(0.1, abs=1e-3)
    assert ceiling["budget"] == 0.1
