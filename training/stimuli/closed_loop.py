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
    sample
        Number of the sample that is decided on, or must come next.
    allowance
        Squared offsets that the budget has left, (n_lanes,) [m^2/s^2 times samples].
    """

    sample: int = 0
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
            episode.sample = 0
            episode.allowance = np.full(n_lanes, N_SAMPLES * self.budget**2)
            episode.memory = self.initial_memory(n_lanes)
        expected = (episode.sample, len(episode.allowance))
        if (sample, n_lanes) != expected:
            allowed = f"{expected}, or sample 0"
            remedy = "use one instance of the stimulus for each batch"
            raise refusal("sample and number of lanes", (sample, n_lanes), allowed, remedy)
        chosen = self.decide(observation, belief, episode)
        largest = np.minimum(np.sqrt(episode.allowance), LARGEST_OFFSET)
        offset = within_channel(np.clip(chosen, -largest, largest), observation)
        episode.sample += 1
        episode.allowance = np.maximum(episode.allowance - np.square(offset), 0.0)
        return offset

    def initial_memory(self, n_lanes: int) -> Any:
        """The memory at the start of an episode; `decide` may change it in place."""

    @abstractmethod
    def decide(self, observation: np.ndarray, belief: Belief, episode: EpisodeState) -> np.ndarray:
        """The offset before any clipping [m/s], (n_lanes,)."""
