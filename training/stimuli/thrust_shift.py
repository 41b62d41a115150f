"""The stimulus that shifts thrust between the sides, at constant total thrust and constant speed.

A propeller that thrusts more loads its motor more. So a change of its load, which is a fault of the
propeller, differs from a change of the motor, of friction or of sensors. A change of the speed
shows that, too, at more energy. Faults of hull and paddle wheel stay as hard to see.
"""

from functools import cache

import numpy as np

from auv_fault_env.faults import CATALOGUE, classes
from auv_fault_env.parameters import SIDES
from diagnosers import Belief
from training.stimuli.open_loop import Cruise
from training.stimuli.triggered_surge import LEAST_NORMAL

DEPTH = 0.4  # of the shift, for 2 % more energy at 1 ft/s
SURE = 0.95  # probability of a fault from which thrust is equal again


@cache
def side_of_class(names: tuple[str, ...]) -> np.ndarray:
    """1 for faults of propeller, shaft and motor of port, -1 for those of starboard, 0 for others.

    Of these classes, (n_classes,).
    """
    sign = dict(zip(SIDES, (1.0, -1.0), strict=True))
    sides = {
        fault.diagnosis: sign.get(fault.component.partition(":")[2], 0.0)
        for fault in CATALOGUE.values()
    }
    return np.array([sides.get(name, 0.0) for name in names])


def shift_to_suspect(log_probability: np.ndarray) -> np.ndarray:
    """Shift of thrust (n_lanes,) by the odds of port less those of starboard, up to `DEPTH`.

    Of the log probabilities (n_lanes, n_classes). There is none once a fault is sure, so that a
    damaged propeller does not have to give more than its share.
    """
    probability = np.exp(log_probability)
    odds = probability @ side_of_class(classes()) / np.maximum(probability[:, 0], LEAST_NORMAL)
    is_sure = probability[:, 1:].max(axis=1) > SURE
    return np.where(is_sure, 0.0, DEPTH * np.clip(odds, -1.0, 1.0))


class TriggeredShift(Cruise):
    """Thrust to the side that is suspected, at the mission's speed, in a vehicle with two shafts.

    It needs no budget: there is no offset. What it costs is energy and rudder.
    """

    name = "triggered_shift"
    seed_block = 19

    def thrust_shift(self, sample: int, observation: np.ndarray, belief: Belief) -> np.ndarray:
        """The shift of the rule."""
        return shift_to_suspect(belief.log_probability)
