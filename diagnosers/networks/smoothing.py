"""A belief steadied over time: a fault that has begun stays, and single samples are noisy."""

from typing import NamedTuple

import numpy as np

from auv_fault_env.parameters import SAMPLE_TIME

FAULT_SMOOTHING = 1.0  # s, over which the belief is averaged to say which fault it is
ODDS_SMOOTHING = 5.0  # s, in which the odds of any fault fall
LEAST = np.finfo(float).tiny  # share of a fault, so that its logarithm is finite


def update_share(time: float) -> float:
    """Share by which a sample moves an average over this time [s]."""
    return SAMPLE_TIME / (SAMPLE_TIME + time)


class SmoothedBelief(NamedTuple):
    """Log odds of any fault (n_lanes,), and averaged fault probabilities (n_lanes, n_faults).

    The odds rise at once and fall slowly, so a false alarm lasts too; they are NaN before the first
    sample.
    """

    odds: np.ndarray
    faults: np.ndarray

    def after(self, log_probability: np.ndarray) -> "SmoothedBelief":
        """The same one sample later, given that sample's own belief (n_lanes, n_classes)."""
        odds = np.logaddexp.reduce(log_probability[:, 1:], axis=1) - log_probability[:, 0]
        faults = self.faults + update_share(FAULT_SMOOTHING) * (
            np.exp(log_probability[:, 1:]) - self.faults
        )
        return SmoothedBelief(
            np.fmax(odds, self.odds + update_share(ODDS_SMOOTHING) * (odds - self.odds)), faults
        )

    def log_probability(self) -> np.ndarray:
        """The steadied belief, (n_lanes, n_classes)."""
        faults = np.log(np.maximum(self.faults / self.faults.sum(axis=1, keepdims=True), LEAST))
        faulty = (
            faults
            - np.logaddexp.reduce(faults, axis=1, keepdims=True)
            - np.logaddexp(0.0, -self.odds)[:, None]
        )
        return np.concatenate([-np.logaddexp(0.0, self.odds)[:, None], faulty], axis=1)


def initial_smoothing(n_lanes: int, n_faults: int) -> SmoothedBelief:
    """The state before any sample."""
    return SmoothedBelief(np.full(n_lanes, np.nan), np.zeros((n_lanes, n_faults)))
