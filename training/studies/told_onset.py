"""A stimulus that is told when the fault begins: what none can know, to see how much there is to be gained."""

from dataclasses import dataclass, field

import numpy as np

from diagnosers import Belief
from training.metrics import sample_at
from training.stimuli.base import LARGEST_OFFSET
from training.stimuli.closed_loop import ClosedLoop


@dataclass(frozen=True)
class ToldOnset(ClosedLoop):
    """Faster by `LARGEST_OFFSET` from the onset on, as long as the allowance lasts; with `LARGEST_OFFSET` as budget, to the end.

    It is no bound, for another profile may tell more; but who waits for suspicion cannot begin as
    early.

    Attributes
    ----------
    onset
        Of each lane [s], (n_lanes,).
    """

    name = "told_onset"
    onset: np.ndarray = field(kw_only=True)

    def initial_memory(self, n_lanes: int) -> None:
        """It remembers nothing."""

    def choose_offset(
        self,
        sample: int,
        observation: np.ndarray,
        belief: Belief,
        allowance: np.ndarray,
        memory: None,
    ) -> np.ndarray:
        """Ahead where it is time."""
        return np.where(sample >= sample_at(self.onset), LARGEST_OFFSET, 0.0)
