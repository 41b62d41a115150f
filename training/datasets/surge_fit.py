"""Fitting the surge equation to free running: coefficients of forms, their intervals, and the ten-second prediction.

The equation of the plant, ``du/dt = sum of coefficient times term``, integrated over ten seconds is
linear in the coefficients: ``u(t + 10 s) - u(t) = sum of coefficient times integral of term``, with
the terms at the measured speed. So the fit is linear least squares on increments over ten seconds,
which neither differentiates a reading nor needs a first guess; and as its normal equations add up
over blocks of time, leaving a run out or resampling blocks is arithmetic on small matrices. What a
fit is worth is told by `predict`, which simulates from the measured start.
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
    """Normal equations of blocks of increments: gram (n_blocks, n_terms, n_terms), moment (n_blocks, n_terms)."""

    gram: np.ndarray
    moment: np.ndarray


def increments(
    run: ShipRun, form: Sequence[str], ahead: int = AHEAD
) -> tuple[np.ndarray, np.ndarray]:
    """Integrals of the terms over `ahead` samples from every sample, (n_starts, n_terms), and the speed's change.

    By the midpoint rule, at the measured speed.
    """
    speed = 0.5 * (run.speed[1:] + run.speed[:-1])
    inputs = run.inputs.between()
    terms = np.column_stack([TERMS[name](speed, inputs) for name in form])
    integral = SAMPLE_TIME * np.concatenate([np.zeros((1, len(form))), np.cumsum(terms, axis=0)])
    return integral[ahead:] - integral[:-ahead], run.speed[ahead:] - run.speed[:-ahead]


def normal_equations(run: ShipRun, form: Sequence[str], block: int = BLOCK) -> Normal:
    """The run's normal equations, a block of starts at a time."""
    terms, change = increments(run, form)
    edges = range(block, len(change) - block // 2, block)  # what is left joins the last block
    parts = list(zip(np.split(terms, edges), np.split(change, edges), strict=True))
    return Normal(np.array([x.T @ x for x, _ in parts]), np.array([x.T @ y for x, y in parts]))


def together(parts: Sequence[Normal]) -> Normal:
    """The normal equations of several runs, a block for each run."""
    return Normal(
        np.array([part.gram.sum(axis=0) for part in parts]),
        np.array([p.moment.sum(axis=0) for p in parts]),
    )


def solve(normal: Normal, weights: np.ndarray | None = None) -> np.ndarray:
    """Least-squares coefficients (..., n_terms), the blocks weighted: weights (..., n_blocks), 1 each if not given."""
    weights = np.ones(len(normal.gram)) if weights is None else weights
    gram = np.tensordot(weights, normal.gram, 1)
    moment = weights @ normal.moment
    size = np.sqrt(np.diagonal(gram, axis1=-2, axis2=-1))  # of each term, from 1e-3 to 1e7
    scaled = gram / (size[..., :, None] * size[..., None, :])
    return np.linalg.solve(scaled, (moment / size)[..., None])[..., 0] / size


def intervals(normal: Normal, seed: int, n: int = RESAMPLES) -> np.ndarray:
    """95 % intervals of the coefficients, (n_terms, 2): blocks of time, or runs, resampled (percentile bootstrap).

    Too narrow with few blocks, and blind to what was the same in all of them, such as the wind of a
    day.
    """
    n_blocks = len(normal.gram)
    weights = np.random.default_rng(seed).multinomial(
        n_blocks, np.full(n_blocks, 1.0 / n_blocks), size=n
    )
    return np.percentile(solve(normal, weights.astype(float)), [2.5, 97.5], axis=0).T


def acceleration(
    form: Sequence[str], coefficients: np.ndarray, speed: np.ndarray, inputs: Inputs
) -> np.ndarray:
    """du/dt [m/s^2] of the form."""
    return sum(
        value * TERMS[name](speed, inputs) for name, value in zip(form, coefficients, strict=True)
    )


def predict(form: Sequence[str], coefficients: np.ndarray, run: ShipRun) -> np.ndarray:
    """Speed [m/s] ten seconds after every sample, (n_samples - AHEAD,), simulated from the measured speed there.

    Propeller, rudder, sway, yaw rate and wind are those measured in the ten seconds; only the speed
    is predicted. Euler steps with the mean inputs of each sample, within 1e-4 m/s of the exact
    solution (`tests`).
    """
    inputs = run.inputs.between()
    speed = run.speed[:-AHEAD].copy()
    for k in range(AHEAD):
        speed += SAMPLE_TIME * acceleration(
            form, coefficients, speed, inputs.part(slice(k, k + len(speed)))
        )
    return speed


def prediction_error(form: Sequence[str], coefficients: np.ndarray, run: ShipRun) -> np.ndarray:
    """Measured less predicted speed ten seconds after every sample, (n_samples - AHEAD,) [m/s]."""
    return run.speed[AHEAD:] - predict(form, coefficients, run)


def rms(errors: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(errors))))
