"""Go faster as soon as a fault of hull or propellers is suspected: a rule by hand, and what the agent starts from.

At twice the speed drag and thrust are four times as large, so that their faults stand out of noise and disturbance;
going slower hides them.
"""

import math

import numpy as np

from auv_fault_env.faults import CATALOGUE, classes
from diagnosers import Belief
from training.stimuli_closed_loop import ClosedLoop

AFFECTED = {fault.diagnosis for fault in CATALOGUE.values() if fault.component.startswith(("hull", "propeller:"))}
HULL_AND_PROPELLERS = np.array([name in AFFECTED for name in classes()])
DOUBT = math.log(0.7)  # log p(normal) below which a fault is suspected
SHARE = 0.3  # of what is not normal, from which on hull and propellers are
AHEAD = 0.2  # m/s


def suspects(log_probability: np.ndarray) -> np.ndarray:
    """Whether a fault of hull or propellers is suspected, (n_lanes,), from log probabilities (n_lanes, n_classes)."""
    probability = np.exp(log_probability)
    likely = probability[:, HULL_AND_PROPELLERS].sum(axis=1) > SHARE * (1.0 - probability[:, 0])
    return likely & (log_probability[:, 0] < DOUBT)


class TriggeredSurge(ClosedLoop):
    """Faster by `AHEAD` while a fault of hull or propellers is suspected, as long as the allowance lasts.

    Doubt, share and speed are a choice by hand, not an optimum. A diagnoser that doubts often makes it waste its
    allowance before a fault is there.
    """

    name = "triggered_surge"

    def begun(self, n_lanes: int) -> None:
        """It remembers nothing."""

    def wanted(
        self, sample: int, observation: np.ndarray, belief: Belief, left: np.ndarray, memory: None
    ) -> np.ndarray:
        """Ahead where it suspects."""
        return np.where(suspects(belief.log_probability), AHEAD, 0.0)
