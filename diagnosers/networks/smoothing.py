"""Smoothing of a belief over time: a fault that has begun stays, and single samples are noisy."""

from typing import NamedTuple

import numpy as np

from auv_fault_env.parameters import SAMPLE_TIME

FAULT_SMOOTHING = 1.0  # s, time constant of the mean probabilities of the faults
ODDS_SMOOTHING = 5.0  # s, time constant with which the log odds of any fault fall
LEAST = np.finfo(float).tiny  # probability of a fault, so that its logarithm is finite


def update_share(time: float) -> float:
    """Share by which a sample moves a running mean with this time constant [s]."""
    return SAMPLE_TIME / (SAMPLE_TIME + time)


class SmoothedBelief(NamedTuple):
    """Log odds of any fault (n_lanes,), and averaged fault probabilities (n_lanes, n_faults).

    The odds rise at once and fall slowly, so a false alarm lasts too; they are NaN before the first
    sample.
    """

    odds: np.ndarray
    faults: np.ndarray

    def after(self, log_probability: np.ndarray) -> "SmoothedBelief":
        """The next state, from the log probabilities (n_lanes, n_classes) of the next sample."""
        log_faults = log_probability[:, 1:]
        odds = np.logaddexp.reduce(log_faults, axis=1) - log_probability[:, 0]
        falling = self.odds + update_share(ODDS_SMOOTHING) * (odds - self.odds)
        change = np.exp(log_faults) - self.faults
        faults = self.faults + update_share(FAULT_SMOOTHING) * change
        return SmoothedBelief(np.fmax(odds, falling), faults)

    def log_probability(self) -> np.ndarray:
        """The smoothed log probabilities, (n_lanes, n_classes)."""
        odds = self.odds[:, None]
        total = self.faults.sum(axis=1, keepdims=True)
        log_faults = np.log(np.maximum(self.faults / total, LEAST))
        log_total = np.logaddexp.reduce(log_faults, axis=1, keepdims=True)
        log_faulty = log_faults - log_total - np.logaddexp(0.0, -odds)
        return np.concatenate([-np.logaddexp(0.0, odds), log_faulty], axis=1)


def initial_smoothing(n_lanes: int, n_faults: int) -> SmoothedBelief:
    """The state before any sample."""
    return SmoothedBelief(np.full(n_lanes, np.nan), np.zeros((n_lanes, n_faults)))
