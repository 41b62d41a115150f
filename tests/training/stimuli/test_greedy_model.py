"""The cheap model of the greedy stimulus against the plant it stands for, and its bound against the
exact value.
"""

import numpy as np
import pytest

from auv_fault_env import CATALOGUE, CHANNELS, FaultEvent, Fleet
from auv_fault_env.channels import INDEX, READINGS
from auv_fault_env.faults import matrices
from auv_fault_env.parameters import PRESETS, nominal
from auv_fault_env.physics import constants_from_array
from training.stimuli.greedy_model import (
    N_SECONDS,
    Present,
    expected_information,
    information,
    write_changes,
)

SPEED = 0.3
STEP_UP = 0.05
FIRST = INDEX[READINGS[0]]
# Largest error of a change; those of voltage and current while the motor still speeds up, which the
# model leaves out.
TOLERANCE = dict(zip(READINGS, (0.01, 0.004, 0.12, 0.08, 12.0, 0.12, 0.08, 12.0), strict=True))
CONSTANTS = Fleet(1).constants
VARIANCE = np.array([CHANNELS[name].noise ** 2 for name in READINGS])


def parameters_of(fault, severity):
    """Parameters of the nominal vehicle with this fault."""
    scale, offset, *_ = matrices()
    row = list(CATALOGUE).index(fault)
    healthy = np.array(list(nominal(PRESETS["thesis1992"]).values()))
    return healthy * (1.0 + severity * (scale[row] - 1.0)) + severity * offset[row]


@pytest.mark.parametrize(
    "fault",
    [
        "increased_drag",
        "propeller_damage:port",
        "seal_friction:starboard",
        "sensor_scale:speed",
        "sensor_scale:port_rpm",
    ],
)
def test_changes_of_the_readings_are_those_of_the_plant(fault):
    fleet = Fleet(1, sensor_noise=0.0, disturbance=0.0, healthy_band=0.0)
    reading = fleet.reset([0], schedules=[(FaultEvent(fault, 0.0, 0.5),)], missions=[SPEED])
    for _ in range(600):
        reading = fleet.step([[SPEED, 0.0, 0.0]])
    before = reading[0, FIRST:].astype(float)
    changes = []
    for k in range(10 * N_SECONDS):
        reading = fleet.step([[SPEED + STEP_UP, 0.0, 0.0]])
        if k % 10 == 9:
            changes.append(reading[0, FIRST:] - before)
    predicted = np.empty((N_SECONDS, len(READINGS)))
    present = Present(before[0], before[1], SPEED)
    write_changes(
        parameters_of(fault, 0.5),
        present,
        SPEED + STEP_UP,
        constants_from_array(CONSTANTS),
        np.empty(len(READINGS)),
        predicted,
    )
    worst = dict(zip(READINGS, np.abs(predicted - changes).max(axis=0), strict=True))
    assert {name: error for name, error in worst.items() if error > TOLERANCE[name]} == {}
    assert predicted[-1, 0] > 0.01 and predicted[0, 1] > 0.002


def test_information_of_two_hypotheses_is_bounded_by_their_entropy_and_below_the_exact_value():
    changes = np.zeros((2, N_SECONDS, len(READINGS)))
    even = np.array([0.5, 0.5])
    assert information(changes, even, VARIANCE) == pytest.approx(0.0, abs=1e-12)
    changes[1, 0, 0] = 1.0
    assert information(changes, even, VARIANCE) == pytest.approx(np.log(2.0))
    # two normals two sigma apart, equally likely
    changes[1, 0, 0] = 2.0 * CHANNELS["speed"].noise
    bound = information(changes, even, VARIANCE)
    assert bound == pytest.approx(-np.log(0.5 + 0.5 * np.exp(-0.5)))  # k = 4/8
    x = np.linspace(-8.0, 10.0, 20001)
    density = [np.exp(-0.5 * (x - mean) ** 2) / np.sqrt(2.0 * np.pi) for mean in (0.0, 2.0)]
    mixture = 0.5 * (density[0] + density[1])
    exact = sum(0.5 * np.trapezoid(one * np.log(one / mixture), x) for one in density)
    assert 0.5 * exact < bound < exact


def test_without_a_change_of_command_in_steady_motion_there_is_no_information():
    vehicles = np.array(
        [[parameters_of("increased_drag", 0.8), parameters_of("propeller_loss:port", 0.2)]]
    )
    present = np.array([[SPEED, 0.0, SPEED]])
    mission = np.array([SPEED])
    grid = np.array([-0.03, 0.0, 0.05])
    bound = expected_information(
        vehicles, np.array([[0.4, 0.6]]), present, mission, grid, VARIANCE, CONSTANTS
    )
    assert bound[0, 1] == pytest.approx(0.0, abs=1e-9)
    assert (bound[0, [0, 2]] > 0.1).all()
