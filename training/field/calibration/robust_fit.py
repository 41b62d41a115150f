"""Robust least squares with honest intervals: which parameters the residuals identify, and how well.

The intervals are those of a jackknife: each block of time is left out in turn, the fit following by
one Newton step. They hold where residuals within a block go together and where their noise was
taken too small; with few blocks they are wide, as they should be.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import OptimizeResult, least_squares
from scipy.stats import t as student

from training.field.calibration.samples import NORMAL_MAD

ROBUST = 3.0  # standard deviations, beyond which a residual counts less than its square (soft_l1)
MISFIT = 1.5  # scatter of the residuals, above which the model and not the noise makes them
LARGEST_STD = 0.15  # of an estimate, relative: above, a parameter is not identified
LEAST_BLOCKS = 4
STEP = 1e-6  # of forward differences
RIDGE = 1e-12  # of the largest information: keeps what nothing is known of invertible


@dataclass(frozen=True)
class Problem:
    """A least-squares problem.

    Attributes
    ----------
    residuals
        Residuals (n_residuals,) of unit variance, given all of `start`'s parameters by name.
    start, bounds
        By parameter: where to begin, and between which values.
    order
        The parameters to fit, first those to be held when not all are identified.
    nuisance
        Parameters that are fitted in any case.
    block, unit
        (n_residuals,) the block of time of each residual, and its unit (mission, shaft), which has
        its own estimate.
    variants
        The same residuals under other assumptions, each a standard deviation off: what they change,
        widens intervals.
    """

    residuals: Callable[[Mapping[str, float]], np.ndarray]
    start: Mapping[str, float]
    bounds: Mapping[str, tuple[float, float]]
    order: Sequence[str]
    nuisance: Sequence[str]
    block: np.ndarray
    unit: np.ndarray
    variants: Sequence[Callable[[Mapping[str, float]], np.ndarray]] = ()


class Fit(NamedTuple):
    """Estimates (n_free,) of the parameters `names`, their covariance, and what makes up a 95 % interval.

    quantile: half the interval's width by the standard deviation. units (n_units,), own,
    own_variance (n_units, n_free): each unit's own estimate and its variance, both to first order;
    the variance is huge where the unit tells nothing. held: by parameter that was not identified,
    the largest relative standard deviation in the last fit that it was part of.
    """

    names: tuple[str, ...]
    estimate: np.ndarray
    covariance: np.ndarray
    quantile: float
    units: np.ndarray
    own: np.ndarray
    own_variance: np.ndarray
    held: Mapping[str, float]

    @property
    def values(self) -> dict[str, float]:
        """The estimates by name."""
        return dict(zip(self.names, self.estimate.tolist(), strict=True))

    @property
    def std(self) -> np.ndarray:
        """Standard deviations of the estimates, (n_free,)."""
        return np.sqrt(np.diagonal(self.covariance))

    def worst(self, names: Sequence[str]) -> float:
        """Largest relative standard deviation of these parameters; one that is not positive is not known at all."""
        share = np.nan_to_num(
            self.std / np.maximum(self.estimate, 1e-12), nan=np.inf, posinf=np.inf
        )
        return max((float(share[self.names.index(name)]) for name in names), default=0.0)


NO_FIT = Fit(
    (), np.empty(0), np.empty((0, 0)), np.nan, np.empty(0), np.empty((0, 0)), np.empty((0, 0)), {}
)


def identified(problem: Problem) -> Fit:
    """Fit what the residuals identify.

    As long as a parameter is not identified, the first of the problem's order is held; then those
    held before the last are tried once more. With fewer than `LEAST_BLOCKS` blocks of time nothing
    is identified, and standard deviations are NaN.
    """
    free = list(problem.order)
    held = {}
    if np.unique(problem.block).size < LEAST_BLOCKS:
        return NO_FIT._replace(held=dict.fromkeys(free, np.nan))
    fit = fitted(problem, (*free, *problem.nuisance))
    while (share := fit.worst(free)) > LARGEST_STD:
        held[free.pop(0)] = share
        fit = fitted(problem, (*free, *problem.nuisance))
    for name in list(held)[-2::-1]:
        more = fitted(problem, (name, *free, *problem.nuisance))
        if more.worst((name, *free)) <= LARGEST_STD:
            free = [name, *free]
            fit = more
            del held[name]
    return fit._replace(held=held)


def fitted(problem: Problem, names: Sequence[str]) -> Fit:
    """Fit these parameters, the others held at their start."""

    def at(residuals):
        return lambda point: residuals(dict(problem.start) | dict(zip(names, point, strict=True)))

    if not names:
        return NO_FIT
    found, robust = _least(
        at(problem.residuals), *(_of(part, names) for part in (problem.start, problem.bounds))
    )
    # least_squares gives the Jacobian of the robust cost: its rows by (1 + z)^(-3/4), z =
    # (residual/robust)^2
    z = (found.fun / robust) ** 2
    score = found.jac * (found.fun * (1.0 + z) ** 0.25)[:, None]
    covariance, quantile = _jackknife(found.jac, score, problem.block)
    for variant in problem.variants:
        moved = _moved(at(variant), found.x, found.jac, robust)
        covariance = covariance + np.outer(moved, moved)
    own, own_variance = _own(*_sums(found.jac * np.sqrt(1.0 + z)[:, None], score, problem.unit))
    own_variance = own_variance * (robust / ROBUST) ** 2
    return Fit(
        tuple(names),
        found.x,
        covariance,
        quantile,
        np.unique(problem.unit),
        found.x + own,
        own_variance,
        {},
    )


def _of(values: Mapping, names: Sequence[str]) -> list:
    return [values[name] for name in names]


def _least(residuals: Callable, start: list, bounds: list) -> tuple[OptimizeResult, float]:
    """The robust optimum, and the size from which on a residual is large: by their own scatter where it is above 1."""
    robust = ROBUST
    bounds = tuple(zip(*bounds, strict=True))
    found = least_squares(residuals, start, bounds=bounds, loss="soft_l1", f_scale=robust)
    scatter = NORMAL_MAD * float(np.median(np.abs(found.fun)))
    if scatter > MISFIT:
        robust = ROBUST * scatter
        found = least_squares(residuals, found.x, bounds=bounds, loss="soft_l1", f_scale=robust)
    return found, robust


def _sums(
    jacobian: np.ndarray, score: np.ndarray, group: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Information (n_groups, n_free, n_free) and gradient (n_groups, n_free) of each group that has residuals."""
    order = np.argsort(group, kind="stable")
    first = np.flatnonzero(np.diff(group[order], prepend=-1))
    products = jacobian[order, :, None] * jacobian[order, None, :]
    return np.add.reduceat(products, first), np.add.reduceat(score[order], first)


def _jackknife(
    jacobian: np.ndarray, score: np.ndarray, block: np.ndarray
) -> tuple[np.ndarray, float]:
    """Covariance (n_free, n_free), and the quantile of a 95 % interval."""
    information, gradient = _sums(jacobian, score, block)
    n_blocks = len(gradient)
    rest = _invertible(information.sum(axis=0) - information)
    moved = np.linalg.solve(rest, gradient[:, :, None])[:, :, 0]
    covariance = (n_blocks - 1) / n_blocks * moved.T @ moved
    unknown = np.diagonal(information.sum(axis=0)) <= 0.0
    return covariance + np.diag(np.where(unknown, np.inf, 0.0)), float(
        student.ppf(0.975, n_blocks - 1)
    )


def _moved(
    residuals: Callable, point: np.ndarray, jacobian: np.ndarray, robust: float
) -> np.ndarray:
    """Newton step (n_free,) to the optimum of other residuals than those of the jacobian."""
    here = residuals(point)
    slopes = np.column_stack(
        [(residuals(point + step) - here) / STEP for step in STEP * np.eye(point.size)]
    )
    gradient = slopes.T @ (here / np.sqrt(1.0 + (here / robust) ** 2))
    return -np.linalg.solve(_invertible(jacobian.T @ jacobian), gradient)


def _own(information: np.ndarray, gradient: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Each unit's own estimate, by weighted squares, less the common one, and its variance, (n_units, n_free)."""
    inverse = np.linalg.inv(_invertible(information))
    moved = -np.einsum("uij,uj->ui", inverse, gradient)
    return moved, np.diagonal(inverse, axis1=1, axis2=2)


def _invertible(information: np.ndarray) -> np.ndarray:
    size = information.shape[-1]
    largest = np.trace(information, axis1=-2, axis2=-1)[..., None, None]
    return information + (RIDGE * largest + np.finfo(float).tiny) * np.eye(size)
