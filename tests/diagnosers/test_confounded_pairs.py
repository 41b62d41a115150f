"""Pairs of faults that look alike at constant speed, and no more once the speed has changed.

Both faults are sized to show the same: what the belief says of which of the two it is must then not depend on which it
is. They are there from the start, and the diagnoser is switched on when the vehicle has settled with them: a beginning
is a change itself, which the accelerometer tells from a fouled paddle wheel.
"""

from typing import NamedTuple

import numpy as np
import pytest

from auv_fault_env.faults import CATALOGUE, classes
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import Mission
from auv_fault_env.schedules import FaultEvent
from diagnosers import make
from training.rollouts import roll_out
from training.seeds import seeds

N_LANES = 16  # of either fault, on the same vehicles
SETTLED, CHANGE, END = 300, 500, 700  # samples: the diagnoser is switched on, the speed changes, all is seen


class Pair(NamedTuple):
    """Two faults, their severities, the speed [m/s] that hides which it is, and the speed that tells."""

    one: str
    severity: float
    other: str
    other_severity: float
    hiding: float
    telling: float


PAIRS = {
    # The same shaft speed for the same reading: drag 1.3 times, or the true speed 1/0.877 = sqrt(1.3) times. The faster
    # vehicle's propellers need less torque, 0.4 mN m of 18, which friction may be off by 1.3.
    "drag, fouling": Pair("increased_drag", 0.3, "sensor_scale:speed", 0.307, 0.3, 0.6),
    # Drag 1.25 times, or thrust 0.8 times. A damaged propeller needs less torque as well, but at 0.2 m/s friction takes
    # four fifths of it, and may be off by more than the damage; torque grows with the square of the speed.
    "drag, thrust": Pair("increased_drag", 0.25, "propeller_damage:port", 0.8, 0.2, 0.6),
    # 0.1 A more for a stiffer shaft, or a sensor that shows 0.1 A more. Ohm's law would tell, but at 0.9 m/s the back-EMF
    # of 5 V may be off by 1 %, and the propeller's torque by more than the friction; at 0.15 m/s both are small.
    "friction, current bias": Pair("seal_friction:port", 0.2, "sensor_bias:port_current", 0.25, 0.9, 0.15),
}


def log_odds(diagnoser: str, pair: Pair) -> tuple[np.ndarray, np.ndarray]:
    """Share of fault `one` in both, (n_samples, 2, n_lanes), where it is true and where the other is; and of normal."""
