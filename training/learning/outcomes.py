"""Outcomes of training episodes: the time to a diagnosis, and the cost without a fault."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from training.stimuli.base import EPISODE_TIME

# s: what a healthy vehicle that spends its whole budget costs, in units of delay
WHOLE_BUDGET = 5.0
# s, of each second, per squared offset in units of the budget
PRICE = WHOLE_BUDGET / EPISODE_TIME


class Outcome(NamedTuple):
    """The end of one episode of a lane."""

    lane: int
    budget: float  # m/s
    is_faulty: bool  # even if the fault has not begun
    delay: float  # s, for which a fault was not diagnosed
    healthy_time: float  # s, without a fault
    healthy_cost: float  # squared offsets of that time [m^2/s]


def figures(outcomes: Sequence[Outcome]) -> dict[str, float]:
    """Figures of episodes; those without any episode that counts are 0.

    Returns
    -------
    loss
        ``delay + WHOLE_BUDGET healthy_share^2`` [s]: lower is better.
    delay
        Mean time for which a fault was not diagnosed, of the episodes with a fault [s].
    healthy_share
        Root mean square of the offsets without a fault, each in units of the budget.
    healthy_rms
        The same in m/s.
    """
    delays = [outcome.delay for outcome in outcomes if outcome.is_faulty]
    delay = float(np.mean(delays)) if delays else 0.0
    time = sum(outcome.healthy_time for outcome in outcomes)
    cost = sum(outcome.healthy_cost for outcome in outcomes)
    relative = sum(outcome.healthy_cost / outcome.budget**2 for outcome in outcomes)
    share = relative / max(time, 1.0)
    return {
        "loss": delay + WHOLE_BUDGET * share,
        "delay": delay,
        "healthy_share": float(np.sqrt(share)),
        "healthy_rms": float(np.sqrt(cost / max(time, 1.0))),
    }
