"""The general pieces of a calibration against cases that can be computed by hand."""

from dataclasses import replace

import numpy as np
import pytest

from training.field.calibration.healthy_band import PRIOR_UNITS, between_variance, healthy_band
from training.field.calibration.robust_fit import (
    LARGEST_STD,
    Problem,
    fit_identifiable,
    fit_parameters,
)
from training.field.calibration.samples import noise_levels, samples_of
from training.field.logs.log import Log

N = 4000
BLOCKS = 40
RANDOM = np.random.default_rng(3)
DESIGN = np.column_stack(
    [RANDOM.uniform(1.0, 2.0, N), RANDOM.uniform(-1.0, 1.0, N), np.full(N, 1e-9)]
)
TRUTH = np.array([1.5, 0.7, 1.0])


def problem(noise, design=DESIGN, block=None, unit=None):
    names = ("slope", "tilt", "ghost")
    block = np.arange(N) // (N // BLOCKS) if block is None else block

    def residuals(values):
        return design @ (TRUTH - [values[name] for name in names]) + noise

    bounds = dict.fromkeys(names, (-10.0, 10.0))
    start = dict.fromkeys(names, 1.0)
    return Problem(
        residuals,
        start,
        bounds,
        ("ghost", "tilt", "slope"),
        (),
        block,
        block if unit is None else unit,
    )


def test_linear_problem_has_the_estimates_and_errors_of_ordinary_least_squares():
    noise = RANDOM.standard_normal(N)
    fit = fit_identifiable(problem(noise))
    known = DESIGN[:, :2]
    covariance = np.linalg.inv(known.T @ known)
    expected = TRUTH[:2] + covariance @ known.T @ noise
    assert fit.names == ("tilt", "slope")
    assert (abs(fit.estimate[::-1] - expected) < 0.3 * np.sqrt(np.diagonal(covariance))).all()
    # of 40 blocks: 11 % by luck
    np.testing.assert_allclose(fit.std[::-1], np.sqrt(np.diagonal(covariance)), rtol=0.35)
    assert (
        fit.unidentified == {"ghost": pytest.approx(fit.unidentified["ghost"])}
        and fit.unidentified["ghost"] > LARGEST_STD
    )
    assert fit.quantile == pytest.approx(2.0227, abs=1e-3)  # Student's t, 39 degrees of freedom


def counted(problem):
    """The problem, and the list of the points at which its residuals were computed."""
    points = []

    def residuals(values):
        points.append(values)
        return problem.residuals(values)

    return replace(problem, residuals=residuals), points


def test_a_fit_like_another_begins_there_and_has_its_parameters():
    first = fit_identifiable(problem(RANDOM.standard_normal(N)))
    other, points = counted(problem(RANDOM.standard_normal(N)))
    alone = fit_identifiable(other)
    n_alone = len(points)
    like = fit_identifiable(other, first)
    assert 2 * (len(points) - n_alone) < n_alone
    assert like.names == alone.names and like.unidentified == first.unidentified
    assert (abs(like.estimate - alone.estimate) < 0.05 * alone.std).all()


def test_a_fit_like_another_fixes_what_its_own_residuals_do_not_identify():
    first = fit_identifiable(problem(RANDOM.standard_normal(N)))
    without_tilt = problem(RANDOM.standard_normal(N), design=DESIGN * [1.0, 1e-9, 1.0])
    assert first.names == ("tilt", "slope")
    assert fit_identifiable(without_tilt, first).names == ("slope",)


def test_correlated_errors_within_a_block_widen_the_interval():
    shared = np.repeat(RANDOM.standard_normal(BLOCKS), N // BLOCKS)
    alone = fit_parameters(problem(RANDOM.standard_normal(N)), ("slope",))
    together = fit_parameters(problem(shared), ("slope",))
    assert together.std[0] > 5.0 * alone.std[0]  # sqrt(100) = 10 if the regressor were constant


def test_outliers_hardly_move_the_estimate():
    noise = RANDOM.standard_normal(N)
    wild = noise + np.where(RANDOM.uniform(size=N) < 0.02, 100.0, 0.0)
    assert fit_parameters(problem(wild), ("slope",)).estimate[0] == pytest.approx(1.5, abs=0.2)
    # least squares
    assert (DESIGN[:, 0] @ (DESIGN[:, 0] * 1.5 + wild)) / (DESIGN[:, 0] @ DESIGN[:, 0]) > 2.5


def test_estimates_of_units_are_those_of_the_unit_alone():
    noise = 0.1 * RANDOM.standard_normal(N)  # so small that the loss is quadratic
    unit = np.arange(N) % 3
    fit = fit_parameters(problem(noise, unit=unit), ("slope",))
    for number, own, variance in zip(
        fit.units, fit.unit_estimates[:, 0], fit.unit_variances[:, 0], strict=True
    ):
        x = DESIGN[unit == number, 0]
        y = (DESIGN[:, 0] * 1.5 + DESIGN[:, 1] * -0.3 + noise)[unit == number]
        assert own == pytest.approx(x @ y / (x @ x), abs=2e-3)
        assert variance == pytest.approx(1.0 / (x @ x), rel=0.05)


def test_too_few_blocks_identify_nothing():
    fit = fit_identifiable(problem(np.zeros(N), block=np.arange(N) * 3 // N))
    assert fit.names == () and np.isnan(list(fit.unidentified.values())).all()


def test_between_variance_by_hand():
    """Two units at 0 and 2 with variance 1 each: Q = 2, Q - 1 = 1, over 2 - 2/2 = 1."""
    assert between_variance(np.array([0.0, 2.0]), np.ones(2)) == pytest.approx(1.0)
    assert between_variance(np.array([0.0, 1.0]), np.ones(2)) == 0.0


def test_band_by_hand_one_unit_and_many():
    assert healthy_band(np.array([0.9]), np.array([0.01]), 0.0, 0.06) == pytest.approx(0.06)
    n = 10_000
    spread = 0.1
    own = 1.0 + np.random.default_rng(0).uniform(-spread, spread, n)
    assert healthy_band(own, np.full(n, 1e-8), 0.0, 0.06) == pytest.approx(spread, rel=0.02)
    alike = healthy_band(np.ones(13), np.full(13, 1e-8), 0.0, 0.06)
    assert alike == pytest.approx(0.06 * (PRIOR_UNITS / (PRIOR_UNITS + 12)) ** 0.5)
    assert healthy_band(np.ones(1), np.full(1, 1e-4), 0.02, 0.0) == pytest.approx(3**0.5 * 0.02)


def test_units_without_information_do_not_count():
    own = np.array([1.0, 1.01, 50.0])
    variance = np.array([1e-4, 1e-4, 1e300])
    assert healthy_band(own, variance, 0.0, 0.05) == pytest.approx(
        healthy_band(own[:2], variance[:2], 0.0, 0.05)
    )


def log(observation, segments=None):
    size = len(observation)
    return Log("log.csv", 0.1 * np.arange(size), observation, segments or (slice(0, size),), ())


def test_samples_are_interpolated_within_segments_and_never_across():
    observation = np.full((60, 12), np.nan)
    observation[:20:10, 4] = [1.0, 2.0]
    observation[30:60:10, 4] = [5.0, 6.0, 7.0]
    samples = samples_of([log(observation, (slice(0, 20), slice(30, 60))), log(observation[:20])])
    np.testing.assert_allclose(
        samples.interpolated_channel("speed")[[0, 5, 10, 15, 20, 25]], [1, 1.5, 2, 2, 5, 5.5]
    )
    assert np.isnan(samples.channel("speed")).sum() == 70 - 7
    assert np.flatnonzero(samples.starts).tolist() == [0, 20, 50]
    assert samples.since_start[[0, 19, 20, 49, 50]].tolist() == [0, 19, 0, 29, 0]
    assert np.unique(samples.block).tolist() == [0, 1, 2] and np.bincount(
        samples.mission
    ).tolist() == [50, 20]
    assert not samples.has("port_rpm") and samples.measured_shaft_speeds is None


def test_shaft_without_a_counter_turns_as_the_other():
    observation = np.full((20, 12), np.nan)
    observation[:, 11] = 300.0
    np.testing.assert_allclose(samples_of([log(observation)]).measured_shaft_speeds, 10.0 * np.pi)


@pytest.mark.parametrize("every", [1, 10])
def test_noise_is_distinguished_from_signal(every):
    time = 0.1 * np.arange(6000)
    observation = np.full((time.size, 12), np.nan)
    observation[::every, 4] = (
        0.3 + 0.1 * np.sin(0.05 * time) + RANDOM.normal(0.0, 0.01, time.size)
    )[::every]
    observation[::every, 6] = 4.0  # a voltage that never changes
    # hardly ever
    observation[::every, 7] = np.where(RANDOM.uniform(size=time.size) < 0.1, 1.0, 0.0)[::every]
    levels = noise_levels(samples_of([log(observation)]))
    assert levels["speed"] == pytest.approx(0.01, rel=0.12)
    assert "port_voltage" not in levels
    assert levels["port_current"] == pytest.approx(0.3, rel=0.25)
