"""Kalman filter of what makes up a shaft: resistance, torque constant, friction and propeller torque of both sides.

Two equations hold at the end of every sample (`physics`), in parameters relative to nominal (1 = nominal)::

    i = (f tau_c + q Q(w, u) + b w + J dw/dt) / (k K)       the current that carries the shaft's load
    V = r R i + k K w                                       Ohm's law

The measured current never enters a gradient: as a regressor its noise, a tenth of its value at
cruise, would pull r towards zero within seconds. The current in Ohm's law is therefore the one that
the load asks for. A batch of lanes gives bit for bit what each lane gives alone.

Source: Isermann & Freyermuth, "Process fault diagnosis based on process model knowledge", ASME J.
Dyn. Sys., Meas., Control 113(4), 1991 (parameters of a motor as fault symptoms); filter as in
`kalman`.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.compiling import kernel, scalar
from auv_fault_env.errors import finite_in_range, refusal
from auv_fault_env.parameters import PRESETS, SAMPLE_TIME, SIDES, Vehicle
from auv_fault_env.physics import RPM, motor
from diagnosers.symptoms.residuals import STANDSTILL, plant_of

PARAMETERS = ("resistance", "torque_constant", "coulomb_friction", "propeller_torque")
N = len(PARAMETERS)
PROPELLER = PARAMETERS.index("propeller_torque")
# of a parameter, relative: keeps currents finite whatever the readings say
LOW = 0.1
HIGH = 5.0
LOSS = -0.2  # least propeller torque, relative: below zero for the noise around a lost propeller
SPEED = INDEX["speed"]
FIRST = tuple(INDEX[f"{side}_voltage"] for side in SIDES)  # then current and rpm


class MotorEstimate(NamedTuple):
    """What the filter knows after an observation; sides as in `SIDES`, parameters as in `PARAMETERS`.

    mean (n_lanes, 2, 4) and covariance (n_lanes, 2, 4, 4): parameters relative to nominal.
    innovation and innovation_variance (n_lanes, 2, 2): of the last current [A] and voltage [V],
    each given all before it; zero, and that of the sensor, where the shaft stands, because then
    nothing is learnt. memory (n_lanes, 2): last shaft speeds [rad/s], NaN before the first
    observation.
    """

    mean: np.ndarray
    covariance: np.ndarray
    innovation: np.ndarray
    innovation_variance: np.ndarray
    memory: np.ndarray


class Tuning(NamedTuple):
    """Random walk per sample and ceiling of each parameter's variance, relative; factor on the sensors' variances."""

    walk: tuple[float, float, float, float]
    ceiling: tuple[float, float, float, float]
    noise: float


@scalar
def _condition(
    mean, covariance, work, innovation, by_spin, by_speed, variance, spin_variance, speed_variance
):
    """Condition one shaft on a scalar measurement; returns the innovation's variance.

    ``work`` holds the gradient by the parameters, its derivatives by shaft speed and speed, and
    scratch. The errors of these two readings are in gradient and innovation alike, and their
    product does not average out: it is subtracted (bias-compensated least squares: Soederstrom,
    Automatica 43(6), 2007).
    """
    total = variance + by_spin * by_spin * spin_variance + by_speed * by_speed * speed_variance
    for i in range(N):
        work[3, i] = work[4, i] = 0.0
        for j in range(N):
            shared = work[1, j] * by_spin * spin_variance + work[2, j] * by_speed * speed_variance
            work[3, i] += covariance[i, j] * work[0, j]
            work[4, i] += covariance[i, j] * shared
        total += work[0, i] * work[3, i]
    for i in range(N):
        crossed = work[3, i]
        moved = mean[i] + (crossed * innovation + work[4, i]) / total
        mean[i] = min(max(moved, LOSS if i == PROPELLER else LOW), HIGH)
        for j in range(i + 1):
            covariance[i, j] -= crossed * work[3, j] / total
            covariance[j, i] = covariance[i, j]
    return total


@scalar
def _load(mean, spin, speed, change, shaft, plant, work):
    """Current [A] that the shaft's load asks for and its slopes by shaft speed and speed; fills ``work[:3]``."""
    side = motor(shaft, plant, 0.0)
    flux = mean[1] * shaft.torque_constant
    propeller = shaft.inertia * (side.load * spin - side.coupling * speed) * spin / flux
    by_spin = shaft.inertia * (2.0 * side.load * spin - side.coupling * speed) / flux
    by_speed = -shaft.inertia * side.coupling * spin / flux
    rest = shaft.viscous_friction * spin + shaft.inertia * plant.settling * change
    current = (mean[2] * shaft.coulomb_friction + rest) / flux + mean[3] * propeller
    slope = mean[3] * by_spin + (shaft.viscous_friction + shaft.inertia * plant.settling) / flux
    work[:3] = 0.0
    work[0, 1] = -current / mean[1]
    work[0, 2] = shaft.coulomb_friction / flux
    work[0, 3] = propeller
    work[1, 1] = -slope / mean[1]
    work[1, 3] = by_spin
    work[2, 1] = -mean[3] * by_speed / mean[1]
    work[2, 3] = by_speed
    return current, slope, mean[3] * by_speed


@scalar
def _observe(x, p, readings, speed, change, shaft, plant, noise, innovation, variance, work):
    """Condition one turning shaft on its current and on its voltage."""
    voltage = readings[0]
    current = readings[1]
    spin = readings[2] / RPM
    spin_variance = noise * plant.spin_variance
    speed_variance = noise * plant.speed_variance
    load, by_spin, by_speed = _load(x, spin, speed, change, shaft, plant, work)
    innovation[0] = current - load
    variance[0] = _condition(
        x,
        p,
        work,
        innovation[0],
        by_spin,
        by_speed,
        noise * plant.current_variance,
        spin_variance,
        speed_variance,
    )
    load, by_spin, by_speed = _load(x, spin, speed, change, shaft, plant, work)
    resistance = x[0] * shaft.resistance
    flux = x[1] * shaft.torque_constant
    work[:3] *= resistance
    work[0, 0], work[0, 1] = shaft.resistance * load, work[0, 1] + shaft.torque_constant * spin
    work[1, 0], work[1, 1] = shaft.resistance * by_spin, work[1, 1] + shaft.torque_constant
    work[2, 0] = shaft.resistance * by_speed
    by_spin = flux + resistance * by_spin
    by_speed = resistance * by_speed
    innovation[1] = voltage - resistance * load - flux * spin
    variance[1] = _condition(
        x,
        p,
        work,
        innovation[1],
        by_spin,
        by_speed,
        noise * plant.voltage_variance,
        spin_variance,
        speed_variance,
    )


@kernel
def _update(
    mean, covariance, innovation, variance, memory, observation, first, speed, shaft, plant, tuning
):
    """Update every shaft of every lane in place."""
    work = np.empty((5, N))
    for lane in range(len(mean)):
        for side in range(2):
            x = mean[lane, side]
            p = covariance[lane, side]
            readings = observation[lane, first[side] :]
            for i in range(N):
                p[i, i] += tuning.walk[i] * max(0.0, 1.0 - p[i, i] / tuning.ceiling[i])
            spin = readings[2] / RPM
            change = 0.0 if np.isnan(memory[lane, side]) else spin - memory[lane, side]
            memory[lane, side] = spin
            e = innovation[lane, side]
            s = variance[lane, side]
            e[:] = 0.0
            s[0] = tuning.noise * plant.current_variance
            s[1] = tuning.noise * plant.voltage_variance
            if spin > STANDSTILL * plant.spin_variance**0.5:
                u = observation[lane, speed]
                _observe(x, p, readings, u, change, shaft, plant, tuning.noise, e, s, work)


@dataclass(frozen=True)
class MotorFilter:
    """Extended Kalman filter of `PARAMETERS` of both shafts from voltage, current, rpm and speed.

    ``prior_std``: at the start, relative, and ceiling of the random walk, which slows as a variance
    nears it. ``walk_std``: random walk per square root of a second, relative. ``sensor_noise``
    scales the standard deviations of `CHANNELS`; it needs no floor, because the random walk keeps
    every variance positive.

    When it misleads: at constant speed only total load and voltage are seen, so friction cannot be
    told from propeller torque, nor resistance from torque constant, beyond what the prior says; a
    fault moves both until the speed changes. Resistance then sinks by some percent in a minute, the
    faster the larger the walk of the load. A wrong reading of a sensor reads as parameters (a
    current sensor's gain as torque constant and load). At standstill nothing is learnt. The healthy
    band is in the estimates: a healthy friction is 0.9 to 1.1.
    """

    vehicle: Vehicle = PRESETS["thesis1992"]
    sensor_noise: float = 1.0
    prior_std: tuple[float, float, float, float] = (0.2, 0.1, 0.5, 0.3)
    walk_std: tuple[float, float, float, float] = (0.03, 0.015, 0.05, 0.05)
    states: ClassVar[tuple[str, ...]] = PARAMETERS

    def __post_init__(self):
        finite_in_range("sensor_noise", self.sensor_noise, 1e-3, 1e3)
        for name in ("prior_std", "walk_std"):
            for parameter, value in zip(PARAMETERS, getattr(self, name), strict=True):
                finite_in_range(f"{name} of {parameter}", value, 1e-9, 100.0)

    @cached_property
    def tuning(self) -> Tuning:
        """What the compiled code gets of the configuration."""
        walk = tuple(SAMPLE_TIME * std**2 for std in self.walk_std)
        ceiling = tuple(std**2 for std in self.prior_std)
        return Tuning(walk, ceiling, self.sensor_noise**2)

    def initial(self, n_lanes: int) -> MotorEstimate:
        """Start n_lanes lanes before any observation: nominal parameters with ``prior_std``."""
        mean = np.ones((n_lanes, 2, N))
        covariance = np.tile(np.diag(self.tuning.ceiling), (n_lanes, 2, 1, 1))
        return MotorEstimate(
            mean,
            covariance,
            np.zeros((n_lanes, 2, 2)),
            np.ones((n_lanes, 2, 2)),
            np.full((n_lanes, 2), np.nan),
        )

    def update(self, estimate: MotorEstimate, observation: np.ndarray) -> MotorEstimate:
        """Return the estimate after the next observation (n_lanes, n_channels), 0.1 s later, channels as in `CHANNELS`.

        Raises `ValueError` if the shape is not the estimate's or a reading is not finite.
        """
        observation = np.ascontiguousarray(observation, dtype=np.float64)
        if observation.shape != (shape := (len(estimate.mean), len(CHANNELS))):
            raise refusal(
                "observation's shape",
                observation.shape,
                f"{shape}",
                "give one row per lane of the estimate",
            )
        if not np.isfinite(observation).all():
            raise refusal(
                "observation",
                "NaN or infinity",
                "finite readings",
                "hold the last value or give zero",
            )
        after = MotorEstimate(*(values.copy() for values in estimate))
        plant, shaft = plant_of(self.vehicle)
        _update(*after, observation, FIRST, SPEED, shaft, plant, self.tuning)
        return after
