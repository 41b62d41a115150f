"""The bounds against cases solved by hand: readings that are independent Gaussians, shifted by the
fault.
"""

import numpy as np
import pytest
from scipy.stats import norm

from auv_fault_env.parameters import SAMPLE_TIME
from training.bounds import delays

SHIFT = 0.5  # standard deviations: SHIFT**2 / 2 = 0.125 nat per sample
N_SAMPLES = 300
N_LANES = 20_000


def ratios(shift, n_samples=N_SAMPLES, n_lanes=N_LANES, faulty=True, seed=0):
    """Log-likelihood ratios over time, (n_samples, n_lanes), and each sample's own."""
    readings = np.random.default_rng(seed).standard_normal((n_samples, n_lanes)) + shift * faulty
    steps = shift * readings - shift**2 / 2
    return np.cumsum(steps, axis=0), steps


def test_asymptotic_delay_is_log_of_the_mean_time_over_the_rate():
    assert delays.asymptotic_delay(2.0, np.exp(6.0)) == pytest.approx(3.0)
    assert delays.asymptotic_delay(0.0, 100.0) == np.inf


def test_a_coin_beats_the_asymptotic_delay_where_information_is_small():
    samples = 100.0
    mean_delay_of_a_coin = samples * SAMPLE_TIME
    assert mean_delay_of_a_coin < delays.asymptotic_delay(1e-3, samples)
    chance = 1.0 - (1.0 - 1.0 / samples) ** np.arange(1, N_SAMPLES + 1)
    assert (chance <= delays.detection_power(np.zeros((N_SAMPLES, 10)), samples) + 1e-12).all()


def test_information_rate_of_a_gaussian_shift():
    llr, _ = ratios(SHIFT)
    assert delays.information_rate(llr).mean() == pytest.approx(
        SHIFT**2 / 2 / SAMPLE_TIME, rel=0.01
    )
    assert delays.late_rate(llr).mean() == pytest.approx(SHIFT**2 / 2 / SAMPLE_TIME, rel=0.01)


@pytest.mark.parametrize("m", [1, 10, 50])
@pytest.mark.parametrize("level", [0.001, 0.05, 0.3])
def test_neyman_pearson_power_of_a_gaussian_shift(m, level):
    llr, _ = ratios(SHIFT, n_samples=m)
    exact = norm.sf(norm.isf(level) - SHIFT * np.sqrt(m))
    assert delays.neyman_pearson_power(llr[-1], level) == pytest.approx(exact, abs=0.015)


def test_one_threshold_for_all_lanes_is_the_optimum_for_their_mean():
    strong, _ = ratios(1.0, n_samples=4)
    llr = np.concatenate([strong[-1], np.zeros(N_LANES)])
    power = delays.neyman_pearson_power(llr, 0.01)
    assert power == pytest.approx(0.5 * norm.sf(norm.isf(0.02) - 2.0), abs=0.01)


def test_power_is_never_below_the_level_and_never_above_one():
    assert delays.neyman_pearson_power(np.full(10, -50.0), 0.2) == 0.2
    assert delays.neyman_pearson_power(np.full(10, 50.0), 1e-6) == 1.0
    assert np.isfinite(delays.neyman_pearson_power(np.array([-1e5, 1e5]), 0.1))


def test_delay_bound_is_the_area_above_the_power():
    assert delays.delay_bound(np.ones(300)) == pytest.approx(SAMPLE_TIME)
    assert delays.delay_bound(np.zeros(300)) == pytest.approx(300 * SAMPLE_TIME)
    assert delays.delay_bound(np.array([0.0, 0.5, 1.0, 1.0])) == pytest.approx(
        (1 + 1 + 0.5) * SAMPLE_TIME
    )


def test_cusum_which_is_optimal_does_not_beat_the_bound_but_comes_near():
    """Page's CUSUM: its worst mean delay is the least there is, Moustakides, Ann. Stat. 14 (1986)
    1379.
    """
    samples = 1000.0
    _, healthy = ratios(SHIFT, n_samples=20_000, n_lanes=200, faulty=False, seed=1)
    low = 0.0
    high = 20.0
    for _ in range(12):
        threshold = (low + high) / 2
        low, high = (
            (threshold, high)
            if mean_time_to_alarm(healthy, threshold) < samples
            else (low, threshold)
        )
    llr, faulty = ratios(SHIFT, n_lanes=4000, seed=2)
    first = first_alarm(faulty, threshold)
    bound = delays.delay_bound(delays.detection_power(llr, samples))
    measured = np.minimum(first + 1, N_SAMPLES).mean() * SAMPLE_TIME
    assert bound < measured < 2.5 * bound


def first_alarm(steps, threshold):
    statistic = np.zeros(steps.shape[1])
    first = np.full(steps.shape[1], len(steps))
    for k, step in enumerate(steps):
        statistic = np.maximum(statistic, 0.0) + step
        first = np.where((statistic > threshold) & (first == len(steps)), k, first)
    return first


def mean_time_to_alarm(steps, threshold):
    first = first_alarm(steps, threshold)
    return (first + 1).sum() / max((first < len(steps)).sum(), 1)


def test_mean_inverse_ratio_is_one_for_likelihood_ratios_and_tells_false_ones():
    llr, _ = ratios(0.3, n_samples=5)
    assert delays.mean_inverse_ratio(llr[-1]) == pytest.approx(1.0, abs=0.05)
    assert delays.mean_inverse_ratio(2.0 * llr[-1]) > 1.2


def test_bootstrap_interval_holds_the_bound_and_narrows_with_lanes():
    llr, _ = ratios(SHIFT, n_lanes=400)

    def bound(some):
        return delays.delay_bound(delays.detection_power(llr[:, some], 1e4))

    few = bootstrapped(bound, 40)
    many = bootstrapped(bound, 400)
    assert many[0] <= bound(np.arange(400)) <= many[1]
    assert many[1] - many[0] < 0.6 * (few[1] - few[0])


def bootstrapped(bound, n_lanes):
    return delays.bootstrap(bound, n_lanes, seed=0)


def test_right_for_good_by_hand():
    is_right = np.array(
        [
            [True, False, True, False],
            [True, True, False, False],
            [True, True, True, False],
            [True, True, True, False],
        ]
    )
    np.testing.assert_allclose(delays.right_for_good(is_right), [0.1, 0.2, 0.3, 0.4])
