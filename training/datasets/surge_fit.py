"""The surge equation fitted to free running: coefficients, intervals, ten-second prediction.

``du/dt = sum of coefficient times term``, integrated over ten seconds at the measured speed, is
linear in the coefficients: linear least squares that differentiates no reading and needs no first
guess. The normal equations add up over blocks of time, so that leaving a run out or resampling
blocks is arithmetic on small matrices. A term that the data do not excite, such as the thrust
astern of a propeller that never goes astern, is dropped from the fit by name. `predict` tests a
fit: it simulates from the measured start.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from auv_fault_env.parameters import SAMPLE_TIME
from training.datasets.esso_osaka_runs import Inputs, ShipRun

AHEAD = 100  # samples: the ten seconds of a prediction
BLOCK = 600  # samples: a minute, several times the ten seconds and the disturbance's memory
RESAMPLES = 2000
# A term whose rms in the data of a fit is at most this share of its rms in all runs is not excited:
# an offset of the shaft's reading at rest is no thrust astern. Runs of the real ship have at least
# 0.2.
LEAST_RMS = 0.01
# A term of whose mean square the terms before it leave at most this share (1 - R^2) is their
# combination: its coefficient would be rounding. The runs of the real ship have 0.03 or more.
LEAST_SHARE = 1e-6
UNITS = {
    "alpha": "1/m",
    "beta": "(m/s^2)/rpm^2",
    "gamma": "1/(m rad^2)",
    "turn": "1",
    "wind": "1/m",
}

# Terms of the surge acceleration at a speed u [m/s]; the first three are the plant's
# (auv_fault_env/physics.py).
TERMS: dict[str, Callable[[np.ndarray, Inputs], np.ndarray]] = {
    "alpha": lambda u, x: u * np.abs(u),
    "beta": lambda u, x: x.rpm * np.abs(x.rpm),
    "gamma": lambda u, x: u * np.abs(u) * x.rudder**2,
    "turn": lambda u, x: x.sway * x.yaw_rate,
    "astern": lambda u, x: np.minimum(x.rpm, 0.0) ** 2,
    "advance": lambda u, x: u * np.abs(x.rpm),
    "race": lambda u, x: x.rpm * np.abs(x.rpm) * x.rudder**2,
    "drift": lambda u, x: x.sway**2,
    "centre": lambda u, x: x.yaw_rate**2,
    "wind": lambda u, x: x.wind * np.abs(x.wind),
}


class Normal(NamedTuple):
    """Normal equations of blocks of increments."""

    gram: np.ndarray  # (n_blocks, n_terms, n_terms)
    moment: np.ndarray  # (n_blocks, n_terms)
    n_starts: np.ndarray  # (n_blocks,)


class Fit(NamedTuple):
    """Coefficients of a form, and the terms that were dropped from it, (..., n_terms) each."""

    coefficients: np.ndarray  # 0 where the term is dropped
    is_zero: np.ndarray  # the term is zero throughout
    is_small: np.ndarray  # it is small beside its rms in all runs (`LEAST_RMS`), or zero
    is_combination: np.ndarray  # of the terms before it (`LEAST_SHARE`)

    @property
    def is_dropped(self) -> np.ndarray:
        """Whether each term is dropped."""
        return self.is_small | self.is_combination

    def of(self, k: int) -> "Fit":
        """Fit k of several."""
        return Fit(*(values[k] for values in self))


def increments(
    run: ShipRun, form: Sequence[str], ahead: int = AHEAD
) -> tuple[np.ndarray, np.ndarray]:
    """Integrals of the terms over `ahead` samples, and the change of the speed.

    The integrals (n_starts, n_terms) begin at every sample and follow the midpoint rule, at the
    measured speed; the change is (n_starts,).
    """
    speed = 0.5 * (run.speed[1:] + run.speed[:-1])
    inputs = run.inputs.sample_means()
    terms = np.column_stack([TERMS[name](speed, inputs) for name in form])
    sums = np.concatenate([np.zeros((1, len(form))), np.cumsum(terms, axis=0)])
    integral = SAMPLE_TIME * sums
    change = run.speed[ahead:] - run.speed[:-ahead]
    return integral[ahead:] - integral[:-ahead], change


def normal_equations(run: ShipRun, form: Sequence[str], block: int = BLOCK) -> Normal:
    """The run's normal equations, a block of starts at a time."""
    terms, change = increments(run, form)
    edges = range(block, len(change) - block // 2, block)  # the rest joins the last block
    term_blocks = np.split(terms, edges)
    change_blocks = np.split(change, edges)
    gram = [x.T @ x for x in term_blocks]
    moment = [x.T @ y for x, y in zip(term_blocks, change_blocks, strict=True)]
    return Normal(np.array(gram), np.array(moment), np.array([len(x) for x in term_blocks]))


def together(runs: Sequence[Normal]) -> Normal:
    """The normal equations of several runs, a block for each run."""
    gram = [run.gram.sum(axis=0) for run in runs]
    moment = [run.moment.sum(axis=0) for run in runs]
    return Normal(np.array(gram), np.array(moment), np.array([run.n_starts.sum() for run in runs]))


def term_rms(normal: Normal, weights: np.ndarray | None = None) -> np.ndarray:
    """Rms of the terms' integrals (..., n_terms), by weights (..., n_blocks), 1 by default."""
    weights = np.ones(len(normal.gram)) if weights is None else weights
    squares = weights @ np.diagonal(normal.gram, axis1=-2, axis2=-1)
    return np.sqrt(squares / (weights @ normal.n_starts)[..., None])


def solve(
    normal: Normal, weights: np.ndarray | None = None, usual: np.ndarray | None = None
) -> Fit:
    """Least squares by weights (..., n_blocks), 1 by default, without terms that nothing excites.

    `usual` (n_terms,) is the terms' rms in all runs (`term_rms`), if these are some of them.
    """
    weights = np.ones(len(normal.gram)) if weights is None else weights
    gram = np.tensordot(weights, normal.gram, 1)
    moment = weights @ normal.moment
    square = np.diagonal(gram, axis1=-2, axis2=-1)
    is_zero = square == 0.0
    least = 0.0 if usual is None else LEAST_RMS * usual
    is_small = is_zero | (term_rms(normal, weights) <= least)
    size = np.sqrt(np.where(is_zero, 1.0, square))  # of each term, from 1e-3 to 1e7
    scaled = _without(is_small, gram / (size[..., :, None] * size[..., None, :]))
    is_combination = _combinations(scaled)
    right = np.where(is_small | is_combination, 0.0, moment / size)
    solution = np.linalg.solve(_without(is_combination, scaled), right[..., None])[..., 0]
    return Fit(solution / size, is_zero, is_small, is_combination)


def _without(is_dropped: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """The matrix with the rows and columns of dropped terms replaced by those of the identity."""
    is_kept = ~(is_dropped[..., :, None] | is_dropped[..., None, :])
    return np.where(is_kept, matrix, np.eye(matrix.shape[-1]))


def _combinations(scaled: np.ndarray) -> np.ndarray:
    """Whether each term is a combination of the kept terms before it, (..., n_terms).

    `scaled` is the Gram matrix of terms of unit size; elimination without exchange leaves of each
    diagonal element 1 - R^2 of that term.
    """
    rest = scaled
    is_combination = np.zeros(scaled.shape[:-1], bool)
    for k in range(scaled.shape[-1]):
        share = rest[..., k, k]
        is_combination[..., k] = share <= LEAST_SHARE
        factor = np.where(is_combination[..., k], 0.0, 1.0 / np.maximum(share, LEAST_SHARE))
        product = rest[..., :, k, None] * rest[..., None, k, :]
        rest = rest - factor[..., None, None] * product
    return is_combination


def dropped(form: Sequence[str], fit: Fit) -> list[tuple[str, str]]:
    """The terms dropped from one fit, each with the reason."""
    reasons = []
    for k, name in enumerate(form):
        if fit.is_zero[k]:
            reasons.append((name, "zero in the runs fitted to"))
        elif fit.is_small[k]:
            reasons.append((name, f"below {100 * LEAST_RMS:g} % of its rms in all runs"))
        elif fit.is_combination[k]:
            reasons.append((name, "a combination of the terms before it"))
    return reasons


def intervals(
    normal: Normal, seed: int, n: int = RESAMPLES, usual: np.ndarray | None = None
) -> np.ndarray:
    """95 % intervals of the coefficients, (n_terms, 2), by resampling blocks; NaN where dropped.

    Those resamples count in which the term is not dropped.

    Misleads: the intervals are too narrow with few blocks, of a term that few blocks excite above
    all, and they ignore conditions that were the same in all of them, such as the wind of a day.
    """
    n_blocks = len(normal.gram)
    random = np.random.default_rng(seed)
    counts = random.multinomial(n_blocks, np.full(n_blocks, 1.0 / n_blocks), size=n)
    fits = solve(normal, counts.astype(float), usual)
    ends = np.full((fits.coefficients.shape[1], 2), np.nan)
    for k in np.flatnonzero(~solve(normal, usual=usual).is_dropped):
        coefficients = fits.coefficients[~fits.is_dropped[:, k], k]
        ends[k] = np.percentile(coefficients, [2.5, 97.5])
    return ends


def acceleration(
    form: Sequence[str], coefficients: np.ndarray, speed: np.ndarray, inputs: Inputs
) -> np.ndarray:
    """du/dt [m/s^2] of the form."""
    terms = zip(form, coefficients, strict=True)
    return sum(coefficient * TERMS[name](speed, inputs) for name, coefficient in terms)


def predict(form: Sequence[str], coefficients: np.ndarray, run: ShipRun) -> np.ndarray:
    """Speed [m/s] ten seconds after every sample, (n_samples - AHEAD,), simulated from there.

    Propeller, rudder, sway, yaw rate and wind are those measured in the ten seconds; only the speed
    is predicted. Euler steps with the mean inputs of each sample, within 1e-4 m/s of the exact
    solution (`tests`).
    """
    inputs = run.inputs.sample_means()
    speed = run.speed[:-AHEAD].copy()
    for k in range(AHEAD):
        sample_inputs = inputs.at(slice(k, k + len(speed)))
        speed += SAMPLE_TIME * acceleration(form, coefficients, speed, sample_inputs)
    return speed


def prediction_error(form: Sequence[str], coefficients: np.ndarray, run: ShipRun) -> np.ndarray:
    """Measured less predicted speed ten seconds after every sample, (n_samples - AHEAD,) [m/s]."""
    return run.speed[AHEAD:] - predict(form, coefficients, run)


def rms(errors: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(errors))))
