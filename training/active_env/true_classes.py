"""The class that is true at each decision, for lanes that start their episodes at any time."""

import numpy as np

from auv_fault_env.fleet import Fleet
from auv_fault_env.parameters import SAMPLE_RATE
from auv_fault_env.schedules import Events
from training.rollouts import label_and_severity

DECISION = round(SAMPLE_RATE)  # samples of a decision, one second


class TrueClasses:
    """Computed for a number of decisions ahead; twice as many where an episode lasts longer."""

    def __init__(self, fleet: Fleet, n_decisions: int):
        self._fleet = fleet
        # index of the class after each decision, the start included
        self._table = np.zeros((n_decisions + 1, fleet.n_lanes), np.int64)

    def begin(self, lanes: np.ndarray) -> None:
        """Take the new plan of the fleet for these lanes (m,)."""
        plan = self._fleet.plan
        events = Events(plan.fault[lanes], plan.profile[lanes])
        label, _ = label_and_severity(events, DECISION * (len(self._table) - 1) + 1)
        self._table[:, lanes] = label[::DECISION]

    def after(self, decisions: np.ndarray) -> np.ndarray:
        """The true class of each lane after its number of decisions (n_lanes,)."""
        lanes = np.arange(self._fleet.n_lanes)
        if decisions.max() >= len(self._table):
            self._table = np.zeros((2 * len(self._table), lanes.size), np.int64)
            self.begin(lanes)
        return self._table[decisions, lanes]
