"""Go faster by the odds that hull or propellers are at fault: a rule by hand, and what the agent starts from.

At twice the speed drag and thrust are four times as large, so that their faults stand out of noise
and disturbance; going slower hides them. For an offset a healthy vehicle pays the square and a
faulty one gains about in proportion, so what is best grows with the odds; and with the budget, in
units of which healthy vehicles count their cost.
"""

import numpy as np

from auv_fault_env.faults import CATALOGUE, classes
from auv_fault_env.parameters import SAMPLE_TIME
from diagnosers import Belief
from training.stimuli.base import EPISODE_TIME, LARGEST_OFFSET
from training.stimuli.closed_loop import ClosedLoop

AFFECTED = {
    fault.diagnosis
    for fault in CATALOGUE.values()
    if fault.component.startswith(("hull", "propeller:"))
}
HULL_AND_PROPELLERS = np.array([name in AFFECTED for name in classes()])
SHARE = 0.3  # of what is not normal, from which on hull and propellers are suspected
GAIN = 0.6  # of the constant offset for which what is left would last an episode, at even odds
LEAST = 1e-6  # of p(normal): below, the offset has long been the largest


def surge_ahead(log_probability: np.ndarray, left: np.ndarray) -> np.ndarray:
    """The offset [m/s] (n_lanes,), 0 to `LARGEST_OFFSET`.

    From log probabilities (n_lanes, n_classes), and what is left of the squared offsets [m^2/s]
    (n_lanes,).
    """
    probability = np.exp(log_probability)
    normal = probability[:, 0]
    suspected = probability[:, HULL_AND_PROPELLERS].sum(axis=1)
    odds = suspected / np.maximum(normal, LEAST)
    return np.where(
        suspected > SHARE * (1.0 - normal),
        np.minimum(GAIN * np.sqrt(left / EPISODE_TIME) * odds, LARGEST_OFFSET),
        0.0,
    )


class TriggeredSurge(ClosedLoop):
    """Faster by the odds of a fault of hull or propellers and by what is left, as long as the allowance lasts.

    Gain and share are a choice by hand, not an optimum. A diagnoser that doubts often makes it
    waste its allowance before a fault is there.
    """

    name = "triggered_surge"
    seed_block = 9

    def initial_memory(self, n_lanes: int) -> None:
        """It remembers nothing."""

    def choose_offset(
        self, sample: int, observation: np.ndarray, belief: Belief, left: np.ndarray, memory: None
    ) -> np.ndarray:
        """Ahead by the odds."""
        return surge_ahead(belief.log_probability, left * SAMPLE_TIME)
