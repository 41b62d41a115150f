"""The surge equation fitted to free running: coefficients, intervals, ten-second prediction.

``du/dt = sum of coefficient times term``, integrated over ten seconds at the measured speed, is
linear in the coefficients: linear least squares that differentiates no reading and needs no first
guess. The normal equations add up over blocks of time, so that leaving a run out or resampling
blocks is arithmetic on small matrices. `predict` tests a fit: it simulates from the measured start.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from auv_fault_env.parameters import SAMPLE_TIME
from training.datasets.esso_osaka_runs import Inputs, ShipRun

AHEAD = 100  # samples: the ten seconds of a prediction
BLOCK = 600  # samples: a minute, several times the ten seconds and the disturbance's memory
RESAMPLES = 2000
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
    return Normal(np.array(gram), np.array(moment))


def together(runs: Sequence[Normal]) -> Normal:
    """The normal equations of several runs, a block for each run."""
    gram = [run.gram.sum(axis=0) for run in runs]
    moment = [run.moment.sum(axis=0) for run in runs]
    return Normal(np.array(gram), np.array(moment))


def solve(normal: Normal, weights: np.ndarray | None = None) -> np.ndarray:
    """Least-squares coefficients (..., n_terms), by weights (..., n_blocks), 1 by default."""
    weights = np.ones(len(normal.gram)) if weights is None else weights
    gram = np.tensordot(weights, normal.gram, 1)
    moment = weights @ normal.moment
    size = np.sqrt(np.diagonal(gram, axis1=-2, axis2=-1))  # of each term, from 1e-3 to 1e7
    scaled = gram / (size[..., :, None] * size[..., None, :])
    return np.linalg.solve(scaled, (moment / size)[..., None])[..., 0] / size


def intervals(normal: Normal, seed: int, n: int = RESAMPLES) -> np.ndarray:
    """95 % intervals of the coefficients, (n_terms, 2), by resampling blocks.

    Misleads: the intervals are too narrow with few blocks, and they ignore conditions that were the
    same in all of them, such as the wind of a day.
    """
    n_blocks = len(normal.gram)
    random = np.random.default_rng(seed)
    counts = random.multinomial(n_blocks, np.full(n_blocks, 1.0 / n_blocks), size=n)
    coefficients = solve(normal, counts.astype(float))
    return np.percentile(coefficients, [2.5, 97.5], axis=0).T


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
