"""Residuals of one sample: errors of Ohm's law, of the torque balance and of the surge equation.

They follow from the nominal vehicle, the readings of the sample and the shaft speeds of the sample
before. A healthy residual is not zero but lies within the healthy band.
"""

from dataclasses import fields, replace
from functools import cache
from math import exp
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.compiling import kernel, scalar
from auv_fault_env.errors import refusal
from auv_fault_env.parameters import SAMPLE_TIME, SIDES, Vehicle
from auv_fault_env.physics import (
    RPM,
    Shaft,
    armature_current,
    clipped,
    motor,
    nominal_shaft,
    shaft_acceleration,
    surge_acceleration,
)

RESIDUALS = (
    *(f"{side}_{kind}" for side in SIDES for kind in ("voltage", "torque")),
    "surge",
)
_INPUTS = (
    "rudder",
    "stern_plane",
    "speed",
    "acceleration",
    "port_voltage",
    "starboard_voltage",
)
_COLUMNS = tuple(map(INDEX.get, _INPUTS))
_SENSORS = ("speed", "acceleration", "port_voltage", "port_current")
# standard deviations of a shaft speed reading, below which a shaft counts as standing
STANDSTILL = 5.0


class Residuals(NamedTuple):
    """Residuals and their standard deviations by sensor noise, (n_lanes, 5), as in `RESIDUALS`.

    Units: V, N m and m/s^2. The standard deviation leaves out the disturbance (in ``surge``) and
    the healthy band: divide by it for sensitivity, not for a test of health.
    """

    values: np.ndarray
    std: np.ndarray


class Plant(NamedTuple):
    """Constants of the nominal vehicle and its sensors for the kernel, in SI units.

    shaft_speed_rate [1/s]: rate of change of a shaft speed at the end of a sample by its change
    over the sample.
    """

    density: float
    diameter: float
    wake_fraction: float
    alpha: float
    gamma: float
    shaft_speed_rate: float
    speed_variance: float
    acceleration_variance: float
    voltage_variance: float
    current_variance: float
    shaft_speed_variance: float


@cache
def plant_of(vehicle: Vehicle) -> tuple[Plant, Shaft]:
    """The nominal plant, and one of its two equal shafts.

    The voltage is held over a sample T, so a shaft settles exponentially with the motor's time
    constant tau; its speed changes at the end by ``1/(tau (exp(T/tau) - 1))`` of the change over
    the sample: 0.3/s on the NPS AUV II, where the chord's 1/T would be 10/s.
    """
    damping = vehicle.torque_constant**2 / vehicle.resistance + vehicle.viscous_friction
    rate = damping / vehicle.inertia
    decay = exp(-rate * SAMPLE_TIME)
    plant = Plant(
        vehicle.density,
        vehicle.diameter,
        vehicle.wake_fraction,
        vehicle.alpha,
        vehicle.gamma,
        rate * decay / (1.0 - decay),
        *(CHANNELS[name].noise ** 2 for name in _SENSORS),
        (CHANNELS["port_rpm"].noise / RPM) ** 2,
    )
    return plant, nominal_shaft(vehicle)


@scalar
def _torque(current, shaft_speed, speed, change, side, shaft, plant):
    """Torque [N m] that the balance of one shaft leaves unexplained, and its variance.

    The current takes the place of the voltage that would drive it. Friction holds a standing shaft
    with up to its torque.
    """
    flux = shaft.torque_constant
    inertia = shaft.inertia
    drive = flux * current
    at_rest = drive - clipped(drive, -shaft.coulomb_friction, shaft.coulomb_friction)
    is_standing = abs(shaft_speed) < STANDSTILL * plant.shaft_speed_variance**0.5
    acceleration = shaft_acceleration(shaft_speed, speed, side)
    moving = inertia * (acceleration - plant.shaft_speed_rate * change)
    by_previous = inertia * plant.shaft_speed_rate
    slope = side.damping - side.coupling * speed + 2.0 * side.load * shaft_speed
    by_shaft_speed = inertia * slope - flux * flux / shaft.resistance
    by_shaft_speed += by_previous
    by_speed = inertia * side.coupling * shaft_speed
    variance = flux * flux * plant.current_variance + by_speed * by_speed * plant.speed_variance
    of_shaft_speeds = by_shaft_speed * by_shaft_speed + by_previous * by_previous
    variance += of_shaft_speeds * plant.shaft_speed_variance
    return at_rest if is_standing else moving, variance


@scalar
def _shaft(previous_row, row, first, speed, plant, shaft, values, std, k):
    """Write both residuals of the shaft whose voltage is channel `first`; its `Motor` and speed."""
    voltage = row[first]
    current = row[first + 1]
    shaft_speed = row[first + 2] / RPM
    side = motor(shaft, plant, shaft.resistance * current + shaft.torque_constant * shaft_speed)
    values[k] = shaft.resistance * (armature_current(shaft, shaft_speed, voltage) - current)
    variance = plant.voltage_variance + shaft.resistance**2 * plant.current_variance
    std[k] = (variance + shaft.torque_constant**2 * plant.shaft_speed_variance) ** 0.5
    change = shaft_speed - previous_row[first + 2] / RPM
    values[k + 1], variance = _torque(current, shaft_speed, speed, change, side, shaft, plant)
    std[k + 1] = variance**0.5
    return side, shaft_speed


@kernel
def _residuals(previous, observation, plant, shaft, columns, values, std):
    """All residuals of all lanes; columns are those of `_INPUTS`."""
    rudder, plane, speed, acceleration, port, starboard = columns
    for lane in range(len(observation)):
        last = previous[lane]
        row = observation[lane]
        u = row[speed]
        out = values[lane]
        noise = std[lane]
        port_motor, port_speed = _shaft(last, row, port, u, plant, shaft, out, noise, 0)
        starboard_motor, starboard_speed = _shaft(
            last, row, starboard, u, plant, shaft, out, noise, 2
        )
        drag = plant.alpha + plant.gamma * (row[rudder] ** 2 + row[plane] ** 2)
        force = surge_acceleration(
            u, port_speed, starboard_speed, drag, 0.0, port_motor, starboard_motor
        )
        out[4] = row[acceleration] - force
        by_port = 2.0 * port_motor.thrust * port_speed
        by_starboard = 2.0 * starboard_motor.thrust * starboard_speed
        variance = plant.acceleration_variance + (2.0 * drag * u) ** 2 * plant.speed_variance
        variance += by_port**2 * plant.shaft_speed_variance
        noise[4] = (variance + by_starboard**2 * plant.shaft_speed_variance) ** 0.5


def residuals(previous: np.ndarray, observation: np.ndarray, vehicle: Vehicle) -> Residuals:
    """The residuals of a sample.

    * voltage [V], per shaft: ``V - R i - K w``;
    * torque [N m], per shaft: ``K i - Q(w, u) - b w - tau_c - J dw/dt`` at the sample's end; at
      standstill 0 as long as friction can hold the shaft, else the excess;
    * surge [m/s^2]: ``a - ((alpha + gamma delta^2) u|u| + beta_p n_p^2 + beta_s n_s^2)``.

    `previous` is the observation (n_lanes, n_channels) one sample before, at the first sample the
    observation itself; both finite. `vehicle` is the nominal one.

    Misleads: a repeated or dropped reading disturbs every residual that depends on it, and at rest
    the residuals do not depend on propeller and friction.
    """
    previous = np.ascontiguousarray(previous, np.float64)
    observation = np.ascontiguousarray(observation, np.float64)
    shape = (len(observation), len(CHANNELS))
    if observation.shape != shape or previous.shape != shape:
        shapes = f"{previous.shape} and {observation.shape}"
        allowed = f"(n_lanes, {len(CHANNELS)}) twice"
        raise refusal("shapes of observations", shapes, allowed, "give one row per lane")
    values, std = np.empty((2, len(observation), len(RESIDUALS)))
    _residuals(previous, observation, *plant_of(vehicle), _COLUMNS, values, std)
    return Residuals(values, std)


@cache
def edge_vehicles(vehicle: Vehicle) -> tuple[Vehicle, ...]:
    """The vehicles at the edge of the healthy band, one for each parameter that varies."""
    bands = {spec.name: spec.metadata["band"] for spec in fields(Vehicle) if spec.metadata}
    edges = {name: getattr(vehicle, name) * (1.0 + band) for name, band in bands.items()}
    changed = {name: edge for name, edge in edges.items() if edge != getattr(vehicle, name)}
    return tuple(replace(vehicle, **{name: edge}) for name, edge in changed.items())


def healthy_band(previous: np.ndarray, observation: np.ndarray, vehicle: Vehicle) -> np.ndarray:
    """The largest healthy shift of each residual, (n_lanes, 5): the sum over the parameters."""
    values = residuals(previous, observation, vehicle).values
    at_edges = (residuals(previous, observation, edge).values for edge in edge_vehicles(vehicle))
    return sum(np.abs(at_edge - values) for at_edge in at_edges)
