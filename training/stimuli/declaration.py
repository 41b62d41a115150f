"""When a diagnosis is declared: one fault class has been held probable for a second."""

import math

import numpy as np

from auv_fault_env.errors import finite_in_range
from auv_fault_env.parameters import SAMPLE_RATE

# probability, and for how long [s]
DECLARE = 0.9
HOLD = 1.0
NONE = 0  # what is declared before a fault is: `normal`


class Declaration:
    """Which fault has been declared on every lane.

    Parameters
    ----------
    n_lanes
        Number of lanes.
    threshold
        Probability that a fault class must have in every sample of `HOLD`; from 0.5 on, so that it
        is the only one.

    Attributes
    ----------
    declared
        Index of the class, (n_lanes,), `NONE` before; the first declaration stands.
    """

    def __init__(self, n_lanes: int, threshold: float):
        self._least = math.log(finite_in_range("declare", threshold, 0.5, 1.0))
        self._lanes = np.arange(n_lanes)
        self._samples = round(HOLD * SAMPLE_RATE)
        self._top = np.zeros(n_lanes, np.int64)
        self._held = np.zeros(n_lanes, np.int64)
        self.declared = np.full(n_lanes, NONE)

    def begin(self, lanes: np.ndarray) -> None:
        """Nothing is declared on the chosen lanes (m,)."""
        self._held[lanes] = 0
        self.declared[lanes] = NONE

    def note(self, log_probability: np.ndarray) -> None:
        """Take the next sample's belief, (n_lanes, n_classes)."""
        top = 1 + log_probability[:, 1:].argmax(axis=1)
        before = np.where(top == self._top, self._held, 0)
        self._held = np.where(log_probability[self._lanes, top] >= self._least, before + 1, 0)
        self._top = top
        new = (self.declared == NONE) & (self._held >= self._samples)
        self.declared = np.where(new, top, self.declared)
