"""A cheap model of the readings under each hypothesis after a change of the speed command.

For `training.stimuli.greedy`. The equations are those of the plant (`auv_fault_env.physics`) in
coarse steps: the shafts, which settle within half a second, follow their command at once; no noise,
no disturbance; sensors have gain and bias.
"""

import math
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import READINGS
from auv_fault_env.compiling import kernel, scalar
from auv_fault_env.parameters import HULL, PARAMETERS, SENSOR, SHAFT, SIDES
from auv_fault_env.physics import (
    RPM,
    armature_current,
    constants_from_array,
    equilibrium_voltage,
    low_pass,
    motor,
    rpm_command,
    shaft_at,
    surge_acceleration,
)

STEP = 0.25  # s
STEPS_PER_SECOND = 4
N_SECONDS = 4  # the readings are predicted at the end of each
N_READINGS = len(READINGS)
N_SHAFT = len(SHAFT)
N_SENSOR = len(SENSOR)
PORT, STARBOARD = (list(PARAMETERS).index(f"{side}_{SHAFT[0]}") for side in SIDES)
# first parameter of the sensors; the parameters of each begin with bias and gain
SENSORS = len(HULL) + len(SIDES) * N_SHAFT
# rows of `READINGS`; current and rpm follow the voltage
SPEED = 0
ACCELERATION = 1
PORT_VOLTAGE = 2
STARBOARD_VOLTAGE = 5
LEAST_GAIN = 0.1  # of a sensor, where a true value is computed from its reading


class Present(NamedTuple):
    """The present state: measured speed after the controller's filter, acceleration, command."""

    speed: float
    acceleration: float
    command: float


@scalar
def sensor_reading(parameters, row, quantity):
    """The reading of the sensor of this row of `READINGS`."""
    sensor = SENSORS + row * N_SENSOR
    return parameters[sensor + 1] * quantity + parameters[sensor]


@scalar
def true_value(parameters, row, reading):
    """The true value behind a reading of the sensor of this row."""
    sensor = SENSORS + row * N_SENSOR
    return (reading - parameters[sensor]) / max(parameters[sensor + 1], LEAST_GAIN)


@scalar
def shaft_speed(parameters, row, rpm):
    """Shaft speed [rad/s] at which the counter of this row reads the commanded rpm."""
    return max(true_value(parameters, row, rpm), 0.0) / RPM


@scalar
def write_readings(parameters, speed, rpm, force, constants, readings):
    """Write the readings (n_readings,) at this state; returns the true acceleration.

    The state is true speed, commanded shaft speed [rpm] and disturbance.
    """
    readings[SPEED] = sensor_reading(parameters, SPEED, speed)
    port = shaft_at(parameters, PORT, 1)
    starboard = shaft_at(parameters, STARBOARD, 1)
    port_speed = shaft_speed(parameters, PORT_VOLTAGE + 2, rpm)
    starboard_speed = shaft_speed(parameters, STARBOARD_VOLTAGE + 2, rpm)
    motors = motor(port, constants, 0.0), motor(starboard, constants, 0.0)
    acceleration = surge_acceleration(
        speed, port_speed, starboard_speed, parameters[0], force, motors[0], motors[1]
    )
    readings[ACCELERATION] = sensor_reading(parameters, ACCELERATION, acceleration)
    for row, shaft, turning in (
        (PORT_VOLTAGE, port, port_speed),
        (STARBOARD_VOLTAGE, starboard, starboard_speed),
    ):
        voltage = equilibrium_voltage(shaft, turning, speed, constants)
        current = armature_current(shaft, turning, voltage)
        readings[row] = sensor_reading(parameters, row, voltage)
        readings[row + 1] = sensor_reading(parameters, row + 1, current)
        readings[row + 2] = sensor_reading(parameters, row + 2, turning * RPM)
    return acceleration


@scalar
def write_changes(parameters, present, command, constants, readings, changes):
    """Write the changes of the readings 1, 2, ... s after a new speed command.

    A force accounts for the part of the present acceleration that the hypothesis does not explain:
    it is known already, and carries no information.

    Parameters
    ----------
    readings
        Working memory, (n_readings,).
    changes
        Result, (n_seconds, n_readings).
    """
    share = 1.0 - math.exp(-STEP / constants.speed_filter_time)
    filtered_speed = present.speed
    speed = true_value(parameters, SPEED, filtered_speed)
    rpm = rpm_command(constants, present.command, filtered_speed, 0.0)
    force = true_value(parameters, ACCELERATION, present.acceleration)
    force -= write_readings(parameters, speed, rpm, 0.0, constants, readings)
    write_readings(parameters, speed, rpm, force, constants, readings)
    for second in range(N_SECONDS):
        changes[second] = -readings
    for second in range(N_SECONDS):
        for _ in range(STEPS_PER_SECOND):
            rpm = rpm_command(constants, command, filtered_speed, 0.0)
            speed += STEP * write_readings(parameters, speed, rpm, force, constants, readings)
            reading = sensor_reading(parameters, SPEED, speed)
            filtered_speed = low_pass(filtered_speed, reading, share)
        rpm = rpm_command(constants, command, filtered_speed, 0.0)
        write_readings(parameters, speed, rpm, force, constants, readings)
        changes[second] += readings


@scalar
def information(changes, probability, variance):
    """Lower bound of the information on the hypotheses [nat].

    ``-sum_i p_i log sum_j p_j exp(-k_ij)``; k_ij is the Bhattacharyya distance of two normal
    distributions of equal variance.
    """
    total = 0.0
    for i in range(probability.size):
        similarity = 0.0
        for j in range(probability.size):
            distance = 0.0
            for second in range(N_SECONDS):
                for row in range(N_READINGS):
                    gap = changes[i, second, row] - changes[j, second, row]
                    distance += gap * gap / (8.0 * variance[row])
            similarity += probability[j] * math.exp(-distance)
        total -= probability[i] * math.log(similarity)
    return total


@kernel
def expected_information(
    parameters, probability, present, mission_speed, offsets, variance, constants
):
    """Lower bound of the information of each offset over `N_SECONDS` [nat], (n_lanes, n_offsets).

    Parameters
    ----------
    parameters
        Of the vehicle under each hypothesis, (n_lanes, n_hypotheses, n_parameters).
    probability
        (n_lanes, n_hypotheses), above 0, each row sums to 1.
    present
        (n_lanes, 3), see `Present`.
    mission_speed
        (n_lanes,) [m/s].
    offsets
        To try, (n_offsets,) [m/s].
    variance
        Of the readings of a second, (n_readings,).
    constants
        `PlantConstants` of the nominal vehicle as an array.
    """
    n_lanes, n_hypotheses, _ = parameters.shape
    plant = constants_from_array(constants)
    readings = np.empty(N_READINGS)
    changes = np.empty((n_hypotheses, N_SECONDS, N_READINGS))
    bounds = np.empty((n_lanes, offsets.size))
    for lane in range(n_lanes):
        state = Present(present[lane, 0], present[lane, 1], present[lane, 2])
        for k in range(offsets.size):
            command = max(mission_speed[lane] + offsets[k], 0.0)
            for h in range(n_hypotheses):
                write_changes(parameters[lane, h], state, command, plant, readings, changes[h])
            bounds[lane, k] = information(changes, probability[lane], variance)
    return bounds
