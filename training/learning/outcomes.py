"""How the episodes of the active environment end: right, wrong or late, and at which cost."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from training.metrics import NORMAL
from training.metrics.records import HORIZON

# Of the budget: root mean square of the offsets of a healthy vehicle. It is half of the aim beside
# the whole bank, which doubts more often than the light one.
HEALTHY_SHARE = 0.05
CENSORED = HORIZON  # s from onset


class Outcome(NamedTuple):
    """The end of one episode of a lane."""

    lane: int
    decisions: int  # each of a second
    cost: float  # sum of the mean squared offsets of the decisions [m^2/s^2]
    faulty: bool  # even if the fault has not begun
    declared: bool  # right or wrong
    delay: float  # s, from onset to the right declaration, else `CENSORED`


def true_classes(infos: Sequence[dict[str, Any]]) -> np.ndarray:
    """The index of the class that is true on each lane, (n_lanes,)."""
    return np.array([info["true_class"] for info in infos])


class Outcomes:
    """Follows the lanes of the active environment and collects the outcomes in `ended`.

    The right class is the last fault that was true, so that an intermittent fault may be declared
    between its bursts.

    Parameters
    ----------
    onset
        Of the first fault of each lane [s], infinite without one, (n_lanes,).
    """

    def __init__(self, onset: np.ndarray):
        self.ended: list[Outcome] = []
        self._onset = onset
        self._decisions = np.zeros(onset.size, np.int64)
        self._cost = np.zeros(onset.size)
        self._last_fault = np.full(onset.size, NORMAL)

    def update(
        self, infos: Sequence[dict[str, Any]], done: np.ndarray, onset: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Take the information of a step of the environment as a `VecEnv`.

        The onsets (n_lanes,) are those of the present episodes, after the resets. Returns costs and
        true classes, (n_lanes,).
        """
        cost = np.array([info["cost"] for info in infos])
        true_class = true_classes(infos)
        self._last_fault = np.where(true_class != NORMAL, true_class, self._last_fault)
        self._decisions += 1
        self._cost += cost
        for lane in np.flatnonzero(done).tolist():
            self.ended.append(self._outcome(lane, infos[lane]))
        self._decisions[done] = 0
        self._cost[done] = 0.0
        self._last_fault[done] = NORMAL
        self._onset = onset
        return cost, true_class

    def _outcome(self, lane: int, info: dict[str, Any]) -> Outcome:
        onset = float(self._onset[lane])
        declared_class = int(info["declared_class"])
        is_declared = declared_class != NORMAL
        is_right = is_declared and declared_class == int(self._last_fault[lane])
        delay = float(self._decisions[lane]) - onset
        return Outcome(
            lane=lane,
            decisions=int(self._decisions[lane]),
            cost=float(self._cost[lane]),
            faulty=math.isfinite(onset),
            declared=is_declared,
            delay=min(delay, CENSORED) if is_right else CENSORED,
        )


def figures(outcomes: Sequence[Outcome], budget: float) -> dict[str, float]:
    """Figures of episodes; without any that count, a delay is `CENSORED` and the others are 0.

    Returns
    -------
    loss
        The delay times ``healthy_rms / (HEALTHY_SHARE budget)`` where that is above 1: lower is
        better.
    delay
        Restricted mean of the time from onset to the right declaration [s], over the episodes with
        a fault; one that a wrong declaration ends counts as missed, even before the onset.
    isolated, mistaken
        Share of these that end with the right declaration, and share of all that end with another.
    rms, healthy_rms
        Root mean square of the offsets over all decisions, and over those of episodes without a
        fault [m/s].
    """
    faulty = [outcome for outcome in outcomes if outcome.faulty]
    healthy = [outcome for outcome in outcomes if not outcome.faulty]
    n_right = sum(outcome.delay < CENSORED for outcome in faulty)
    n_declared = sum(outcome.declared for outcome in outcomes)
    delay = float(np.mean([outcome.delay for outcome in faulty])) if faulty else CENSORED
    healthy_rms = _rms(healthy)
    return {
        "loss": delay * max(1.0, healthy_rms / (HEALTHY_SHARE * budget)),
        "delay": delay,
        "isolated": n_right / max(len(faulty), 1),
        "mistaken": (n_declared - n_right) / max(len(outcomes), 1),
        "rms": _rms(outcomes),
        "healthy_rms": healthy_rms,
    }


def _rms(outcomes: Sequence[Outcome]) -> float:
    n_decisions = sum(outcome.decisions for outcome in outcomes)
    total_cost = sum(outcome.cost for outcome in outcomes)
    return float(np.sqrt(total_cost / max(n_decisions, 1)))
