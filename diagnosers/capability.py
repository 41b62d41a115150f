"""What a vehicle can still do: the speeds it can hold and what they cost, from the steady state of the plant.

A belief is a mixture over fault classes, severities and the healthy band. It is met by `N_DRAWS`
possible vehicles for each lane, the same quantiles of it at every call, so that the figures move
only when the belief does.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.special import ndtri
from scipy.stats import qmc

from auv_fault_env.channels import CHANNELS
from auv_fault_env.compiling import kernel, scalar
from auv_fault_env.errors import refusal
from auv_fault_env.faults import CATALOGUE, classes, fault_effect, matrices
from auv_fault_env.parameters import HULL, PARAMETERS, SHAFT, SIDES, Vehicle, nominal
from auv_fault_env.physics import (
    armature_current,
    equilibrium_shaft_speed,
    equilibrium_voltage,
    motor,
    plant_constants,
    shaft_acceleration,
    shaft_at,
    surge_acceleration,
)
from diagnosers.diagnoser import Belief

N_DRAWS = 128  # a power of two: then every quantity alone is drawn at evenly spaced quantiles
PLANT = len(HULL) + len(SIDES) * len(SHAFT)  # the first of `PARAMETERS`, without the sensors'
ALPHA = 0
PORT = len(HULL)
STARBOARD = len(HULL) + len(SHAFT)
TOP_SPEED = CHANNELS["speed"].high  # m/s, beyond which no reachable speed is sought
HALVINGS = 20
# m/s^2 and rad/s^2: what rounding leaves of a balance
BALANCE = 1e-9
SPIN_BALANCE = 1e-6


class Capability(NamedTuple):
    """What each possible vehicle can do.

    reachable_speed (n_lanes, n_draws): largest speed through the water that it holds [m/s]. power
    and current (n_lanes, n_draws, n_speeds): electrical power of both motors [W], infinite at a
    speed that it cannot hold, and current of the motor that draws more [A].
    """

    reachable_speed: np.ndarray
    power: np.ndarray
    current: np.ndarray


@scalar
def _turned(shaft, spin, speed, constants):
    """Power [W], current [A] and `Motor` of a shaft held at a speed, and whether the supply suffices for it."""
    voltage = equilibrium_voltage(shaft, spin, speed, constants)
    current = armature_current(shaft, spin, voltage)
    side = motor(shaft, constants, voltage)
    return voltage * current, current, side, shaft_acceleration(spin, speed, side) > -SPIN_BALANCE


@scalar
def _steady(speed, alpha, port, starboard, constants):
    """Power [W] and larger current [A] at a held speed, both shafts at the same speed as the controllers have them."""
    spin = equilibrium_shaft_speed(alpha, port.beta + starboard.beta, speed, constants)
    left, left_current, left_side, left_turns = _turned(port, spin, speed, constants)
    right, right_current, right_side, right_turns = _turned(starboard, spin, speed, constants)
    force = surge_acceleration(speed, spin, spin, alpha, 0.0, left_side, right_side)
    held = left_turns and right_turns and force > -BALANCE
    return left + right if held else np.inf, max(left_current, right_current)


@kernel
def _fill(parameters, speeds, constants, reachable, power, current):
    """Fill in a `Capability`; parameters (n_lanes, n_draws, PLANT), speeds (n_lanes, n_speeds)."""
    for lane in range(parameters.shape[0]):
        for draw in range(parameters.shape[1]):
            own = parameters[lane, draw]
            alpha = own[ALPHA]
            port = shaft_at(own, PORT, 1)
            starboard = shaft_at(own, STARBOARD, 1)
            for k in range(speeds.shape[1]):
                found = _steady(speeds[lane, k], alpha, port, starboard, constants)
                power[lane, draw, k], current[lane, draw, k] = found
            low = 0.0
            high = TOP_SPEED
            for _ in range(HALVINGS):
                middle = 0.5 * (low + high)
                holds = _steady(middle, alpha, port, starboard, constants)[0] < np.inf
                low, high = (middle, high) if holds else (low, middle)
            reachable[lane, draw] = low


def capability(parameters: np.ndarray, speeds: np.ndarray, vehicle: Vehicle) -> Capability:
    """What vehicles can do at these speeds [m/s] through the water, (n_lanes, n_speeds).

    Steady motion with the rudders amidships. Misleads in a turn and in waves; and where one shaft
    alone reaches its limit: with unequal shafts the vehicle would be a little faster.

    Parameters
    ----------
    parameters
        Of the possible vehicles of each lane, (n_lanes, n_draws, PLANT), as `sample_parameters` gives them.
    speeds
        Speeds (n_lanes, n_speeds).
    vehicle
        The nominal one, for water, supply and largest shaft speed.
    """
    n_lanes, n_draws, _ = parameters.shape
    shape = n_lanes, n_draws, speeds.shape[1]
    able = Capability(np.empty(shape[:2]), np.empty(shape), np.empty(shape))
    constants = plant_constants(vehicle)
    _fill(
        np.ascontiguousarray(parameters), np.ascontiguousarray(speeds, np.float64), constants, *able
    )
    return able


def sample_parameters(belief: Belief, vehicle: Vehicle, shafts: int = 2) -> np.ndarray:
    """Plant parameters of the possible vehicles of each lane, (n_lanes, n_draws, PLANT), all equally likely.

    Class and severity are drawn from the belief (severity as a normal distribution within 0 and 1),
    and the healthy vehicle from its band. A vehicle with one shaft is a pair of sides that are
    alike, of which only port is known.
    """
    probability = np.exp(belief.log_probability)
    mean = belief.severity_mean
    std = belief.severity_std
    if probability.shape[1] != len(classes()):
        allowed = f"{len(classes())}, those of auv_fault_env.classes()"
        raise refusal(
            "classes of the belief", probability.shape[1], allowed, "give a belief over all of them"
        )
    points = _points()
    edges = probability.cumsum(axis=1)[:, None, :-1]
    chosen = (points[:, 0, None] > edges).sum(axis=2)
    of_class = np.take_along_axis(mean, chosen, 1) + np.take_along_axis(std, chosen, 1) * ndtri(
        points[:, 1]
    )
    severity = np.clip(of_class, 0.0, 1.0)[..., None]
    scale, offset = _effects(shafts)
    specs = list(PARAMETERS.values())[:PLANT]
    band = np.array([spec.band for spec in specs]) * (2.0 * points[:, 2:] - 1.0)
    healthy = np.array(list(nominal(vehicle).values())[:PLANT]) * (1.0 + band)
    factor, shift = fault_effect(severity, scale[chosen], offset[chosen])
    values = healthy * factor + shift
    return np.clip(values, [spec.low for spec in specs], [spec.high for spec in specs])


@cache
def _points() -> np.ndarray:
    """Evenly spread points (n_draws, 2 + PLANT) of the unit cube: for class, severity and every plant parameter."""
    return qmc.Sobol(2 + PLANT, scramble=False).random(N_DRAWS) + 0.5 / N_DRAWS


def _effects(shafts: int) -> tuple[np.ndarray, np.ndarray]:
    """Factor and shift of each plant parameter at severity 1 by class, (n_classes, PLANT)."""
    diagnoses = [fault.diagnosis for fault in CATALOGUE.values()]
    table = matrices()
    rows = [diagnoses.index(name) for name in classes()[1:]]
    scale = np.concatenate([np.ones((1, PLANT)), table.scale[rows, :PLANT]])
    offset = np.concatenate([np.zeros((1, PLANT)), table.offset[rows, :PLANT]])
    if shafts == 1:
        for effect in (scale, offset):
            effect[:, STARBOARD:] = effect[:, PORT:STARBOARD]
    return scale, offset
