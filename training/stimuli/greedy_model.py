"""A cheap model of what each hypothesis would read if the speed command changed, for `training.stimuli.greedy`.

The plant's own equations (`auv_fault_env.physics`) in coarse steps: the shafts, which settle within
half a second, follow their command at once; no noise, no disturbance; readings are those of sensors
with gain and bias.
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
STEPS = 4  # steps to a look at the readings, one second
LOOK = 4  # looks
N_READINGS = len(READINGS)
N_SHAFT = len(SHAFT)
N_SENSOR = len(SENSOR)
PORT, STARBOARD = (list(PARAMETERS).index(f"{side}_{SHAFT[0]}") for side in SIDES)
# first parameter of the sensors: bias and gain lead each one's
SENSORS = len(HULL) + len(SIDES) * N_SHAFT
# rows of `READINGS`; current and rpm follow
SPEED = 0
ACCELERATION = 1
PORT_VOLTAGE = 2
STARBOARD_VOLTAGE = 5
LEAST_GAIN = 0.1  # of a sensor, when its reading is taken for the truth


class Now(NamedTuple):
    """What is known of the moment: measured speed as the controller has filtered it, measured acceleration, command."""

    speed: float
    acceleration: float
    command: float


@scalar
def read(parameters, row, truth):
    """What the sensor of a row of `READINGS` reads."""
    sensor = SENSORS + row * N_SENSOR
    return parameters[sensor + 1] * truth + parameters[sensor]


@scalar
def true_of(parameters, row, reading):
    """What is true if that sensor reads this."""
    sensor = SENSORS + row * N_SENSOR
    return (reading - parameters[sensor]) / max(parameters[sensor + 1], LEAST_GAIN)


@scalar
def spin_of(parameters, row, rpm):
    """Shaft speed [rad/s] that is regulated to a command by the counter of that row."""
    return max(true_of(parameters, row, rpm), 0.0) / RPM


@scalar
def look(parameters, speed, rpm, force, constants, readings):
    """Write the readings (8,) at this true speed, shaft speed command and disturbance; returns the acceleration."""
    readings[SPEED] = read(parameters, SPEED, speed)
    port = shaft_at(parameters, PORT, 1)
    starboard = shaft_at(parameters, STARBOARD, 1)
    port_spin = spin_of(parameters, PORT_VOLTAGE + 2, rpm)
    starboard_spin = spin_of(parameters, STARBOARD_VOLTAGE + 2, rpm)
    sides = motor(port, constants, 0.0), motor(starboard, constants, 0.0)
    acceleration = surge_acceleration(
        speed, port_spin, starboard_spin, parameters[0], force, sides[0], sides[1]
    )
    readings[ACCELERATION] = read(parameters, ACCELERATION, acceleration)
    for row, shaft, spin in (
        (PORT_VOLTAGE, port, port_spin),
        (STARBOARD_VOLTAGE, starboard, starboard_spin),
    ):
        voltage = equilibrium_voltage(shaft, spin, speed, constants)
        readings[row] = read(parameters, row, voltage)
        readings[row + 1] = read(parameters, row + 1, armature_current(shaft, spin, voltage))
        readings[row + 2] = read(parameters, row + 2, spin * RPM)
    return acceleration


@scalar
def respond(parameters, now, command, constants, readings, responses):
    """Write the changes of the readings (LOOK, 8) from now to 1, 2, ... s after a new command.

    A force makes up for what the hypothesis leaves open of the present acceleration: it is known
    already, and tells nothing. readings (8,) is working memory.
    """
    share = 1.0 - math.exp(-STEP / constants.speed_filter_time)
    kept = now.speed
    speed = true_of(parameters, SPEED, kept)
    rpm = rpm_command(constants, now.command, kept, 0.0)
    force = true_of(parameters, ACCELERATION, now.acceleration)
    force -= look(parameters, speed, rpm, 0.0, constants, readings)
    look(parameters, speed, rpm, force, constants, readings)
    for second in range(LOOK):
        responses[second] = -readings
    for second in range(LOOK):
        for _ in range(STEPS):
            rpm = rpm_command(constants, command, kept, 0.0)
            speed += STEP * look(parameters, speed, rpm, force, constants, readings)
            kept = low_pass(kept, read(parameters, SPEED, speed), share)
        look(
            parameters,
            speed,
            rpm_command(constants, command, kept, 0.0),
            force,
            constants,
            readings,
        )
        responses[second] += readings


@scalar
def information(responses, probability, variance):
    """Lower bound on what these readings tell of the hypotheses [nat]: ``-sum_i p_i log sum_j p_j exp(-k_ij)``.

    k_ij is the Bhattacharyya distance of two normals of equal variance.
    """
    total = 0.0
    for i in range(probability.size):
        alike = 0.0
        for j in range(probability.size):
            distance = 0.0
            for second in range(LOOK):
                for row in range(N_READINGS):
                    gap = responses[i, second, row] - responses[j, second, row]
                    distance += gap * gap / (8.0 * variance[row])
            alike += probability[j] * math.exp(-distance)
        total -= probability[i] * math.log(alike)
    return total


@kernel
def expected_information(parameters, probability, now, mission, grid, variance, constants):
    """What `LOOK` seconds of each offset will tell of the hypotheses at least [nat], (n_lanes, n_grid).

    Parameters
    ----------
    parameters
        Of the vehicle under each hypothesis, (n_lanes, n_hypotheses, n_parameters).
    probability
        (n_lanes, n_hypotheses), above 0, each row sums to 1.
    now
        (n_lanes, 3), see `Now`.
    mission
        Speed [m/s], (n_lanes,).
    grid
        Offsets to try [m/s], (n_grid,).
    variance
        Of a second's readings, (8,).
    constants
        `PlantConstants` of the nominal vehicle as an array.
    """
    n_lanes, n_hypotheses, _ = parameters.shape
    shared = constants_from_array(constants)
    readings = np.empty(N_READINGS)
    responses = np.empty((n_hypotheses, LOOK, N_READINGS))
    out = np.empty((n_lanes, grid.size))
    for lane in range(n_lanes):
        present = Now(now[lane, 0], now[lane, 1], now[lane, 2])
        for g in range(grid.size):
            for h in range(n_hypotheses):
                command = max(mission[lane] + grid[g], 0.0)
                respond(parameters[lane, h], present, command, shared, readings, responses[h])
            out[lane, g] = information(responses, probability[lane], variance)
    return out
