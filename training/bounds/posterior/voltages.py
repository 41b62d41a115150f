"""The true voltages of the motors, which the controllers compute from commands and readings.

A voltage follows from what is observed up to the integral at the start: the controllers act on
readings. Where a voltage is at its limit, the integral becomes known too.
"""

import math
from typing import NamedTuple

import numpy as np

from auv_fault_env import physics
from auv_fault_env.channels import COMMANDS, INDEX
from auv_fault_env.compiling import kernel
from auv_fault_env.parameters import SAMPLE_TIME, SIDES
from auv_fault_env.physics import PlantConstants

MISSION_SPEED = INDEX["mission_speed"]
SPEED_COMMAND = INDEX["speed_command"]
RUDDER = INDEX["rudder"]
STERN_PLANE = INDEX["stern_plane"]
SPEED = INDEX["speed"]
VOLTAGE = tuple(INDEX[f"{side}_voltage"] for side in SIDES)
RPM = tuple(INDEX[f"{side}_rpm"] for side in SIDES)
FIRST_READING = len(COMMANDS)


class Voltages(NamedTuple):
    """The voltages [V] of both motors along an episode, (n_samples, 2) each."""

    voltage: np.ndarray  # if the first reading of it were exact
    by_start: np.ndarray  # its derivative by the error of the first reading


@kernel
def follow_controllers(observations, start_speed, start_voltage, constants, voltage, by_start):
    """Fill both arrays of `Voltages` from observations (n_samples, n_channels)."""
    share = 1.0 - math.exp(-SAMPLE_TIME / constants.speed_filter_time)
    for side in range(2):
        filtered = start_speed
        integral = start_voltage[side]
        slope = 1.0 if integral > 0.0 else 0.0
        voltage[0, side] = integral
        by_start[0, side] = slope
        for k in range(1, len(observations)):
            now = observations[k]
            before = observations[k - 1]
            filtered = physics.low_pass(filtered, before[SPEED], share)
            rudder = now[RUDDER]
            plane = now[STERN_PLANE]
            command = physics.rpm_command(
                constants, now[SPEED_COMMAND], filtered, rudder * rudder + plane * plane
            )
            error = command - before[RPM[side]]
            voltage[k, side], integral = physics.voltage_command(constants, error, integral)
            if voltage[k, side] <= 0.0 or voltage[k, side] >= constants.maximum_voltage:
                slope = 0.0
            by_start[k, side] = slope


def commanded_voltages(observations: np.ndarray, constants: PlantConstants) -> Voltages:
    """The voltages of an episode (n_samples, n_channels) that starts steadily or at rest.

    A vehicle starts at its mission's speed or standing, which the first speed reading tells apart.
    """
    observations = np.asarray(observations, np.float64)
    mission_speed, reading = observations[0, [MISSION_SPEED, SPEED]]
    moves = mission_speed > 0.0 and reading > 0.5 * mission_speed
    start_speed = mission_speed if moves else 0.0
    start_voltage = observations[0, list(VOLTAGE)] * moves
    shape = len(observations), len(SIDES)
    voltages = Voltages(np.zeros(shape), np.zeros(shape))
    follow_controllers(observations, start_speed, start_voltage, constants, *voltages)
    return voltages
