"""Pairs of faults that look alike at constant speed, and no more once the speed has changed.

Both faults are sized to show the same: what the belief says of which of the two it is must then not
depend on which it is. They are present from the start, and the diagnoser starts when the vehicle
has settled: an onset is a change itself, by which the accelerometer distinguishes a fouled paddle
wheel.
"""

from typing import NamedTuple

import numpy as np
import pytest

from auv_fault_env.faults import CATALOGUE, classes
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import Mission
from auv_fault_env.parameters import SAMPLE_TIME
from auv_fault_env.schedules import FaultEvent
from diagnosers import make
from training.rollouts import roll_out
from training.seeds import seeds

N_LANES = 16  # of either fault, on the same vehicles
# samples: the diagnoser starts, the speed changes, 10 s have passed
SETTLED = 300
CHANGE = 500
END = 600


class Pair(NamedTuple):
    """Two faults, their severities, a speed [m/s] at which they look alike, and another one."""

    first: str
    severity: float
    second: str
    second_severity: float
    confounding: float
    separating: float


PAIRS = {
    # The same shaft speed for the same reading: drag 1.3 times, or the true speed 1/0.877 =
    # sqrt(1.3) times. The faster vehicle's propellers need less torque, 0.2 mN m of 15; friction
    # may be off by 1.3.
    "drag, fouling": Pair("increased_drag", 0.3, "sensor_scale:speed", 0.307, 0.2, 0.6),
    # Drag 1.2 times, or thrust 1/1.2 times. A damaged propeller needs less torque as well; but at
    # 0.2 m/s friction is four fifths of it, and may be off by more than the damage. The propeller's
    # torque grows with the square of speed.
    "drag, thrust": Pair("increased_drag", 0.2, "propeller_damage:port", 0.67, 0.2, 0.6),
    # About 0.1 A more, for a stiffer shaft or a sensor that says so. Ohm's law would separate them,
    # but at 0.9 m/s the back-EMF of 5 V may be off by 1 %, and the torque by the friction; at
    # 0.15 m/s these unknowns are small.
    "friction, current bias": Pair(
        "seal_friction:port", 0.15, "sensor_bias:port_current", 0.18, 0.9, 0.15
    ),
}


def shares(diagnoser: str, pair: Pair) -> np.ndarray:
    """Share of the first fault in the belief of both, (n_samples, 2): where true, where not."""
    schedules = (
        [FaultEvent(pair.first, 0.0, pair.severity)],
        [FaultEvent(pair.second, 0.0, pair.second_severity)],
    )
    mission = Mission(((0.0, pair.confounding), (CHANGE * SAMPLE_TIME, pair.separating)))
    lanes = seeds("calibration", N_LANES, 60_000)
    fleet = Fleet(2 * N_LANES)
    faults = [schedule for schedule in schedules for _ in lanes]
    rolled = roll_out(fleet, [*lanes, *lanes], END, None, faults, [mission] * fleet.n_lanes)
    one, other = (
        classes().index(CATALOGUE[fault].diagnosis) for fault in (pair.first, pair.second)
    )
    under_test = make(diagnoser)
    under_test.reset(fleet.n_lanes)
    log_probability = np.stack(
        [under_test.update(row).log_probability for row in rolled.observations[SETTLED:]]
    )
    share = 1.0 / (1.0 + np.exp(log_probability[:, :, other] - log_probability[:, :, one]))
    return share.reshape(len(share), 2, N_LANES).mean(axis=2)


@pytest.mark.parametrize("pair", PAIRS.values(), ids=PAIRS.keys())
@pytest.mark.parametrize("diagnoser", ["filter_bank", "gaussian_bank", "integrated"])
def test_a_belief_does_not_say_which_of_two_that_look_alike(diagnoser, pair):
    where_true, where_not = shares(diagnoser, pair)[CHANGE - SETTLED - 1]
    # 0 if the belief does not depend on which of both is true, 1 if it is right
    assert where_true - where_not < 0.35


@pytest.mark.parametrize(
    ("diagnoser", "pair"),
    [
        *(("gaussian_bank", name) for name in PAIRS),
        # not the others within 10 s: they allow for errors of paddle wheel and current sensor
        ("filter_bank", "drag, thrust"),
        ("integrated", "drag, thrust"),
    ],
)
def test_a_change_of_speed_separates_what_looks_alike(diagnoser, pair):
    where_true, where_not = shares(diagnoser, PAIRS[pair])[-1]
    assert where_true > 0.8 and where_not < 0.2
