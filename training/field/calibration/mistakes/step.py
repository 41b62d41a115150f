"""A lasting step in the residuals of a log."""

from typing import NamedTuple

import numpy as np

from training.field.calibration.mistakes.log_windows import LEAST_WINDOWS
from training.field.calibration.mistakes.reference import Compared, range_of
from training.field.calibration.samples import NORMAL_MAD

SCATTERS = 3.0  # standard deviations of the residual, beyond which a change counts
MOST_STEPS = 100  # that are tried in a log


class Step(NamedTuple):
    """The largest step of a log's residuals."""

    score: float  # above 1: a step that no healthy vehicle has
    row: int  # index of the first window after it
    change: np.ndarray  # (n_residuals,)


def step_of(log: Compared) -> Step:
    """The step between the medians before and after that is largest by its limit.

    Windows at commands beyond those before the step do not count. A constant error of the log, as
    by the zero of a sensor, or a proportional one, is no step where the speeds before and after
    differ: the smaller of the steps of both views counts.
    """
    best = Step(0.0, 0, np.zeros(len(log.limits)))
    last = len(log.residual) - LEAST_WINDOWS
    relative = log.residual / log.size
    for row in range(LEAST_WINDOWS, last, max(1, (last - LEAST_WINDOWS) // MOST_STEPS)):
        is_after = np.arange(len(relative)) >= row
        is_after &= range_of(log.command[:row]).has(log.command)
        if is_after.sum() < LEAST_WINDOWS // 2:
            continue
        constant = np.median(log.residual[:row], axis=0)
        parts = (relative[:row], relative[is_after])
        one = _change(*parts)
        other = _change(
            parts[0] - constant / log.size[:row], parts[1] - constant / log.size[is_after]
        )
        change = np.where(np.abs(one) < np.abs(other), one, other)
        change[np.sign(one) != np.sign(other)] = 0.0
        scores = np.abs(change) / np.maximum(log.limits, SCATTERS * _scatter_about(*parts))
        if scores.max() > best.score:
            best = Step(float(scores.max()), row, change)
    return best


def _change(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Difference of the medians of residuals (n, n_residuals)."""
    return np.median(after, axis=0) - np.median(before, axis=0)


def _scatter_about(*parts: np.ndarray) -> np.ndarray:
    """Scatter of residuals (n, n_residuals) about the medians of their parts."""
    errors = np.concatenate([np.abs(part - np.median(part, axis=0)) for part in parts])
    return NORMAL_MAD * np.median(errors, axis=0)
