"""The memory of a fleet: which quantity stands in which row.

The lanes stand in blocks of `LANES`. A block is one contiguous table, a row for each quantity and a
column for each lane: element ``row * LANES + lane``. The innermost loops vectorise over columns.
"""

from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS, COMMANDS, READINGS
from auv_fault_env.parameters import HULL, LONGEST_LATENCY, PARAMETERS, SENSOR, SHAFT, SIGNAL

LANES = 256  # lanes of a block: its table stays in the second-level cache

# The first rows are the observation, as in CHANNELS; then follow the state, the parameters, as in
# PARAMETERS, and what `realism` adds.
N_CHANNELS = len(CHANNELS)
N_READINGS = len(READINGS)
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
STATE = range(N_CHANNELS, N_CHANNELS + 7)
SPEED, FILTERED_SPEED, ACCELERATION, DISTURBANCE, REWARD, ENERGY, COST = STATE
# the state of a shaft and its motor: rows of each side, counted from its first
SHAFT_SPEED, ANGLE, INTEGRAL, VOLTAGE, CURRENT = range(5)
PORT_STATE = COST + 1
PORT_SHAFT_SPEED, PORT_ANGLE, _, PORT_VOLTAGE, PORT_CURRENT = range(PORT_STATE, PORT_STATE + 5)
STARBOARD_STATE = PORT_STATE + 5
PARAMETER = STARBOARD_STATE + 5
STARBOARD_STATES = range(STARBOARD_STATE, PARAMETER)
STARBOARD_SHAFT_SPEED, STARBOARD_ANGLE, _, STARBOARD_VOLTAGE, STARBOARD_CURRENT = STARBOARD_STATES
ALPHA = PARAMETER
GAMMA = PARAMETER + 1
PORT_SHAFT = PARAMETER + len(HULL)
STARBOARD_SHAFT = PARAMETER + len(HULL) + len(SHAFT)
SENSORS = STARBOARD_SHAFT + len(SHAFT)
N_SENSOR_PARAMETERS = len(SENSOR)
# parameters of a shaft, counted from its first
RESISTANCE = SHAFT.index("resistance")
TORQUE_CONSTANT = SHAFT.index("torque_constant")
SIGNALS = SENSORS + N_READINGS * N_SENSOR_PARAMETERS
N_SIGNAL_PARAMETERS = len(SIGNAL)
SURROUNDINGS = PARAMETER + N_PARAMETERS
# angles [deg], noise of the paddle wheel, current of the water and what it tends to [m/s]
PITCH, ROLL, WHEEL_NOISE, WATER_CURRENT, WATER_TARGET = range(SURROUNDINGS, SURROUNDINGS + 5)
# above the water [K]
PORT_TEMPERATURE = SURROUNDINGS + 5
STARBOARD_TEMPERATURE = SURROUNDINGS + 6
# of motors as cold as the water: resistance, then torque constant
PORT_COLD = SURROUNDINGS + 7
STARBOARD_COLD = SURROUNDINGS + 9
# by parameter the row of its value in cold motors, 0 for other parameters
COLD_ROW = np.zeros(N_PARAMETERS, np.int64)
COLD_ROW[PORT_SHAFT - PARAMETER + RESISTANCE] = PORT_COLD
COLD_ROW[PORT_SHAFT - PARAMETER + TORQUE_CONSTANT] = PORT_COLD + 1
COLD_ROW[STARBOARD_SHAFT - PARAMETER + RESISTANCE] = STARBOARD_COLD
COLD_ROW[STARBOARD_SHAFT - PARAMETER + TORQUE_CONSTANT] = STARBOARD_COLD + 1
# the last signals of each sensor, in a circle
HISTORY = SURROUNDINGS + 11
N_HISTORY = LONGEST_LATENCY + 1
N_ROWS = HISTORY + N_READINGS * N_HISTORY

# rows of a `Motion`
MOVING = (SPEED, PORT_SHAFT_SPEED, STARBOARD_SHAFT_SPEED, PORT_ANGLE, STARBOARD_ANGLE)

# Scratch rows of one call. Of `integration`: the motion at the start of the sample, both motors,
# drag of the hull, disturbance, the motion at the end, and its misfit. Then: ten normals, the
# signals that the sensors convert, the sine of a ripple.
START = 0
PORT_MOTOR = START + len(MOVING)
STARBOARD_MOTOR = PORT_MOTOR + 5
DRAG = STARBOARD_MOTOR + 5
PUSH = DRAG + 1
MOTION = PUSH + 1
MISFIT = MOTION + len(MOVING)
N_INTEGRATION = MISFIT + 1
NORMAL = N_INTEGRATION
DISTURBANCE_NORMAL = NORMAL + N_READINGS
SIGNAL_VALUE = DISTURBANCE_NORMAL + 2
RIPPLE = SIGNAL_VALUE + N_READINGS
N_SCRATCH = RIPPLE + 1


class SeverityProfile(NamedTuple):
    """The severity of one event over time: times in s, full severity and duty from 0 to 1."""

    onset: float
    severity: float
    ramp: float
    end: float
    period: float
    duty: float


class FleetState(NamedTuple):
    """The state of all lanes; `next_update` is the step at which severities or mission change."""

    memory: np.ndarray  # (n_blocks, N_ROWS * LANES)
    key: np.ndarray  # (n_lanes,), key of the noise
    step: np.ndarray  # (n_lanes,)
    next_update: np.ndarray  # (n_lanes,)


class EpisodePlan(NamedTuple):
    """What happens to each lane in its episode, and the severities of the present step."""

    healthy: np.ndarray  # (n_lanes, N_PARAMETERS)
    fault: np.ndarray  # (n_lanes, n_events) place in `plant_faults`, -1 for none
    profile: np.ndarray  # (n_lanes, n_events, 6), each a `SeverityProfile`
    severity: np.ndarray  # (n_lanes, n_events), of the present step
    legs: np.ndarray  # (n_lanes, n_legs, 2): start [s], mission speed [m/s]


class Catalogue(NamedTuple):
    """What each fault does at severity 1, and the limits that no compound of faults passes."""

    scale: np.ndarray  # (n_faults, N_PARAMETERS), factors
    offset: np.ndarray  # (n_faults, N_PARAMETERS), shifts
    changed: np.ndarray  # (n_faults, n), parameters that the fault changes, then -1
    low: np.ndarray  # (N_PARAMETERS,), physical limits
    high: np.ndarray  # (N_PARAMETERS,)
