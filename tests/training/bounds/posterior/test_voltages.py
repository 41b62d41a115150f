"""The voltages that follow from commands and readings are those of the motors."""

import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import Mission, follow_mission
from auv_fault_env.parameters import PRESETS
from auv_fault_env.physics import plant_constants
from auv_fault_env.schedules import FaultEvent
from auv_fault_env.truth import FleetTruth
from training.bounds.posterior.voltages import RPM, SPEED_COMMAND, VOLTAGE, commanded_voltages

N_SAMPLES = 150
SCHEDULES = (
    (),
    (FaultEvent("sensor_bias:port_voltage", 5.0, 0.8),),
    (FaultEvent("sensor_stuck:starboard_rpm", 5.0, 0.6),),
    (FaultEvent("sensor_noise:speed", 5.0, 1.0),),
)
STEADY = Mission(((0.0, 0.4), (6.0, 0.5)), 0.4)
FROM_REST = Mission(((0.0, 0.0), (2.0, 0.5), (9.0, 0.0)), 0.0)


@pytest.mark.parametrize("mission", [STEADY, FROM_REST])
def test_voltages_are_the_true_ones_up_to_the_error_of_the_first_reading(mission):
    fleet = Fleet(len(SCHEDULES))
    observation = fleet.reset(range(4), schedules=SCHEDULES, missions=[mission] * 4)
    observations = []
    true_voltages = []
    for _ in range(N_SAMPLES):
        observations.append(observation)
        state = FleetTruth(fleet)["state"]
        true_voltages.append([state["port_voltage"], state["starboard_voltage"]])
        observation = fleet.step(follow_mission(observation))
    observations = np.array(observations)
    true_voltages = np.moveaxis(true_voltages, 1, 2)
    constants = plant_constants(PRESETS["thesis1992"])
    for lane in range(len(SCHEDULES)):
        found = commanded_voltages(observations[:, lane], constants)
        error = observations[0, lane, list(VOLTAGE)] - true_voltages[0, lane]
        expected = true_voltages[:, lane] + found.by_start * error
        assert found.voltage == pytest.approx(expected, abs=2e-4)


def test_a_voltage_at_its_limit_no_longer_depends_on_the_start():
    constants = plant_constants(PRESETS["thesis1992"])
    observations = np.zeros((15, len(CHANNELS)))
    observations[:, [INDEX["mission_speed"], SPEED_COMMAND, INDEX["speed"]]] = 0.3
    observations[:, VOLTAGE] = 6.0
    # as commanded at that speed, then far above it
    observations[:, RPM] = 266.0
    observations[10, RPM] = 3000.0
    found = commanded_voltages(observations, constants)
    assert found.voltage[:11] == pytest.approx(6.0, abs=0.1)
    assert (found.by_start[:11] == 1.0).all()
    assert (found.voltage[11] == 0.0).all()
    assert (found.by_start[11:] == 0.0).all()
