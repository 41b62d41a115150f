"""Kalman filter of the parameters of both shafts: resistance, torque constant, friction, propeller.

Two equations hold at the end of every sample (`physics`), in parameters relative to nominal::

    i = (f tau_c + q Q(w, u) + b w + J dw/dt) / (k K)       the current for the shaft's load
    V = r R i + k K w                                       Ohm's law

The current in Ohm's law is the one that the load requires: the noise of the measured one, a tenth
of its value at cruise, would bias r. A batch of lanes gives bit for bit what each lane gives alone.

Source: Isermann & Freyermuth, "Process fault diagnosis based on process model knowledge", ASME J.
Dyn. Sys., Meas., Control 113(4), 1991 (parameters of a motor as fault symptoms); filter as in
`kalman`.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np

from auv_fault_env.channels import INDEX
from auv_fault_env.compiling import kernel, scalar
from auv_fault_env.errors import finite_in_range
from auv_fault_env.parameters import PRESETS, SAMPLE_TIME, SIDES, Vehicle
from auv_fault_env.physics import RPM, motor
from diagnosers.kalman import checked_observation
from diagnosers.symptoms.residuals import STANDSTILL, plant_of

PARAMETERS = ("resistance", "torque_constant", "coulomb_friction", "propeller_torque")
N_PARAMETERS = len(PARAMETERS)
RESISTANCE, TORQUE_CONSTANT, COULOMB_FRICTION, PROPELLER_TORQUE = range(N_PARAMETERS)
# of a parameter, relative: keeps currents finite whatever the readings are
LOW = 0.1
HIGH = 5.0
LOW_PROPELLER_TORQUE = -0.2  # relative: below zero for the noise around a lost propeller
SPEED_CHANNEL = INDEX["speed"]
VOLTAGE_CHANNEL = tuple(INDEX[f"{side}_voltage"] for side in SIDES)
VOLTAGE, CURRENT, RPM_READING = range(3)  # channels of a side, from that of the voltage
OF_CURRENT, OF_VOLTAGE = range(2)  # the two measurements, in this order
# rows of scratch: gradient of a prediction by the parameters, its derivatives by shaft speed and by
# speed, covariance with the parameters, correction for the errors in the gradient
GRADIENT, BY_SHAFT_SPEED, BY_SPEED, CROSS, CORRECTION = range(5)


class MotorEstimate(NamedTuple):
    """The estimate after an observation; sides as in `SIDES`, `PARAMETERS` relative to nominal.

    Innovations are those of the last current [A] and voltage [V], each given all before it; of a
    standing shaft zero, with the variance of the sensor.
    """

    mean: np.ndarray  # (n_lanes, 2, 4)
    covariance: np.ndarray  # (n_lanes, 2, 4, 4)
    innovation: np.ndarray  # (n_lanes, 2, 2)
    innovation_variance: np.ndarray  # (n_lanes, 2, 2)
    last_shaft_speed: np.ndarray  # (n_lanes, 2) [rad/s], NaN before the first observation


class Tuning(NamedTuple):
    """A configuration for the kernel."""

    walk: tuple[float, float, float, float]  # what a sample adds to each relative variance
    ceiling: tuple[float, float, float, float]  # of the variances
    noise: float  # factor on the variances of the sensors


class Measurement(NamedTuple):
    """A scalar measurement, and how its prediction depends on the readings in its gradient."""

    innovation: float
    variance: float
    by_shaft_speed: float
    by_speed: float
    shaft_speed_variance: float
    speed_variance: float


@scalar
def _condition(mean, covariance, scratch, measurement):
    """Condition one shaft on a measurement; return the innovation's variance.

    The errors of shaft speed and speed are in gradient and innovation; their product is subtracted
    (bias-compensated least squares: Soederstrom, Automatica 43(6), 2007).
    """
    m = measurement
    of_shaft_speed = m.by_shaft_speed * m.by_shaft_speed * m.shaft_speed_variance
    total = m.variance + of_shaft_speed + m.by_speed * m.by_speed * m.speed_variance
    for i in range(N_PARAMETERS):
        scratch[CROSS, i] = 0.0
        scratch[CORRECTION, i] = 0.0
        for j in range(N_PARAMETERS):
            shared = scratch[BY_SHAFT_SPEED, j] * m.by_shaft_speed * m.shaft_speed_variance
            shared = shared + scratch[BY_SPEED, j] * m.by_speed * m.speed_variance
            scratch[CROSS, i] += covariance[i, j] * scratch[GRADIENT, j]
            scratch[CORRECTION, i] += covariance[i, j] * shared
        total += scratch[GRADIENT, i] * scratch[CROSS, i]
    for i in range(N_PARAMETERS):
        cross = scratch[CROSS, i]
        moved = mean[i] + (cross * m.innovation + scratch[CORRECTION, i]) / total
        low = LOW_PROPELLER_TORQUE if i == PROPELLER_TORQUE else LOW
        mean[i] = min(max(moved, low), HIGH)
        for j in range(i + 1):
            covariance[i, j] -= cross * scratch[CROSS, j] / total
            covariance[j, i] = covariance[i, j]
    return total


@scalar
def _predict_current(mean, shaft_speed, speed, change, shaft, plant, scratch):
    """Current [A] for the shaft's load, its slopes by shaft speed and by speed; fills gradients.

    `change` is that of the shaft speed over the sample.
    """
    side = motor(shaft, plant, 0.0)
    flux = mean[TORQUE_CONSTANT] * shaft.torque_constant
    load = side.load * shaft_speed - side.coupling * speed
    propeller = shaft.inertia * load * shaft_speed / flux
    load_slope = 2.0 * side.load * shaft_speed - side.coupling * speed
    propeller_slope = shaft.inertia * load_slope / flux
    by_speed = -shaft.inertia * side.coupling * shaft_speed / flux
    inertia_rate = shaft.inertia * plant.shaft_speed_rate
    viscous = shaft.viscous_friction * shaft_speed
    torque = mean[COULOMB_FRICTION] * shaft.coulomb_friction + (viscous + inertia_rate * change)
    relative = mean[PROPELLER_TORQUE]
    current = torque / flux + relative * propeller
    slope = relative * propeller_slope + (shaft.viscous_friction + inertia_rate) / flux
    scratch[: BY_SPEED + 1] = 0.0
    scratch[GRADIENT, TORQUE_CONSTANT] = -current / mean[TORQUE_CONSTANT]
    scratch[GRADIENT, COULOMB_FRICTION] = shaft.coulomb_friction / flux
    scratch[GRADIENT, PROPELLER_TORQUE] = propeller
    scratch[BY_SHAFT_SPEED, TORQUE_CONSTANT] = -slope / mean[TORQUE_CONSTANT]
    scratch[BY_SHAFT_SPEED, PROPELLER_TORQUE] = propeller_slope
    scratch[BY_SPEED, TORQUE_CONSTANT] = -relative * by_speed / mean[TORQUE_CONSTANT]
    scratch[BY_SPEED, PROPELLER_TORQUE] = by_speed
    return current, slope, relative * by_speed


@scalar
def _update_shaft(
    mean,
    covariance,
    readings,
    speed,
    change,
    shaft,
    plant,
    noise,
    innovation,
    variance,
    scratch,
):
    """Condition one moving shaft on its current and on its voltage."""
    shaft_speed = readings[RPM_READING] / RPM
    shaft_speed_variance = noise * plant.shaft_speed_variance
    speed_variance = noise * plant.speed_variance
    current, current_slope, current_by_speed = _predict_current(
        mean, shaft_speed, speed, change, shaft, plant, scratch
    )
    innovation[OF_CURRENT] = readings[CURRENT] - current
    measurement = Measurement(
        innovation[OF_CURRENT],
        noise * plant.current_variance,
        current_slope,
        current_by_speed,
        shaft_speed_variance,
        speed_variance,
    )
    variance[OF_CURRENT] = _condition(mean, covariance, scratch, measurement)
    current, current_slope, current_by_speed = _predict_current(
        mean, shaft_speed, speed, change, shaft, plant, scratch
    )
    resistance = mean[RESISTANCE] * shaft.resistance
    flux = mean[TORQUE_CONSTANT] * shaft.torque_constant
    scratch[: BY_SPEED + 1] *= resistance
    scratch[GRADIENT, RESISTANCE] = shaft.resistance * current
    scratch[GRADIENT, TORQUE_CONSTANT] += shaft.torque_constant * shaft_speed
    scratch[BY_SHAFT_SPEED, RESISTANCE] = shaft.resistance * current_slope
    scratch[BY_SHAFT_SPEED, TORQUE_CONSTANT] += shaft.torque_constant
    scratch[BY_SPEED, RESISTANCE] = shaft.resistance * current_by_speed
    innovation[OF_VOLTAGE] = readings[VOLTAGE] - resistance * current - flux * shaft_speed
    measurement = Measurement(
        innovation[OF_VOLTAGE],
        noise * plant.voltage_variance,
        flux + resistance * current_slope,
        resistance * current_by_speed,
        shaft_speed_variance,
        speed_variance,
    )
    variance[OF_VOLTAGE] = _condition(mean, covariance, scratch, measurement)


@kernel
def _update(
    mean,
    covariance,
    innovation,
    variance,
    last_shaft_speed,
    observation,
    shaft,
    plant,
    tuning,
):
    """Update every shaft of every lane in place."""
    scratch = np.empty((5, N_PARAMETERS))
    for lane in range(len(mean)):
        speed = observation[lane, SPEED_CHANNEL]
        for side in range(2):
            x = mean[lane, side]
            p = covariance[lane, side]
            readings = observation[lane, VOLTAGE_CHANNEL[side] :]
            for i in range(N_PARAMETERS):
                share = p[i, i] / tuning.ceiling[i]
                p[i, i] += tuning.walk[i] * max(0.0, 1.0 - share)
            shaft_speed = readings[RPM_READING] / RPM
            last = last_shaft_speed[lane, side]
            change = 0.0 if np.isnan(last) else shaft_speed - last
            last_shaft_speed[lane, side] = shaft_speed
            e = innovation[lane, side]
            s = variance[lane, side]
            e[:] = 0.0
            s[OF_CURRENT] = tuning.noise * plant.current_variance
            s[OF_VOLTAGE] = tuning.noise * plant.voltage_variance
            if shaft_speed > STANDSTILL * plant.shaft_speed_variance**0.5:
                noise = tuning.noise
                _update_shaft(x, p, readings, speed, change, shaft, plant, noise, e, s, scratch)


@dataclass(frozen=True)
class MotorFilter:
    """Extended Kalman filter of `PARAMETERS` of both shafts from voltage, current, rpm and speed.

    When it misleads: at constant speed only total load and voltage are observable, so a fault moves
    both friction and propeller torque, or both resistance and torque constant, until the speed
    changes; resistance then falls by some percent in a minute. A wrong reading appears as
    parameters (a current sensor's gain as torque constant and load). A standing shaft changes
    nothing. The healthy band is in the estimates: a healthy friction is 0.9 to 1.1.

    Attributes
    ----------
    vehicle
        The nominal vehicle.
    sensor_noise
        Scale of the standard deviations of `CHANNELS`.
    prior_std
        Of each parameter at the start, relative, and ceiling of the random walk, which slows down
        as a variance nears it.
    walk_std
        Random walk per square root of a second, relative.
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
        """The configuration for the kernel."""
        walk = tuple(SAMPLE_TIME * std**2 for std in self.walk_std)
        ceiling = tuple(std**2 for std in self.prior_std)
        return Tuning(walk, ceiling, self.sensor_noise**2)

    def initial(self, n_lanes: int) -> MotorEstimate:
        """The estimate before any observation: nominal parameters with ``prior_std``."""
        return MotorEstimate(
            mean=np.ones((n_lanes, 2, N_PARAMETERS)),
            covariance=np.tile(np.diag(self.tuning.ceiling), (n_lanes, 2, 1, 1)),
            innovation=np.zeros((n_lanes, 2, 2)),
            innovation_variance=np.ones((n_lanes, 2, 2)),
            last_shaft_speed=np.full((n_lanes, 2), np.nan),
        )

    def update(self, estimate: MotorEstimate, observation: np.ndarray) -> MotorEstimate:
        """The estimate after the next observation (n_lanes, n_channels), 0.1 s later.

        Raises `ValueError` for another shape and for readings that are not finite.
        """
        observation = checked_observation(observation, len(estimate.mean))
        after = MotorEstimate(*(values.copy() for values in estimate))
        plant, shaft = plant_of(self.vehicle)
        _update(*after, observation, shaft, plant, self.tuning)
        return after
