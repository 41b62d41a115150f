"""The base of the stimuli that decide by the belief: an allowance per episode, and a memory."""

from abc import abstractmethod
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from auv_fault_env.errors import refusal
from diagnosers import Belief
from training.stimuli.base import LARGEST_OFFSET, N_SAMPLES, Stimulus, within_channel


@dataclass
class EpisodeState:
    """Where a closed loop stands in its episode.

    Attributes
    ----------
    next_sample
        Number of the sample that must come next.
    allowance
        Squared offsets that the budget has left, (n_lanes,) [m^2/s^2 times samples].
    memory
        What the stimulus remembers besides.
    """

    next_sample: int = 0
    allowance: np.ndarray = field(default_factory=lambda: np.zeros(0))
    memory: Any = None


@dataclass(frozen=True)
class ClosedLoop(Stimulus):
    """A stimulus that decides by the belief, within its allowance.

    The allowance starts at that of an episode of `EPISODE_TIME`, and no squared offset exceeds what
    is left of it. So the root mean square over such an episode, or over a longer one, never exceeds
    the budget; over a shorter one it may.
    """

    _episode: EpisodeState = field(
        default_factory=EpisodeState, init=False, repr=False, compare=False
    )

    def offset(self, sample: int, observation: np.ndarray, belief: Belief) -> np.ndarray:
        """The chosen offset, clipped to `LARGEST_OFFSET`, the channel and the allowance.

        Raises
        ------
        InputError
            If samples of several batches are mixed, or a sample is left out.
        """
        episode = self._episode
        n_lanes = len(observation)
        if sample == 0:
            episode.next_sample = 0
            episode.allowance = np.full(n_lanes, N_SAMPLES * self.budget**2)
            episode.memory = self.initial_memory(n_lanes)
        expected = (episode.next_sample, len(episode.allowance))
        if (sample, n_lanes) != expected:
            raise refusal(
                "sample and number of lanes",
                (sample, n_lanes),
                f"{expected}, or sample 0",
                "use one instance of the stimulus for each batch",
            )
        allowance = episode.allowance
        chosen = self.choose_offset(sample, observation, belief, allowance, episode.memory)
        largest = np.minimum(np.sqrt(allowance), LARGEST_OFFSET)
        offset = within_channel(np.clip(chosen, -largest, largest), observation)
        episode.next_sample = sample + 1
        episode.allowance = np.maximum(allowance - np.square(offset), 0.0)
        return offset

    @abstractmethod
    def initial_memory(self, n_lanes: int) -> Any:
        """The memory at the start of an episode; `choose_offset` may change it in place."""

    @abstractmethod
    def choose_offset(
        self,
        sample: int,
        observation: np.ndarray,
        belief: Belief,
        allowance: np.ndarray,
        memory: Any,
    ) -> np.ndarray:
        """The offset before any clipping [m/s], (n_lanes,).

        ``allowance`` is as in `EpisodeState`, the other arguments as for `offset`.
        """
