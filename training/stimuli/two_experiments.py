"""Two experiments of different cost: a cheap one all the time, a dear one on suspicion."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from auv_fault_env.faults import classes
from diagnosers import Belief
from training.stimuli.base import LARGEST_OFFSET
from training.stimuli.closed_loop import EpisodeState
from training.stimuli.standing import Standing
from training.stimuli.triggered_surge import is_of_hull_or_propellers

# nats: log odds count within +-20
LARGEST_LOG_ODDS = 20.0


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
    standing_share = 0.2
    UP: ClassVar[float] = 2.0  # nat, statistic above which the dear experiment starts
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
