"""The declaration of a fault: one class stays probable for a second."""

import math

import numpy as np

from auv_fault_env.errors import finite_in_range
from auv_fault_env.parameters import SAMPLE_RATE
from training.metrics.declaration import DECLARATION_TIME

UNDECLARED = 0  # index of `normal`


class Declaration:
    """Which fault is declared on every lane.

    `declared` (n_lanes,) is the index of the class or `UNDECLARED`; the first declaration stands.

    Parameters
    ----------
    threshold
        Probability that a fault class must have at every sample of `DECLARATION_TIME`; 0.5 or more,
        so that only one class can have it.
    """

    def __init__(self, n_lanes: int, threshold: float):
        self._log_threshold = math.log(finite_in_range("declare", threshold, 0.5, 1.0))
        self._lanes = np.arange(n_lanes)
        self._n_samples = round(DECLARATION_TIME * SAMPLE_RATE)
        self._top_class = np.zeros(n_lanes, np.int64)
        self._n_above = np.zeros(n_lanes, np.int64)
        self.declared = np.full(n_lanes, UNDECLARED)

    def reset(self, lanes: np.ndarray) -> None:
        """Take back what is declared on the chosen lanes (n_chosen,)."""
        self._n_above[lanes] = 0
        self.declared[lanes] = UNDECLARED

    def update(self, log_probability: np.ndarray) -> None:
        """Take the belief of the next sample, (n_lanes, n_classes)."""
        top_class = 1 + log_probability[:, 1:].argmax(axis=1)
        is_above = log_probability[self._lanes, top_class] >= self._log_threshold
        n_before = np.where(top_class == self._top_class, self._n_above, 0)
        self._n_above = np.where(is_above, n_before + 1, 0)
        self._top_class = top_class
        is_new = (self.declared == UNDECLARED) & (self._n_above >= self._n_samples)
        self.declared = np.where(is_new, top_class, self.declared)
