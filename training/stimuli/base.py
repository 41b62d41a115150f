"""What a stimulus is: by how much the commanded speed departs from the mission's, so that a fault shows sooner.

All are compared under the same budget: the root mean square of the departure over an episode.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from auv_fault_env.channels import INDEX, MAXIMUM_COMMAND
from auv_fault_env.errors import finite_in_range
from auv_fault_env.parameters import FOOT, SAMPLE_RATE
from diagnosers import Belief

# m/s: the thesis' 0.5 ft/s and 1.0 ft/s are a quarter of a foot per second off their mean
BUDGET = 0.25 * FOOT
EPISODE_TIME = 65.0  # s, over which a budget is kept: an episode of the suites
N_SAMPLES = round(EPISODE_TIME * SAMPLE_RATE)
# m/s, offset of a stimulus that decides by itself: beyond it the mission would be another one
LARGEST_OFFSET = 0.25
MISSION_SPEED = INDEX["mission_speed"]


@dataclass(frozen=True)
class Stimulus(ABC):
    """A speed offset around the mission speed at every sample; asked anew in every sample, for all lanes at once.

    One that looks at the belief remembers the episode: it begins anew when it is asked for sample
    0, and an instance serves one batch of lanes at a time.

    Attributes
    ----------
    seed_block
        Number of the block of seeds that healthy lanes of a benchmark have under this stimulus;
        each stimulus has one of its own.
    budget
        Greatest root mean square of the offsets of a lane over an episode of `EPISODE_TIME` [m/s].
    """

    name: ClassVar[str]
    seed_block: ClassVar[int]
    budget: float = BUDGET

    def __post_init__(self):
        finite_in_range(f"budget of {self.name}", self.budget, 0.0, MAXIMUM_COMMAND)

    @property
    def policy_digest(self) -> str:
        """Digest of what it has learnt, empty for nothing: results depend on it."""
        return ""

    @abstractmethod
    def offset(self, sample: int, observation: np.ndarray, belief: Belief) -> np.ndarray:
        """Offset [m/s] (n_lanes,) that is commanded from this sample to the next.

        Parameters
        ----------
        sample
            Its number, 0 at the start of the episode.
        observation
            What the vehicles read at it, (n_lanes, n_channels), channels as in `CHANNELS`.
        belief
            What the diagnoser makes of the readings so far.
        """


def within_channel(offset: np.ndarray | float, observation: np.ndarray) -> np.ndarray:
    """The offsets (n_lanes,), no further than the speed command goes: 0 to `MAXIMUM_COMMAND` [m/s]."""
    mission = observation[:, MISSION_SPEED].astype(np.float64)
    return np.clip(offset, -mission, MAXIMUM_COMMAND - mission)
