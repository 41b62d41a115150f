"""The interface of a stimulus: it offsets the commanded speed, so that some faults show sooner."""

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
EPISODE_TIME = 65.0  # s, over which a budget counts: an episode of the suites
N_SAMPLES = round(EPISODE_TIME * SAMPLE_RATE)
# m/s, offset of a stimulus that decides by the belief: beyond it the mission would be another one
LARGEST_OFFSET = 0.25
MISSION_SPEED = INDEX["mission_speed"]


@dataclass(frozen=True)
class Stimulus(ABC):
    """The speed offset of every lane at every sample.

    A closed-loop stimulus remembers the episode: sample 0 starts a new one, and an instance serves
    one batch of lanes at a time.

    Attributes
    ----------
    seed_block
        Number of the seeds of healthy lanes in a benchmark; each stimulus has its own.
    budget
        Largest root mean square of the offsets of a lane over an episode of `EPISODE_TIME` [m/s].
    """

    name: ClassVar[str]
    seed_block: ClassVar[int]
    budget: float = BUDGET

    def __post_init__(self):
        finite_in_range(f"budget of {self.name}", self.budget, 0.0, MAXIMUM_COMMAND)

    @property
    def policy_digest(self) -> str:
        """Digest of the policy that it runs, on which results depend; empty without a policy."""
        return ""

    @abstractmethod
    def offset(self, sample: int, observation: np.ndarray, belief: Belief) -> np.ndarray:
        """Offset [m/s] (n_lanes,) of the command from this sample to the next.

        Parameters
        ----------
        sample
            Number of the sample, 0 at the start of the episode.
        observation, belief
            (n_lanes, n_channels), and the diagnoser's belief after it.
        """

    def thrust_shift(
        self, sample: int, observation: np.ndarray, belief: Belief
    ) -> np.ndarray | None:
        """Shift of thrust to port (n_lanes,) from this sample to the next; None: no such action.

        The arguments are those of `offset`; see `auv_fault_env.thrust_shift`.
        """
        return None


def with_shift(commands: np.ndarray, shift: np.ndarray | None) -> np.ndarray:
    """The commands (n_lanes, 3), and the shift of thrust as a fourth column where there is one."""
    return commands if shift is None else np.column_stack([commands, shift])


def within_channel(offset: np.ndarray | float, observation: np.ndarray) -> np.ndarray:
    """Offsets (n_lanes,) clipped so that the command stays in 0 to `MAXIMUM_COMMAND` [m/s]."""
    mission_speed = observation[:, MISSION_SPEED].astype(np.float64)
    return np.clip(offset, -mission_speed, MAXIMUM_COMMAND - mission_speed)
