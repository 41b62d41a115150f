"""A reference that no vehicle can have: it knows when the fault begins."""

from dataclasses import dataclass, field

import numpy as np

from diagnosers import Belief
from training import metrics
from training.stimuli.base import LARGEST_OFFSET
from training.stimuli.closed_loop import ClosedLoop, EpisodeState

# s, onset of a vehicle that has no fault
NEVER = 1e6


@dataclass(frozen=True)
class FasterFromOnset(ClosedLoop):
    """Faster by `LARGEST_OFFSET` from the known onset on, until the allowance is spent.

    With `LARGEST_OFFSET` as budget it lasts to the end. It is no bound, for other speed profiles
    may bring more evidence; but a stimulus that waits for suspicion begins later.

    Attributes
    ----------
    onset
        Onset of each lane [s], (n_lanes,); `NEVER` without a fault.
    """

    name = "known_onset"
    onset: np.ndarray = field(kw_only=True)

    def decide(self, observation: np.ndarray, belief: Belief, episode: EpisodeState) -> np.ndarray:
        """`LARGEST_OFFSET` after the onset, else zero."""
        return np.where(episode.sample >= metrics.sample_at(self.onset), LARGEST_OFFSET, 0.0)
