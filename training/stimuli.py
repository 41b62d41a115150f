"""Stimuli: by how much the commanded speed departs from the mission's, so that a fault shows sooner.

All are compared under the same budget: the root mean square of the departure over the episode.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from auv_fault_env.channels import MAXIMUM_COMMAND
from auv_fault_env.errors import finite_in_range
from auv_fault_env.parameters import FOOT, SAMPLE_TIME
from diagnosers import Belief

BUDGET = 0.25 * FOOT  # m/s: the thesis' 0.5 ft/s and 1.0 ft/s are a quarter of a foot per second off their mean


@dataclass(frozen=True)
class Stimulus(ABC):
    """A speed offset around the mission speed at every sample; asked anew in every sample, for all lanes at once.

    Attributes
    ----------
    budget
        Greatest root mean square of the offsets of a lane over an episode [m/s].
    """

    name: ClassVar[str]
    budget: float = BUDGET

    def __post_init__(self):
        finite_in_range(f"budget of {self.name}", self.budget, 0.0, MAXIMUM_COMMAND)

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


class Cruise(Stimulus):
    """No stimulus: what any other is measured against. At constant speed some faults look alike."""

    name = "cruise"

    def offset(self, sample: int, observation: np.ndarray, belief: Belief) -> np.ndarray:
        """Nothing."""
        return np.zeros(len(observation))


class Thesis(Stimulus):
    """The thesis' square wave (V.D): slower and faster than the mission by the budget, ten seconds each, slower first.

    It knows neither what is believed nor when a fault is suspected, and so costs as much on a healthy vehicle.
    """

    name = "thesis"
    HALF_PERIOD = 10.0  # s

    def offset(self, sample: int, observation: np.ndarray, belief: Belief) -> np.ndarray:
        """Minus or plus the budget."""
        fast = int(sample * SAMPLE_TIME / self.HALF_PERIOD + 1e-9) % 2
        return np.full(len(observation), self.budget if fast else -self.budget)


STIMULI: dict[str, type[Stimulus]] = {stimulus.name: stimulus for stimulus in (Cruise, Thesis)}
