"""What the stimuli share that look at the belief: memory of an episode, and an allowance that they cannot overdraw."""

from abc import abstractmethod
from typing import Any

import numpy as np

from auv_fault_env.errors import refusal
from diagnosers import Belief
from training.stimuli.base import LARGEST_OFFSET, N_SAMPLES, Stimulus, within_channel


class ClosedLoop(Stimulus):
    """A stimulus that decides by the belief, within an allowance: the squared offsets that the budget has left.

    The allowance starts at that of an episode of `EPISODE`, and no offset's square is larger than
    what is left of it; so the root mean square over such an episode never exceeds the budget, nor
    over any longer one. In a shorter one it may.
    """

    def offset(self, sample: int, observation: np.ndarray, belief: Belief) -> np.ndarray:
        """What is wanted, as far as `LARGEST_OFFSET`, the channel and the allowance go.

        Raises `InputError` if samples of several batches are mixed, or one is left out.
        """
        n_lanes = len(observation)
        if sample == 0:
            self.__dict__["_running"] = (
                0,
                np.full(n_lanes, N_SAMPLES * self.budget**2),
                self.initial_memory(n_lanes),
            )
        due, left, memory = self.__dict__.get("_running", (0, (), None))
        if sample != due or n_lanes != len(left):
            got = (sample, n_lanes)
            allowed = f"{(due, len(left))}, or sample 0"
            raise refusal(
                "sample and number of lanes",
                got,
                allowed,
                "use one instance of the stimulus for each batch",
            )
        choose_offset = self.choose_offset(sample, observation, belief, left, memory)
        most = np.minimum(np.sqrt(left), LARGEST_OFFSET)
        offset = within_channel(np.clip(choose_offset, -most, most), observation)
        self.__dict__["_running"] = sample + 1, np.maximum(left - np.square(offset), 0.0), memory
        return offset

    @abstractmethod
    def initial_memory(self, n_lanes: int) -> Any:
        """What it remembers of an episode besides the allowance, at its start; `choose_offset` may change it."""

    @abstractmethod
    def choose_offset(
        self, sample: int, observation: np.ndarray, belief: Belief, left: np.ndarray, memory: Any
    ) -> np.ndarray:
        """The offset that it would like [m/s], (n_lanes,).

        ``left`` (n_lanes,) is the allowance [m^2/s^2 times samples]; the others are as for
        `offset`.
        """
