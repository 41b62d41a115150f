"""Physical residuals of one sample: what Ohm's law, the torque balance and the surge equation leave unexplained.

All from the nominal vehicle and the readings of the sample; no memory but the shaft speeds of the
sample before. A healthy residual is not zero but lies within what the healthy band allows (5 % of
the drag, 10 % of the friction ...).
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

RESIDUALS = (*(f"{side}_{kind}" for side in SIDES for kind in ("voltage", "torque")), "surge")
# times the standard deviation of a shaft speed reading: below, the shaft is taken to stand
STANDSTILL = 5.0


class Residuals(NamedTuple):
    """Residuals and the standard deviation that sensor noise gives each, (n_lanes, 5): `RESIDUALS`, V, N m and m/s^2.

    The standard deviation misses the disturbance (in ``surge``) and the healthy band: divide by it
    for sensitivity, not for a test of health.
    """

    values: np.ndarray
    std: np.ndarray


class Plant(NamedTuple):
    """What the compiled code gets of the nominal vehicle and its sensors: SI units, variances of single readings.

    ``settling`` [1/s]: rate of change of a shaft speed at the end of a sample by its change over
    the sample.
    """

    density: float
    diameter: float
    wake_fraction: float
    alpha: float
    gamma: float
    settling: float
    speed_variance: float
    acceleration_variance: float
    voltage_variance: float
    current_variance: float
    spin_variance: float


@cache
def plant_of(vehicle: Vehicle) -> tuple[Plant, Shaft]:
    """The nominal plant, and one of its two equal shafts.

    The voltage is held over a sample T, so a shaft settles exponentially with the motor's time
    constant tau; its speed changes at the end by ``1/(tau (exp(T/tau) - 1))`` of the change over
    the sample: 0.3/s on the NPS AUV II, where the chord's 1/T would be 10/s.
    """
    shaft = nominal_shaft(vehicle)
    rate = (
        vehicle.torque_constant**2 / vehicle.resistance + vehicle.viscous_friction
    ) / vehicle.inertia
    decay = exp(-rate * SAMPLE_TIME)
    water = (vehicle.density, vehicle.diameter, vehicle.wake_fraction)
    noise = [
        CHANNELS[name].noise ** 2
        for name in ("speed", "acceleration", "port_voltage", "port_current")
    ]
    spin_variance = (CHANNELS["port_rpm"].noise / RPM) ** 2
    settling = rate * decay / (1.0 - decay)
    return Plant(*water, vehicle.alpha, vehicle.gamma, settling, *noise, spin_variance), shaft


@scalar
def _torque(current, spin, speed, change, side, shaft, plant):
    """Torque [N m] that the balance of one shaft leaves unexplained, and its variance.

    The current stands in as the voltage that would drive it. Friction holds a standing shaft with
    up to its torque.
    """
    flux = shaft.torque_constant
    inertia = shaft.inertia
    drive = flux * current
    held = drive - clipped(drive, -shaft.coulomb_friction, shaft.coulomb_friction)
    stands = abs(spin) < STANDSTILL * plant.spin_variance**0.5
    moving = inertia * (shaft_acceleration(spin, speed, side) - plant.settling * change)
    by_previous = inertia * plant.settling
    by_spin = (
        inertia * (side.damping - side.coupling * speed + 2.0 * side.load * spin)
        - flux * flux / shaft.resistance
    )
    by_spin += by_previous
    by_speed = inertia * side.coupling * spin
    variance = flux * flux * plant.current_variance + by_speed * by_speed * plant.speed_variance
    variance += (by_spin * by_spin + by_previous * by_previous) * plant.spin_variance
    return held if stands else moving, variance


@scalar
def _shaft(before, row, first, speed, plant, shaft, values, std, k):
    """Both residuals of the shaft whose voltage is channel `first`; returns its `Motor` and its speed [rad/s]."""
    voltage = row[first]
    current = row[first + 1]
    spin = row[first + 2] / RPM
    side = motor(shaft, plant, shaft.resistance * current + shaft.torque_constant * spin)
    values[k] = shaft.resistance * (armature_current(shaft, spin, voltage) - current)
    variance = plant.voltage_variance + shaft.resistance**2 * plant.current_variance
    std[k] = (variance + shaft.torque_constant**2 * plant.spin_variance) ** 0.5
    change = spin - before[first + 2] / RPM
    values[k + 1], variance = _torque(current, spin, speed, change, side, shaft, plant)
    std[k + 1] = variance**0.5
    return side, spin


@kernel
def _residuals(previous, observation, plant, shaft, columns, values, std):
    """All residuals of all lanes; columns are those of rudder, plane, speed, acceleration and both voltages."""
    rudder, plane, speed, acceleration, port, starboard = columns
    for lane in range(len(observation)):
        before = previous[lane]
        row = observation[lane]
        u = row[speed]
        left, left_spin = _shaft(before, row, port, u, plant, shaft, values[lane], std[lane], 0)
        right, right_spin = _shaft(
            before, row, starboard, u, plant, shaft, values[lane], std[lane], 2
        )
        drag = plant.alpha + plant.gamma * (row[rudder] ** 2 + row[plane] ** 2)
        force = surge_acceleration(u, left_spin, right_spin, drag, 0.0, left, right)
        values[lane, 4] = row[acceleration] - force
        variance = plant.acceleration_variance + (2.0 * drag * u) ** 2 * plant.speed_variance
        variance += (2.0 * left.thrust * left_spin) ** 2 * plant.spin_variance
        std[lane, 4] = (
            variance + (2.0 * right.thrust * right_spin) ** 2 * plant.spin_variance
        ) ** 0.5


_READ = ("rudder", "stern_plane", "speed", "acceleration", "port_voltage", "starboard_voltage")
_COLUMNS = tuple(INDEX[name] for name in _READ)


def residuals(previous: np.ndarray, observation: np.ndarray, vehicle: Vehicle) -> Residuals:
    """The residuals of a sample.

    ========== ======= ============================================================================
    `RESIDUALS` unit    definition
    ========== ======= ============================================================================
    voltage    V       ``V - R i - K w``, per shaft: motor and its three sensors
    torque     N m     ``K i - Q(w, u) - b w - tau_c - J dw/dt`` at the sample's end, per shaft
    surge      m/s^2   ``a - ((alpha + gamma delta^2) u|u| + beta_p n_p^2 + beta_s n_s^2)``
    ========== ======= ============================================================================

    At standstill the torque residual is 0 as long as friction can hold the shaft, else the excess.

    Parameters
    ----------
    previous
        The observation (n_lanes, n_channels) one sample before; at the first sample the observation
        itself.
    observation
        The observation (n_lanes, n_channels), channels as in `CHANNELS`, finite.
    vehicle
        The nominal vehicle.

    Misleads: a reading that is held or dropped upsets every residual that it enters, and at rest
    the residuals say nothing of propeller and friction.
    """
    previous, observation = (np.ascontiguousarray(x, np.float64) for x in (previous, observation))
    if (
        observation.ndim != 2
        or observation.shape[1] != len(CHANNELS)
        or previous.shape != observation.shape
    ):
        got = f"{previous.shape} and {observation.shape}"
        raise refusal(
            "shapes of observations",
            got,
            f"(n_lanes, {len(CHANNELS)}) twice",
            "give one row per lane",
        )
    values = np.empty((len(observation), len(RESIDUALS)))
    std = np.empty((len(observation), len(RESIDUALS)))
    _residuals(previous, observation, *plant_of(vehicle), _COLUMNS, values, std)
    return Residuals(values, std)


@cache
def neighbours(vehicle: Vehicle) -> tuple[Vehicle, ...]:
    """Vehicles at the edge of the healthy band, one for each parameter that varies."""
    bands = {spec.name: spec.metadata["band"] for spec in fields(Vehicle) if spec.metadata}
    edges = {name: getattr(vehicle, name) * (1.0 + band) for name, band in bands.items()}
    return tuple(
        replace(vehicle, **{name: edge})
        for name, edge in edges.items()
        if edge != getattr(vehicle, name)
    )


def healthy_band(previous: np.ndarray, observation: np.ndarray, vehicle: Vehicle) -> np.ndarray:
    """How far the healthy band can shift each residual at this operating point, (n_lanes, 5): the parameters' sum."""
    values = residuals(previous, observation, vehicle).values
    return sum(
        np.abs(residuals(previous, observation, other).values - values)
        for other in neighbours(vehicle)
    )
