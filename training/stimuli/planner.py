"""The stimulus that plans: rollouts of a few offsets, each followed by a rule, choose the next one.

Rollout on a base rule: Bertsekas, "Rollout, Policy Iteration, and Distributed Reinforcement
Learning", 2020, ch. 2. The rollouts run in a model of the evidence alone, `planner_model`.
"""

from typing import ClassVar, NamedTuple

import numpy as np

from auv_fault_env.channels import INDEX
from auv_fault_env.faults import classes
from auv_fault_env.parameters import SAMPLE_RATE, SAMPLE_TIME
from diagnosers import Belief
from training.stimuli.base import LARGEST_OFFSET, MISSION_SPEED
from training.stimuli.closed_loop import EpisodeState
from training.stimuli.planner_model import (
    force_shares,
    noises,
    scores,
)
from training.stimuli.standing import StandingSurge
from training.stimuli.triggered_surge import is_of_hull_or_propellers

DECISION = round(SAMPLE_RATE)  # samples between decisions
OF_BASE = -1.0  # candidate that stands for the base rule alone
# s/m, over the budget the price of squared offsets on healthy vehicles: seconds of delay per m^2/s
PRICE = 0.9
MARGIN = 0.05  # s, by which a candidate must beat the base rule: the paths are few
SPEED = INDEX["speed"]


class PlannerMemory(NamedTuple):
    """The memory of an episode."""

    planned: np.ndarray  # (n_lanes,) offset [m/s], `OF_BASE` for that of the base rule


class Planner(StandingSurge):
    """The base rule, and each second a larger offset where it surely costs less than the rule.

    The base rule is `StandingSurge`. In the rollouts an offset is held for two seconds and the base
    rule follows, over the classes of hull and propellers with their probabilities and severities
    in the belief, with the same noise for all candidates. The cost is the time until isolation if
    a fault is there, and squared offsets at a price, set by the budget, if none is. So it goes
    ahead of the base rule where a fault would otherwise stay hidden for long: a slight one, or at
    a low speed.

    It assumes that evidence grows with the fourth power of the speed, and that the odds of the
    belief are right. `PRICE` was chosen on validation seeds with `filter_bank`.

    When it misleads: the model does not see how one fault is separated from another, no class but
    those of hull and propellers, and no transients, which make the first second of a fault. A
    diagnoser whose odds are higher on healthy vehicles makes it spend more there. Beyond
    `EPISODE_TIME` it surges only with what is left of the budget, and then not at all.
    """

    name = "planner"
    seed_block = 20
    candidates: ClassVar[tuple[float, ...]] = (OF_BASE, 0.1, 0.175, LARGEST_OFFSET)
    """Offsets to try [m/s], first `OF_BASE` for the base rule alone."""

    def initial_memory(self, n_lanes: int) -> PlannerMemory:
        """Nothing planned."""
        return PlannerMemory(np.full(n_lanes, OF_BASE))

    def decide(self, observation: np.ndarray, belief: Belief, episode: EpisodeState) -> np.ndarray:
        """The planned offset as far as the allowance lasts, or that of the base rule if larger."""
        base = super().decide(observation, belief, episode)
        free = self.free_allowance(episode)
        memory: PlannerMemory = episode.memory
        if episode.sample % DECISION == 0:
            memory.planned[:] = self._plan(observation, belief, free * SAMPLE_TIME)
        affordable = np.minimum(memory.planned, np.sqrt(free + self.standing**2))
        return np.maximum(affordable, base)

    def _plan(self, observation: np.ndarray, belief: Belief, free: np.ndarray) -> np.ndarray:
        """The best candidate of each lane, (n_lanes,); `free` is in m^2/s."""
        if self.budget == 0.0:
            return np.full(len(observation), OF_BASE)
        affected = np.flatnonzero(is_of_hull_or_propellers(classes()))
        log_probability = belief.log_probability[:, affected]
        log_total = np.logaddexp.reduce(log_probability, axis=1, keepdims=True)
        held = np.array(self.candidates)
        cost = scores(
            log_odds_of_force(belief.log_probability),
            np.exp(log_probability - log_total),
            force_shares(classes())[affected],
            belief.severity_mean[:, affected],
            belief.severity_std[:, affected],
            observation[:, SPEED].astype(np.float64),
            observation[:, MISSION_SPEED].astype(np.float64),
            free,
            self.standing,
            self.gain,
            held,
            PRICE / self.budget,
            noises(),
        )
        best = np.where(cost.min(axis=1) < cost[:, 0] - MARGIN, cost.argmin(axis=1), 0)
        return held[best]


def log_odds_of_force(log_probability: np.ndarray) -> np.ndarray:
    """Log odds of a fault of hull or propellers against all else, (n_lanes,) [nat]."""
    affected = is_of_hull_or_propellers(classes())
    of_force = np.logaddexp.reduce(log_probability[:, affected], axis=1)
    return of_force - np.logaddexp.reduce(log_probability[:, ~affected], axis=1)
