"""What a vehicle can still do: the speeds that it can hold, their power and their current.

`N_VEHICLES` possible vehicles of each lane represent a belief, the same quantiles of it at every
call, so that the figures change only when the belief does.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.special import ndtri
from scipy.stats import qmc

from auv_fault_env import physics
from auv_fault_env.channels import CHANNELS
from auv_fault_env.compiling import kernel, scalar
from auv_fault_env.errors import refusal
from auv_fault_env.faults import (
    CATALOGUE,
    classes,
    fault_classes,
    fault_effect,
    known_classes,
    matrices,
)
from auv_fault_env.parameters import HULL, PARAMETERS, SHAFT, SIDES, Vehicle, nominal
from diagnosers.diagnoser import Belief

N_VEHICLES = 128  # of a lane; a power of two: then each quantity has evenly spaced quantiles
N_PLANT = len(HULL) + len(SIDES) * len(SHAFT)  # the first of `PARAMETERS`, without the sensors'
ALPHA = 0
PORT = len(HULL)
STARBOARD = len(HULL) + len(SHAFT)
TOP_SPEED = CHANNELS["speed"].high  # m/s, upper limit of a reachable speed
N_HALVINGS = 20
# what rounding leaves of a balance
FORCE_TOLERANCE = 1e-9  # m/s^2
SHAFT_TOLERANCE = 1e-6  # rad/s^2


class Capability(NamedTuple):
    """What each possible vehicle can do; power is infinite at a speed that it cannot hold."""

    reachable_speed: np.ndarray  # (n_lanes, n_vehicles), the largest through the water [m/s]
    power: np.ndarray  # (n_lanes, n_vehicles, n_speeds), electrical, of both motors [W]
    current: np.ndarray  # (n_lanes, n_vehicles, n_speeds), of the motor that draws more [A]


@scalar
def _steady_shaft(shaft, shaft_speed, speed, constants):
    """Power [W], current [A] and `Motor` of a shaft at a speed, and whether the supply suffices."""
    voltage = physics.equilibrium_voltage(shaft, shaft_speed, speed, constants)
    current = physics.armature_current(shaft, shaft_speed, voltage)
    side = physics.motor(shaft, constants, voltage)
    acceleration = physics.shaft_acceleration(shaft_speed, speed, side)
    return voltage * current, current, side, acceleration > -SHAFT_TOLERANCE


@scalar
def _steady_motion(speed, alpha, port, starboard, constants):
    """Power [W] and larger current [A] at a constant speed, all shafts at the same shaft speed."""
    beta = port.beta + starboard.beta
    shaft_speed = physics.equilibrium_shaft_speed(alpha, beta, speed, constants)
    port_power, port_current, port_motor, port_suffices = _steady_shaft(
        port, shaft_speed, speed, constants
    )
    turning = shaft_speed if physics.has_starboard(constants) else 0.0
    starboard_power, starboard_current, starboard_motor, starboard_suffices = _steady_shaft(
        starboard, turning, speed, constants
    )
    acceleration = physics.surge_acceleration(
        speed, shaft_speed, turning, alpha, 0.0, port_motor, starboard_motor
    )
    can_hold = port_suffices and starboard_suffices and acceleration > -FORCE_TOLERANCE
    power = port_power + starboard_power if can_hold else np.inf
    return power, max(port_current, starboard_current)


@kernel
def _fill(parameters, speeds, constants, reachable_speed, power, current):
    """Fill a `Capability`; shapes as there and in `capability`."""
    for lane in range(parameters.shape[0]):
        for vehicle in range(parameters.shape[1]):
            alpha = parameters[lane, vehicle, ALPHA]
            port = physics.shaft_at(parameters[lane, vehicle], PORT, 1)
            starboard = physics.shaft_at(parameters[lane, vehicle], STARBOARD, 1)
            for k in range(speeds.shape[1]):
                speed = speeds[lane, k]
                steady = _steady_motion(speed, alpha, port, starboard, constants)
                power[lane, vehicle, k], current[lane, vehicle, k] = steady
            low = 0.0
            high = TOP_SPEED
            for _ in range(N_HALVINGS):
                middle = 0.5 * (low + high)
                steady = _steady_motion(middle, alpha, port, starboard, constants)
                if steady[0] < np.inf:
                    low = middle
                else:
                    high = middle
            reachable_speed[lane, vehicle] = low


def capability(parameters: np.ndarray, speeds: np.ndarray, vehicle: Vehicle) -> Capability:
    """What possible vehicles can do at these speeds, in steady motion with the rudders amidships.

    Misleads in a turn and in waves; and where one shaft alone reaches its limit: with unequal shaft
    speeds the vehicle would be a little faster.

    Parameters
    ----------
    parameters
        (n_lanes, n_vehicles, N_PLANT), as `sample_parameters` returns them.
    speeds
        Speeds through the water (n_lanes, n_speeds) [m/s].
    vehicle
        The nominal one, for shafts, water, supply and largest shaft speed.
    """
    n_lanes, n_vehicles, _ = parameters.shape
    shape = n_lanes, n_vehicles, speeds.shape[1]
    reachable_speed = np.empty((n_lanes, n_vehicles))
    filled = Capability(reachable_speed, np.empty(shape), np.empty(shape))
    constants = physics.plant_constants(vehicle)
    parameters = np.ascontiguousarray(parameters)
    speeds = np.ascontiguousarray(speeds, np.float64)
    _fill(parameters, speeds, constants, *filled)
    return filled


def sample_parameters(belief: Belief, vehicle: Vehicle) -> np.ndarray:
    """Plant parameters of equally likely possible vehicles, (n_lanes, n_vehicles, N_PLANT).

    Class and severity follow the belief (severity as a normal distribution within 0 and 1), and the
    healthy vehicle its band. An unknown fault counts as any of the known ones, evenly.
    """
    probability = np.exp(belief.log_probability)
    if probability.shape[1] != len(classes()):
        allowed = f"{len(classes())}, those of auv_fault_env.classes()"
        remedy = "give a belief over all of them"
        raise refusal("classes of the belief", probability.shape[1], allowed, remedy)
    unknown = probability[:, -1:]
    probability = probability[:, :-1]
    probability[:, 1:] += unknown / len(fault_classes())
    of_class, of_severity = _quantiles()[:, :2].T
    edges = probability.cumsum(axis=1)[:, None, :-1]
    chosen = (of_class[:, None] > edges).sum(axis=2)
    mean = np.take_along_axis(belief.severity_mean, chosen, 1)
    std = np.take_along_axis(belief.severity_std, chosen, 1)
    severity = np.clip(mean + std * ndtri(of_severity), 0.0, 1.0)
    specs = list(PARAMETERS.values())[:N_PLANT]
    half_width = np.array([spec.band for spec in specs])
    healthy = np.array(list(nominal(vehicle).values())[:N_PLANT])
    healthy = healthy * (1.0 + half_width * (2.0 * _quantiles()[:, 2:] - 1.0))
    scale, offset = _effects()
    factor, shift = fault_effect(severity[..., None], scale[chosen], offset[chosen])
    parameters = healthy * factor + shift
    low = [spec.low for spec in specs]
    high = [spec.high for spec in specs]
    return np.clip(parameters, low, high)


@cache
def _quantiles() -> np.ndarray:
    """Evenly spaced points of the unit cube of class, severity and every plant parameter."""
    sequence = qmc.Sobol(2 + N_PLANT, scramble=False)
    return sequence.random(N_VEHICLES) + 0.5 / N_VEHICLES


def _effects() -> tuple[np.ndarray, np.ndarray]:
    """Factor and shift of each plant parameter at severity 1 by known class, (n_known, N_PLANT)."""
    diagnoses = [fault.diagnosis for fault in CATALOGUE.values()]
    rows = [diagnoses.index(name) for name in fault_classes()]
    effects = matrices()
    scale = np.ones((len(known_classes()), N_PLANT))
    offset = np.zeros_like(scale)
    scale[1:] = effects.scale[rows, :N_PLANT]
    offset[1:] = effects.offset[rows, :N_PLANT]
    return scale, offset
