"""The memory of a fleet: which quantity stands where.

The lanes stand in blocks of `LANES`. A block is one contiguous table, a row per quantity and a
column per lane: element ``row * LANES + lane``. The innermost loops run over the columns, at
distances the compiler knows, and so vectorise.
"""

from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS, COMMANDS, READINGS
from auv_fault_env.parameters import HULL, PARAMETERS, SENSOR, SHAFT

LANES = 256  # lanes of a block: its table stays in the second-level cache

# Rows 0 to 11 are the observation, in the order of CHANNELS; the last rows the parameters, in that
# of PARAMETERS.
N_CHANNELS = len(CHANNELS)
N_PARAMETERS = len(PARAMETERS)
MISSION_SPEED, SPEED_COMMAND, RUDDER, STERN_PLANE = range(4)
READING = len(COMMANDS)
(
    SPEED_READING,
    ACCELERATION_READING,
    PORT_VOLTAGE_READING,
    PORT_CURRENT_READING,
    PORT_RPM_READING,
    STARBOARD_VOLTAGE_READING,
    STARBOARD_CURRENT_READING,
    STARBOARD_RPM_READING,
) = range(READING, N_CHANNELS)
(SPEED, FILTERED_SPEED, ACCELERATION, DISTURBANCE, REWARD, ENERGY, COST) = range(
    N_CHANNELS, N_CHANNELS + 7
)
PORT_STATE = COST + 1
STARBOARD_STATE = COST + 6
SHAFT_SPEED, ANGLE, INTEGRAL, VOLTAGE, CURRENT = range(5)  # rows of each side's state
PARAMETER = STARBOARD_STATE + 5
ALPHA = PARAMETER
GAMMA = PARAMETER + 1
PORT_SHAFT = PARAMETER + len(HULL)
STARBOARD_SHAFT = PARAMETER + len(HULL) + len(SHAFT)
SENSORS = STARBOARD_SHAFT + len(SHAFT)
N_SENSOR_PARAMETERS = len(SENSOR)
N_ROWS = PARAMETER + N_PARAMETERS

# Scratch rows, one table per call: two motors' coefficients, the hull's drag, ten normals.
PORT_MOTOR = 0
STARBOARD_MOTOR = 5
DRAG = 10
NORMAL = 11
N_SCRATCH = 21
DISTURBANCE_NORMAL = NORMAL + len(READINGS)


class FleetState(NamedTuple):
    """State of a fleet: block memory (n_blocks, N_ROWS * LANES), noise key, step and next due step, each (n_lanes,)."""

    memory: np.ndarray
    key: np.ndarray
    step: np.ndarray
    next_update: np.ndarray


class EpisodePlan(NamedTuple):
    """What is to happen to each lane: healthy parameters, fault events, mission legs; and the severities in force."""

    healthy: np.ndarray  # (n_lanes, N_PARAMETERS)
    fault: np.ndarray  # (n_lanes, n_events) row of the catalogue, -1 for none
    profile: np.ndarray  # (n_lanes, n_events, 6): onset, severity, ramp, end, period, duty
    severity: np.ndarray  # (n_lanes, n_events), written by `refresh_lane`
    legs: np.ndarray  # (n_lanes, n_legs, 2): start [s], mission speed [m/s]


class Catalogue(NamedTuple):
    """What each fault does at severity 1, and how far any compound of faults may go."""

    scale: np.ndarray  # (n_faults, N_PARAMETERS), factor
    offset: np.ndarray  # (n_faults, N_PARAMETERS), shift
    low: np.ndarray  # (N_PARAMETERS,), physical limits
    high: np.ndarray  # (N_PARAMETERS,)
