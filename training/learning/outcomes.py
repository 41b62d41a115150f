"""How the episodes of the active environment have ended: when they were declared, and what the offsets cost."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from auv_fault_env.faults import NORMAL
from training.metrics.records import HORIZON

# Of the budget: by how much a healthy vehicle may be moved, root mean square. Half of what is aimed
# at beside the whole bank, which doubts more often than the lighter one.
HEALTHY_SHARE = 0.05
CENSORED = HORIZON  # s from onset


class Outcome(NamedTuple):
    """How an episode has ended.

    lane; decisions, its length [s]; cost, the sum of the decisions' mean squared offsets [m^2/s^2];
    faulty, whether it has a fault, begun or not; declared, whether any was declared; delay, from
    onset to the right declaration, or `CENSORED` [s].
    """

    lane: int
    decisions: int
    cost: float
    faulty: bool
    declared: bool
    delay: float


class Outcomes:
    """Follows the lanes of the active environment and keeps the outcome of every episode in `ended`.

    The right class is the one that was true last, so that an intermittent fault may be declared
    between its bursts.
    """

    def __init__(self, n_lanes: int):
        self.ended: list[Outcome] = []
        self._decisions = np.zeros(n_lanes, np.int64)
        self._cost = np.zeros(n_lanes)
        self._fault = np.full(n_lanes, NORMAL, object)

    def note(
        self, infos: Sequence[dict[str, Any]], done: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Take a step's information as `ActiveVecEnv` gives it; cost and true label of the decision, (n_lanes,)."""
        cost = np.array([info["cost"] for info in infos])
        label = np.array([info["truth"]["label"] for info in infos], object)
        self._fault = np.where(label != NORMAL, label, self._fault)
        self._decisions += 1
        self._cost += cost
        self.ended += [self._outcome(lane, infos[lane]) for lane in np.flatnonzero(done).tolist()]
        self._decisions[done] = 0
        self._cost[done] = 0.0
        self._fault[done] = NORMAL
        return cost, label

    def _outcome(self, lane: int, info: dict[str, Any]) -> Outcome:
        declared = info["declared"]
        fault = self._fault[lane]
        since = float(self._decisions[lane]) - info["truth"]["onset"]
        right = declared != NORMAL and declared == fault
        delay = min(since, CENSORED) if right else CENSORED
        counts = int(self._decisions[lane]), float(self._cost[lane])
        return Outcome(
            lane, *counts, math.isfinite(info["truth"]["onset"]), declared != NORMAL, delay
        )


def figures(outcomes: Sequence[Outcome], budget: float) -> dict[str, float]:
    """Figures of episodes; those without data are `CENSORED` for a delay and 0 for the rest.

    loss
        The delay, times how often `healthy_rms` is `HEALTHY_SHARE` of the budget where that is more
        than once: lower is better.
    delay
        Restricted mean time from onset to the right declaration [s], over the episodes with a
        fault; one that a wrong declaration ends counts as missed, even before the onset.
    isolated, mistaken
        Share of these that end rightly declared, and share of all that end with another
        declaration.
    rms, healthy_rms
        Root mean square of the offsets over all decisions, and over those of episodes without a
        fault [m/s].
    """
    faulty = [one for one in outcomes if one.faulty]
    healthy = [one for one in outcomes if not one.faulty]
    right = [one for one in faulty if one.delay < CENSORED]
    delay = float(np.mean([one.delay for one in faulty])) if faulty else CENSORED
    healthy_rms = _rms(healthy)
    return {
        "loss": delay * max(1.0, healthy_rms / (HEALTHY_SHARE * budget)),
        "delay": delay,
        "isolated": len(right) / max(len(faulty), 1),
        "mistaken": (sum(one.declared for one in outcomes) - len(right)) / max(len(outcomes), 1),
        "rms": _rms(outcomes),
        "healthy_rms": healthy_rms,
    }


def _rms(outcomes: Sequence[Outcome]) -> float:
    decisions = sum(one.decisions for one in outcomes)
    return float(np.sqrt(sum(one.cost for one in outcomes) / max(decisions, 1)))
