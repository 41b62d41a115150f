"""Robust least squares with few parameters, many residuals, and bounds.

The residuals enter each iteration by sums alone (normal equations), which for a hundred thousand
residuals takes a fraction of the time of a decomposition of their Jacobian.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import lsq_linear

from training.field.calibration.samples import NORMAL_MAD

# standard deviations, beyond which a residual counts less than its square
ROBUST = 3.0
# scatter of the residuals, above which the model and not the noise causes them
MISFIT = 1.5
STEP = 1e-6  # of forward differences
MOST_ITERATIONS = 100
# that a step has to promise, by the mean cost of a residual: a hundredth of a standard deviation
SMALLEST_GAIN = 1e-4
COARSE_GAIN = 1e-4  # the same by the whole cost, while the scale is not known
FIRST_DAMPING = 1e-3  # of Levenberg and Marquardt, relative to the information
LARGEST_DAMPING = 1e12
LESS_DAMPING = 0.1  # factor after a step that lowers the cost
MORE_DAMPING = 5.0  # factor after one that does not
# of the largest: directions with less information are not stepped along
LEAST_INFORMATION = 1e-12

Bounds = tuple[float, float]
PointResiduals = Callable[[np.ndarray], np.ndarray]


class Optimum(NamedTuple):
    """Where the robust cost of the residuals is least."""

    point: np.ndarray  # (n_fitted,)
    residual: np.ndarray  # (n_residuals,)
    jacobian: np.ndarray  # of the residuals, (n_residuals, n_fitted)
    scale: float  # size from which a residual is large

    @property
    def excess(self) -> np.ndarray:
        """Squared sizes of the residuals by the scale, (n_residuals,)."""
        return (self.residual / self.scale) ** 2


def robust_optimum(
    residuals: PointResiduals, start: Sequence[float], bounds: Sequence[Bounds]
) -> Optimum:
    """The optimum of the robust cost, scale^2 sum((1 + z)^(1/2) - 1) with z = (residual/scale)^2.

    The scale is `ROBUST`. Where the residuals scatter by more than `MISFIT`, it follows their
    scatter.
    """
    low, high = np.array(bounds).T
    point = np.clip(start, low, high)
    first = _linearised(residuals, point, residuals(point), high, ROBUST)
    optimum = _minimised(residuals, first, low, high, COARSE_GAIN * first.residual.size)
    scatter = NORMAL_MAD * float(np.median(np.abs(optimum.residual)))
    if scatter > MISFIT:
        optimum = optimum._replace(scale=ROBUST * scatter)
    return _minimised(residuals, optimum, low, high, SMALLEST_GAIN)


def _minimised(
    residuals: PointResiduals, optimum: Optimum, low: np.ndarray, high: np.ndarray, gain: float
) -> Optimum:
    """The optimum by the method of Levenberg and Marquardt, from a point within the bounds.

    It ends where a step promises less than a gain, by the mean cost of a residual.
    """
    damping = FIRST_DAMPING
    for _ in range(MOST_ITERATIONS):
        information, gradient = normal_equations(optimum)
        cost = _cost(optimum.residual, optimum.scale)
        least = gain * cost / optimum.residual.size
        while damping < LARGEST_DAMPING:
            damped = information + damping * np.diag(np.diagonal(information))
            step = _bounded_step(damped, gradient, low - optimum.point, high - optimum.point)
            promised = -float(gradient @ step + 0.5 * step @ information @ step)
            if promised <= least:
                return optimum
            point = np.clip(optimum.point + step, low, high)
            residual = residuals(point)
            if _cost(residual, optimum.scale) < cost:
                break
            damping *= MORE_DAMPING
        else:
            return optimum
        damping *= LESS_DAMPING
        optimum = _linearised(residuals, point, residual, high, optimum.scale)
    return optimum


def _linearised(
    residuals: PointResiduals,
    point: np.ndarray,
    residual: np.ndarray,
    high: np.ndarray,
    scale: float,
) -> Optimum:
    return Optimum(point, residual, jacobian_of(residuals, point, residual, high), scale)


def jacobian_of(
    residuals: PointResiduals, point: np.ndarray, residual: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Derivatives (n_residuals, n_fitted) by differences, backward where forward is too high."""
    jacobian = np.empty((point.size, residual.size))
    for k in range(point.size):
        step = STEP if point[k] + STEP <= high[k] else -STEP
        moved = point.copy()
        moved[k] += step
        jacobian[k] = (residuals(moved) - residual) / step
    return jacobian.T


def _cost(residual: np.ndarray, scale: float) -> float:
    excess = (residual / scale) ** 2
    return float(scale**2 * np.sum(excess / (1.0 + np.sqrt(1.0 + excess))))


def normal_equations(optimum: Optimum) -> tuple[np.ndarray, np.ndarray]:
    """Information (n_fitted, n_fitted) and gradient (n_fitted,) of the robust cost."""
    curvature = (1.0 + optimum.excess) ** -1.5
    information = (optimum.jacobian * curvature[:, None]).T @ optimum.jacobian
    return information, optimum.jacobian.T @ weighted(optimum.residual, optimum.scale)


def weighted(residual: np.ndarray, scale: float) -> np.ndarray:
    """Derivative of the robust cost by the residuals, (n_residuals,)."""
    return residual / np.sqrt(1.0 + (residual / scale) ** 2)


def _bounded_step(
    information: np.ndarray, gradient: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """The step within bounds that minimises the quadratic of information and gradient."""
    along_axis, axes = np.linalg.eigh(information)
    is_known = along_axis > LEAST_INFORMATION * along_axis.max()
    root = np.sqrt(np.where(is_known, along_axis, 1.0))
    target = np.where(is_known, -(axes.T @ gradient) / root, 0.0)
    return lsq_linear(root[:, None] * axes.T, target, (low, high), method="bvls").x
