"""A rule by hand, from which the training of an agent starts: faster by the odds of a plant fault.

At twice the speed drag and thrust are four times as large, so that faults of hull and propellers
stand out of noise and disturbance. A healthy vehicle pays the square of an offset, a faulty one
gains about in proportion to it. So the best offset grows with the odds and with the budget.
"""

from functools import cache

import numpy as np

from auv_fault_env.faults import CATALOGUE, classes
from auv_fault_env.parameters import SAMPLE_TIME
from diagnosers import Belief
from training.stimuli.base import EPISODE_TIME, LARGEST_OFFSET
from training.stimuli.closed_loop import ClosedLoop, EpisodeState

LEAST_SHARE = 0.3  # of 1 - p(normal), that hull and propellers must have
# at even odds, in units of the constant offset with which the allowance would last an episode
GAIN = 0.6
LEAST_NORMAL = 1e-6  # least p(normal) in the odds: with less, the offset is the largest anyway


@cache
def is_of_hull_or_propellers(names: tuple[str, ...]) -> np.ndarray:
    """Which of these classes, those of the catalogue, are faults of hull or propellers; bool."""
    faults = CATALOGUE.values()
    parts = ("hull", "propeller:")
    affected = {fault.diagnosis for fault in faults if fault.component.startswith(parts)}
    return np.array([name in affected for name in names])


def surge_offset(
    log_probability: np.ndarray, allowance: np.ndarray, gain: float = GAIN
) -> np.ndarray:
    """The offset of the rule, (n_lanes,), 0 to `LARGEST_OFFSET` [m/s].

    Of the log probabilities (n_lanes, n_classes), and the squared offsets that are left, (n_lanes,)
    [m^2/s].
    """
    probability = np.exp(log_probability)
    normal = probability[:, 0]
    affected = probability[:, is_of_hull_or_propellers(classes())].sum(axis=1)
    odds = affected / np.maximum(normal, LEAST_NORMAL)
    offset = np.minimum(gain * np.sqrt(allowance / EPISODE_TIME) * odds, LARGEST_OFFSET)
    return np.where(affected > LEAST_SHARE * (1.0 - normal), offset, 0.0)


class TriggeredSurge(ClosedLoop):
    """Faster by the odds of a fault of hull or propellers, as long as the allowance lasts.

    `LEAST_SHARE` and `GAIN` are choices by hand, not an optimum. A diagnoser with many false
    suspicions wastes the allowance before a fault begins.
    """

    name = "triggered_surge"
    seed_block = 9

    def decide(self, observation: np.ndarray, belief: Belief, episode: EpisodeState) -> np.ndarray:
        """The offset of the rule."""
        return surge_offset(belief.log_probability, episode.allowance * SAMPLE_TIME)
