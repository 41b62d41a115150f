"""Rules that always spend a share of the budget, and the rest of it on suspicion.

Suspicion takes seconds to arise at the mission speed, and less where the vehicle is a little
faster all the time: drag and thrust grow with the square of the speed. So a share of the budget
that is spent on healthy vehicles as well shortens the detection, and the rest of it the isolation.
"""

from abc import abstractmethod
from typing import ClassVar

import numpy as np

from auv_fault_env.parameters import SAMPLE_TIME
from diagnosers import Belief
from training.stimuli.base import LARGEST_OFFSET, N_SAMPLES
from training.stimuli.closed_loop import ClosedLoop, EpisodeState
from training.stimuli.triggered_surge import surge_offset


class Standing(ClosedLoop):
    """Faster by `standing_share` of the budget all the time, and by `surge` where that is more.

    The standing offset of the rest of the episode is set aside, so that a surge cannot use it up.
    """

    standing_share: ClassVar[float]
    """Standing offset as a share of the budget."""

    @property
    def standing(self) -> float:
        """The standing offset [m/s]."""
        return min(self.standing_share * self.budget, LARGEST_OFFSET)

    def decide(self, observation: np.ndarray, belief: Belief, episode: EpisodeState) -> np.ndarray:
        """The larger of the two offsets, as far as the allowance that is not set aside lasts."""
        free = self.free_allowance(episode)
        offset = np.maximum(self.surge(belief, free, episode), self.standing)
        return np.minimum(offset, np.sqrt(free + self.standing**2))

    def free_allowance(self, episode: EpisodeState) -> np.ndarray:
        """The allowance that is not set aside, (n_lanes,) [m^2/s^2 times samples]."""
        samples_to_come = max(N_SAMPLES - episode.sample, 0)
        return np.maximum(episode.allowance - samples_to_come * self.standing**2, 0.0)

    @abstractmethod
    def surge(self, belief: Belief, free: np.ndarray, episode: EpisodeState) -> np.ndarray:
        """The offset on suspicion [m/s], (n_lanes,).

        `free` is the allowance that is not set aside, (n_lanes,) [m^2/s^2 times samples].
        """


class StandingSurge(Standing):
    """A small standing share, and faster by the odds of a fault of hull or propellers.

    The surge is that of `TriggeredSurge` with a larger gain: it begins long before an alarm, at
    odds of a few per cent, and so on healthy vehicles too. `standing_share` and `gain` were chosen
    on validation seeds.
    """

    name = "standing_surge"
    seed_block = 17
    standing_share = 0.2
    gain: ClassVar[float] = 5.0
    """Of `surge_offset`."""

    def surge(self, belief: Belief, free: np.ndarray, episode: EpisodeState) -> np.ndarray:
        """The offset of `surge_offset`."""
        return surge_offset(belief.log_probability, free * SAMPLE_TIME, self.gain)
