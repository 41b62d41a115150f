"""Robust least squares: which parameters the residuals identify, and with what intervals.

The intervals are those of a jackknife: each block of time is left out in turn, and one Newton step
moves the fit. They hold where residuals within a block are correlated and where their noise was
assumed too small; with few blocks they are wide.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from scipy.stats import t as student

from training.field.calibration.robust_optimum import (
    LEAST_INFORMATION,
    ROBUST,
    Bounds,
    PointResiduals,
    jacobian_of,
    normal_equations,
    robust_optimum,
    weighted,
)

LARGEST_STD = 0.15  # of an estimate, relative: above, a parameter is not identified
LEAST_BLOCKS = 4
LARGEST_VARIANCE = 1e100  # of a unit that lacks information: its square is a number, too

Values = Mapping[str, float]  # by the name of the parameter or the reading
Residuals = Callable[[Values], np.ndarray]
NOWHERE: Values = MappingProxyType({})


@dataclass(frozen=True)
class Problem:
    """A least-squares problem."""

    residuals: Residuals  # (n_residuals,) of unit variance, from all parameters by name
    start: Values  # first value by parameter, which one that is not fitted keeps
    bounds: Mapping[str, Bounds]  # least and largest value by parameter
    order: Sequence[str]  # parameters to fit, first those to be fixed when not all are identified
    nuisance: Sequence[str]  # parameters that are fitted in any case
    block: np.ndarray  # block of time of each residual, (n_residuals,)
    unit: np.ndarray  # its unit (mission, shaft), which has its own estimate, (n_residuals,)
    # residuals under other assumptions, each a standard deviation off, which widen the intervals
    variants: Sequence[Residuals] = ()


class Fit(NamedTuple):
    """Estimates of the parameters `names`."""

    names: tuple[str, ...]
    estimate: np.ndarray  # (n_fitted,)
    covariance: np.ndarray  # (n_fitted, n_fitted)
    quantile: float  # half the width of a 95 % interval by the standard deviation
    units: np.ndarray  # the units with residuals, (n_units,)
    unit_estimates: np.ndarray  # each unit's own estimate, to first order, (n_units, n_fitted)
    unit_variances: np.ndarray  # their variances; huge where the unit lacks information
    # of parameters that were not identified: largest relative std of the last fit with each
    unidentified: Values

    @property
    def values(self) -> dict[str, float]:
        """The estimates by name."""
        return dict(zip(self.names, self.estimate.tolist(), strict=True))

    @property
    def std(self) -> np.ndarray:
        """Standard deviations of the estimates, (n_fitted,)."""
        return np.sqrt(np.diagonal(self.covariance))

    def largest_std(self, names: Sequence[str]) -> float:
        """Largest relative standard deviation of these parameters; huge for one not positive."""
        relative = self.std / np.maximum(self.estimate, 1e-12)
        relative = np.nan_to_num(relative, nan=np.inf, posinf=np.inf)
        return max((float(relative[self.names.index(name)]) for name in names), default=0.0)


NO_FIT = Fit(
    names=(),
    estimate=np.empty(0),
    covariance=np.empty((0, 0)),
    quantile=np.nan,
    units=np.empty(0),
    unit_estimates=np.empty((0, 0)),
    unit_variances=np.empty((0, 0)),
    unidentified={},
)


def fit_identifiable(problem: Problem, like: Fit = NO_FIT) -> Fit:
    """Fit the parameters that the residuals identify, first those of another fit, near its values.

    As long as a parameter is not identified, the first of the problem's order is fixed; then those
    fixed before the last are tried once more. With fewer than `LEAST_BLOCKS` blocks of time nothing
    is identified, and standard deviations are NaN.
    """
    free = list(problem.order)
    unidentified = {}
    if np.unique(problem.block).size < LEAST_BLOCKS:
        return NO_FIT._replace(unidentified=dict.fromkeys(free, np.nan))
    if like.names:
        fit = fit_parameters(problem, like.names, like.values)
        if fit.largest_std([name for name in free if name in like.names]) <= LARGEST_STD:
            return fit._replace(unidentified=like.unidentified)
    fit = fit_parameters(problem, (*free, *problem.nuisance))
    while (std := fit.largest_std(free)) > LARGEST_STD:
        unidentified[free.pop(0)] = std
        fit = fit_parameters(problem, (*free, *problem.nuisance))
    for name in list(unidentified)[-2::-1]:
        larger_fit = fit_parameters(problem, (name, *free, *problem.nuisance))
        if larger_fit.largest_std((name, *free)) <= LARGEST_STD:
            free = [name, *free]
            fit = larger_fit
            del unidentified[name]
    return fit._replace(unidentified=unidentified)


def fit_parameters(problem: Problem, names: Sequence[str], near: Values = NOWHERE) -> Fit:
    """Fit these parameters, beginning near these values, the others fixed at their start."""

    def at_point(residuals: Residuals) -> PointResiduals:
        return lambda point: residuals(dict(problem.start) | dict(zip(names, point, strict=True)))

    if not names:
        return NO_FIT
    start = [near.get(name, problem.start[name]) for name in names]
    bounds = [problem.bounds[name] for name in names]
    optimum = robust_optimum(at_point(problem.residuals), start, bounds)
    score = optimum.jacobian * weighted(optimum.residual, optimum.scale)[:, None]
    slope = optimum.jacobian * ((1.0 + optimum.excess) ** -0.75)[:, None]
    covariance, quantile = _jackknife(slope, score, problem.block)
    information, _ = normal_equations(optimum)
    _, high = np.transpose(bounds)
    for variant in map(at_point, problem.variants):
        residual = variant(optimum.point)
        jacobian = jacobian_of(variant, optimum.point, residual, high)
        _, gradient = normal_equations(optimum._replace(residual=residual, jacobian=jacobian))
        change = np.linalg.solve(_invertible(information), gradient)
        covariance = covariance + np.outer(change, change)
    weighted_slope = optimum.jacobian * ((1.0 + optimum.excess) ** -0.25)[:, None]
    changes, variances = _unit_changes(*_group_sums(weighted_slope, score, problem.unit))
    return Fit(
        names=tuple(names),
        estimate=optimum.point,
        covariance=covariance,
        quantile=quantile,
        units=np.unique(problem.unit),
        unit_estimates=optimum.point + changes,
        unit_variances=_scaled(variances, optimum.scale / ROBUST),
        unidentified={},
    )


def _group_sums(
    slope: np.ndarray, score: np.ndarray, group: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Information (n_groups, n_fitted, n_fitted) and gradient (n_groups, n_fitted)."""
    order = np.argsort(group, kind="stable")
    first = np.flatnonzero(np.diff(group[order], prepend=-1))
    parts = np.split(slope[order], first[1:])
    information = np.stack([part.T @ part for part in parts])
    gradient = np.add.reduceat(score[order], first)
    return information, gradient


def _jackknife(slope: np.ndarray, score: np.ndarray, block: np.ndarray) -> tuple[np.ndarray, float]:
    """Covariance (n_fitted, n_fitted), and the quantile of a 95 % interval."""
    information, gradient = _group_sums(slope, score, block)
    total = information.sum(axis=0)
    n_blocks = len(gradient)
    without_block = _invertible(total - information)
    change = np.linalg.solve(without_block, gradient[:, :, None])[:, :, 0]
    covariance = (n_blocks - 1) / n_blocks * change.T @ change
    is_unknown = np.diagonal(total) <= LEAST_INFORMATION * np.trace(total)
    covariance = covariance + np.diag(np.where(is_unknown, np.inf, 0.0))
    return covariance, float(student.ppf(0.975, n_blocks - 1))


def _unit_changes(information: np.ndarray, gradient: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Each unit's own estimate less the common one, and its variance, (n_units, n_fitted) each."""
    inverse = np.linalg.inv(_invertible(information))
    change = -np.einsum("uij,uj->ui", inverse, gradient)
    return change, np.diagonal(inverse, axis1=1, axis2=2)


def _scaled(variances: np.ndarray, factor: float) -> np.ndarray:
    """The variances for a standard deviation larger by a factor, `LARGEST_VARIANCE` at most."""
    with np.errstate(over="ignore"):
        return np.minimum(variances * factor**2, LARGEST_VARIANCE)


def _invertible(information: np.ndarray) -> np.ndarray:
    size = information.shape[-1]
    trace = np.trace(information, axis1=-2, axis2=-1)[..., None, None]
    return information + (LEAST_INFORMATION * trace + np.finfo(float).tiny) * np.eye(size)
