import numpy as np
import pytest
from scipy.optimize import least_squares

from training.field.calibration.robust_optimum import MISFIT, ROBUST, robust_optimum

N = 3000
RANDOM = np.random.default_rng(8)
TIME = np.linspace(0.0, 3.0, N)
TRUTH = np.array([2.0, 0.7])
NOISE = RANDOM.standard_normal(N) + np.where(RANDOM.uniform(size=N) < 0.05, 30.0, 0.0)
WIDE = [(-50.0, 50.0), (1e-3, 9.0)]


def decay(scatter):
    """Residuals of an exponential decay with 5 % outliers; 100 times the noise is its height."""

    def residuals(point):
        height, rate = point
        truth, true_rate = TRUTH
        model = height * np.exp(-rate * TIME) - truth * np.exp(-true_rate * TIME)
        return 100.0 * model + scatter * NOISE

    return residuals


@pytest.mark.parametrize("start", [(1.0, 1.0), (-3.0, 6.0)])
def test_the_optimum_is_that_of_scipy(start):
    residuals = decay(1.0)
    optimum = robust_optimum(residuals, start, WIDE)
    bounds = tuple(zip(*WIDE, strict=True))
    expected = least_squares(residuals, (2.0, 0.7), bounds=bounds, loss="soft_l1", f_scale=ROBUST)
    information = optimum.jacobian.T @ optimum.jacobian
    std = np.sqrt(np.diagonal(np.linalg.inv(information)))
    assert (np.abs(optimum.point - expected.x) < 0.05 * std).all()
    assert optimum.scale == ROBUST
    np.testing.assert_array_equal(optimum.residual, residuals(optimum.point))


def test_the_scale_follows_residuals_that_scatter_by_more_than_the_noise():
    optimum = robust_optimum(decay(10.0), (1.0, 1.0), WIDE)
    assert optimum.scale == pytest.approx(10.0 * ROBUST, rel=0.15) and optimum.scale > MISFIT
    np.testing.assert_allclose(optimum.point, TRUTH, atol=0.05)


def test_bounds_hold_and_the_other_parameter_is_at_its_best_there():
    bounds = [(-50.0, 1.8), (1e-3, 9.0)]
    optimum = robust_optimum(decay(1.0), (1.0, 1.0), bounds)
    height, rate = optimum.point
    assert height == 1.8
    alone = robust_optimum(lambda point: decay(1.0)((1.8, *point)), (1.0,), bounds[1:])
    assert rate == pytest.approx(alone.point[0], rel=1e-3)


def test_a_parameter_without_any_effect_stays_where_it_begins():
    def residuals(point):
        return decay(1.0)(point[:2])

    optimum = robust_optimum(residuals, (1.0, 1.0, 0.3), [*WIDE, (0.0, 1.0)])
    assert optimum.point[2] == pytest.approx(0.3)
    np.testing.assert_allclose(optimum.point[:2], TRUTH, atol=0.05)
