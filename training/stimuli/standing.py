"""Rules that always spend a share of the budget, and the rest of it on suspicion.

Suspicion takes seconds to arise at the mission speed, and less where the vehicle is a little
faster all the time: drag and thrust grow with the square of the speed. So a share of the budget
that is spent on healthy vehicles as well shortens the detection, and the rest of it the isolation.
"""

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from auv_fault_env.faults import classes
from auv_fault_env.parameters import SAMPLE_TIME
from diagnosers import Belief
from training.stimuli.base import LARGEST_OFFSET, N_SAMPLES
from training.stimuli.closed_loop import ClosedLoop, EpisodeState
from training.stimuli.triggered_surge import is_of_hull_or_propellers, surge_offset

# nats: log odds count within +-20
LARGEST_LOG_ODDS = 20.0


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
        samples_to_come = max(N_SAMPLES - episode.sample, 0)
        free = np.maximum(episode.allowance - samples_to_come * self.standing**2, 0.0)
        offset = np.maximum(self.surge(belief, free, episode), self.standing)
        return np.minimum(offset, np.sqrt(free + self.standing**2))

    @abstractmethod
    def surge(self, belief: Belief, free: np.ndarray, episode: EpisodeState) -> np.ndarray:
        """The offset on suspicion [m/s], (n_lanes,).

        `free` is the allowance that is not set aside, (n_lanes,) [m^2/s^2 times samples].
        """


class StandingSurge(Standing):
    """A standing share, and faster by the odds of a fault of hull or propellers.

    The surge is that of `TriggeredSurge`. `standing_share` was chosen on validation seeds.
    """

    name = "standing_surge"
    seed_block = 17
    standing_share = 0.5

    def surge(self, belief: Belief, free: np.ndarray, episode: EpisodeState) -> np.ndarray:
        """The offset of `surge_offset`."""
        return surge_offset(belief.log_probability, free * SAMPLE_TIME)


@dataclass
class Experiments:
    """The memory of `TwoExperiments`, (n_lanes,) each."""

    log_odds: np.ndarray  # at the sample before; NaN before the first
    statistic: np.ndarray  # CUSUM of their increments
    is_dear: np.ndarray  # whether the dear experiment is running


class TwoExperiments(Standing):
    """A cheap experiment until a change is suspected, then a dear one until the suspicion falls.

    The cheap one is the standing offset, the dear one goes faster by `LARGEST_OFFSET`. The
    statistic is the CUSUM of the evidence for a fault of hull or propellers against `normal`, the
    increments of their log odds. It counts from the lowest odds on, so that a sure belief in
    `normal` does not delay the suspicion. `UP`, `DOWN` and `standing_share` were chosen on
    validation seeds.

    After 2E-CUSUM: Lubenia & Banerjee, "Quickest change detection with cost-constrained experiment
    design", arXiv:2509.14186. There the samples are independent and both densities known, and the
    undershoot of the statistic says how long the cheap experiment lasts; here a second threshold
    does, because the evidence comes from a filter bank.
    """

    name = "two_experiments"
    seed_block = 18
    standing_share = 0.5
    UP: ClassVar[float] = 3.0  # nat, statistic above which the dear experiment starts
    DOWN: ClassVar[float] = 1.0  # and below which it stops

    def initial_memory(self, n_lanes: int) -> Experiments:
        """No evidence yet, the cheap experiment."""
        return Experiments(
            np.full(n_lanes, math.nan), np.zeros(n_lanes), np.zeros(n_lanes, dtype=bool)
        )

    def surge(self, belief: Belief, free: np.ndarray, episode: EpisodeState) -> np.ndarray:
        """`LARGEST_OFFSET` while the dear experiment runs."""
        memory: Experiments = episode.memory
        log_odds = affected_log_odds(belief.log_probability)
        increment = np.where(np.isnan(memory.log_odds), 0.0, log_odds - memory.log_odds)
        memory.log_odds = log_odds
        memory.statistic = np.maximum(memory.statistic + increment, 0.0)
        lasts = memory.is_dear & (memory.statistic > self.DOWN)
        memory.is_dear = lasts | (memory.statistic > self.UP)
        return np.where(memory.is_dear, LARGEST_OFFSET, 0.0)


def affected_log_odds(log_probability: np.ndarray) -> np.ndarray:
    """Log odds of a fault of hull or propellers against `normal`, (n_lanes,), within +-20 nat."""
    affected = log_probability[:, is_of_hull_or_propellers(classes())]
    log_odds = np.logaddexp.reduce(affected, axis=1) - log_probability[:, 0]
    return np.clip(log_odds, -LARGEST_LOG_ODDS, LARGEST_LOG_ODDS)
