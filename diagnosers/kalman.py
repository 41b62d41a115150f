"""Kalman filters of the surge equation, batched over lanes: the thesis' parameter filter and an EKF with the speed.

Both rest on ``du/dt = alpha u|u| + beta n|n| + gamma u|u| delta^2 + d``; ``n|n|`` is the mean of
both shafts [rpm^2], ``delta^2 = rudder^2 + stern_plane^2``, ``beta`` that of both propellers
together. `ParameterFilter` reads the accelerometer, each measured acceleration being an equation in
the parameters; `SurgeFilter` does without it.

A filter is a frozen configuration, an `Estimate` an immutable tuple of arrays, ``update`` a pure
function: a batch of lanes gives bit for bit what each lane gives alone. Parameters are estimated
relative to nominal (1 = nominal): ``beta`` is about 1e-7, and a covariance in SI units would be
singular to working precision. `physical` converts. Sources: thesis (NPS, June 1992), IV.B; Gelb
(ed.), "Applied Optimal Estimation", MIT Press 1974 (filters, Joseph form); Bar-Shalom, Li &
Kirubarajan, "Estimation with Applications to Tracking and Navigation", Wiley 2001 (NEES, NIS).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import exp, pi
from typing import ClassVar, NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.compiling import kernel, scalar
from auv_fault_env.errors import finite_in_range, refusal
from auv_fault_env.parameters import PRESETS, SAMPLE_TIME, Vehicle

# least scale of the sensor noise: keeps every variance positive in noise-free runs
NOISE_FLOOR = 1e-3
DISTURBANCE_FLOOR = 1e-6  # m/s^2, least standard deviation of the disturbance, for the same reason
START_SPEED_STD = 1.0  # m/s, what is known of the speed before the first reading
# of a jump between two readings: standard deviation of a mean anywhere between them
BETWEEN_STD = 12**-0.5
# of a parameter from nominal, relative: keeps the integration stable whatever the readings say
LIMIT = 10.0
PARAMETERS = ("alpha", "beta", "gamma")
N_STATES = 5  # speed, the three parameters, and one of each filter's own
READINGS = ("speed", "acceleration", "port_rpm", "starboard_rpm", "rudder", "stern_plane")
COLUMNS = tuple(INDEX[name] for name in READINGS)


class Estimate(NamedTuple):
    """What a filter knows after an observation; n_states and their names are those of ``filter.states``.

    mean (n_lanes, n_states) and covariance (n_lanes, n_states, n_states): parameters relative to
    nominal, speed m/s, disturbance m/s^2. innovation and innovation_variance (n_lanes,): last
    measurement minus its prediction, and its variance, in the measurement's unit. log_likelihood
    (n_lanes,): log density of the last measurement given those before; their sum is a hypothesis'
    evidence where a sample is one measurement (`SurgeFilter`). memory (n_lanes,): the reading that
    the next update integrates from.
    """

    mean: np.ndarray
    covariance: np.ndarray
    innovation: np.ndarray
    innovation_variance: np.ndarray
    log_likelihood: np.ndarray
    memory: np.ndarray


class FilterConstants(NamedTuple):
    """What the compiled code gets of a configuration: SI units and rpm, variances per sample, ``walk`` relative."""

    step: float
    opening: float
    alpha: float
    beta: float
    gamma: float
    speed_variance: float
    acceleration_variance: float
    rpm_variance: float
    disturbance_variance: float
    disturbance_memory: float
    walk: tuple[float, float, float]
    ceiling: tuple[float, float, float]


def opening_share(vehicle: Vehicle) -> float:
    """Share of a sample's first value in the mean over the sample, of a shaft that settles exponentially.

    Voltage is held over the sample T, so thrust starts towards a new value at once, with the
    motor's time constant tau: ``s = tau/T - 1/(exp(T/tau) - 1)``, 0.19 on the NPS AUV II (tau = 19
    ms); 1/2, the trapezoid's, for a slow motor.
    """
    stiffness = vehicle.torque_constant**2 / vehicle.resistance + vehicle.viscous_friction
    ratio = vehicle.inertia / stiffness / SAMPLE_TIME
    decay = exp(-1 / ratio)
    return 0.5 if ratio > 1e3 else ratio - decay / (1 - decay)


@scalar
def _dot(left, right):
    """Scalar product."""
    total = 0.0
    for i in range(N_STATES):
        total += left[i] * right[i]
    return total


@scalar
def _condition(mean, covariance, row, innovation, variance, work):
    """Condition one lane on a scalar measurement ``z = row x + v``; returns the innovation's variance.

    Joseph form ``(I - K h) P (I - K h)^T + K r K^T``, multiplied out: ``P + S K K^T - K (P h)^T -
    (P h) K^T``, which rounding of the gain K changes in second order only; one triangle is computed
    and mirrored.
    """
    total = variance
    for i in range(N_STATES):
        work[0, i] = _dot(covariance[i], row)
        total += row[i] * work[0, i]
    inverse = 1.0 / total
    for i in range(N_STATES):
        crossed = work[0, i]
        gain = crossed * inverse
        mean[i] += gain * innovation
        work[1, i] = gain
        work[2, i] = gain * total - crossed
        for j in range(i + 1):
            covariance[i, j] += gain * work[2, j] - crossed * work[1, j]
            covariance[j, i] = covariance[i, j]
    return total


@scalar
def _walk(mean, covariance, constants):
    """Random walk of the parameters over one sample, slower the nearer a variance is to its ceiling."""
    for i in range(3):
        mean[i + 1] = min(max(mean[i + 1], 1.0 - LIMIT), 1.0 + LIMIT)
        covariance[i + 1, i + 1] += constants.walk[i] * max(
            0.0, 1.0 - covariance[i + 1, i + 1] / constants.ceiling[i]
        )


@scalar
def _inputs(readings):
    """Thrust input (mean ``n|n|`` of the shafts), the sum of the shafts' ``n^2`` and the squared deflection."""
    port = readings[2]
    starboard = readings[3]
    rudder = readings[4]
    plane = readings[5]
    thrust = 0.5 * (port * abs(port) + starboard * abs(starboard))
    return thrust, port * port + starboard * starboard, rudder * rudder + plane * plane


@scalar
def _condition_on_speed(mean, covariance, readings, constants, row, work):
    """Condition on the paddle wheel; returns innovation and its variance."""
    row[:] = 0.0
    row[0] = 1.0
    innovation = readings[0] - mean[0]
    return innovation, _condition(mean, covariance, row, innovation, constants.speed_variance, work)


@scalar
def _predict_parameters(mean, covariance, previous, readings, constants):
    """Let parameters walk, the speed follow the measured accelerations less their errors; draw the new error."""
    c = constants
    _walk(mean, covariance, c)
    opening = c.step * c.opening
    closing = c.step * (1.0 - c.opening)
    mean[0] += opening * (previous - mean[4]) + closing * readings[1]
    mean[4] = 0.0
    variance = (
        covariance[0, 0] - 2.0 * opening * covariance[0, 4] + opening * opening * covariance[4, 4]
    )
    jump = readings[1] - previous
    # noise alone jumps by sqrt(2) sigma
    unexplained = max(0.0, jump * jump - 9.0 * c.acceleration_variance)
    variance += (
        closing * closing * c.acceleration_variance + c.step * c.step * BETWEEN_STD**2 * unexplained
    )
    for i in range(1, 4):
        covariance[0, i] = covariance[i, 0] = covariance[i, 0] - opening * covariance[i, 4]
        covariance[4, i] = covariance[i, 4] = 0.0
    covariance[0, 0] = variance
    covariance[4, 4] = c.acceleration_variance
    covariance[0, 4] = covariance[4, 0] = -closing * c.acceleration_variance


@scalar
def _condition_on_acceleration(mean, covariance, readings, constants, row, work):
    """Condition on the measured acceleration; returns innovation and its variance."""
    c = constants
    thrust, squares, deflection = _inputs(readings)
    drag = mean[0] * abs(mean[0])
    by_rpm = c.beta * mean[2]
    row[0] = 2.0 * abs(mean[0]) * (c.alpha * mean[1] + c.gamma * deflection * mean[3])
    row[1] = c.alpha * drag
    row[2] = c.beta * thrust
    row[3] = c.gamma * drag * deflection
    row[4] = 1.0
    variance = by_rpm * by_rpm * squares * c.rpm_variance
    variance += c.disturbance_variance * (1.0 + c.disturbance_memory) / (1.0 - c.disturbance_memory)
    innovation = readings[1] - row[1] * mean[1] - row[2] * mean[2] - row[3] * mean[3] - mean[4]
    return innovation, _condition(mean, covariance, row, innovation, variance, work)


@scalar
def _integrate(mean, opening_thrust, thrust, deflection, constants, row):
    """Advance the mean speed over one sample by the midpoint rule; ``row`` becomes its gradient by the state."""
    c = constants
    drag = c.alpha * mean[1] + c.gamma * deflection * mean[3]
    drive = c.beta * (c.opening * opening_thrust + (1.0 - c.opening) * thrust)
    push = drive * mean[2] + mean[4]
    half = 0.5 * c.step
    middle = mean[0] + half * (drag * mean[0] * abs(mean[0]) + push)
    square = middle * abs(middle)
    gain = 1.0 + half * 2.0 * drag * abs(middle)
    row[0] = 1.0 + c.step * 2.0 * drag * abs(middle) * (1.0 + half * 2.0 * drag * abs(mean[0]))
    row[1] = c.step * gain * c.alpha * square
    row[2] = c.step * gain * drive
    row[3] = c.step * gain * c.gamma * deflection * square
    row[4] = c.step * gain
    mean[0] += c.step * (drag * square + push)


@scalar
def _predict_surge(mean, covariance, previous, readings, constants, row, work):
    """Draw this sample's parameters and disturbance, then carry speed and covariance over the sample."""
    c = constants
    _walk(mean, covariance, c)
    mean[4] *= c.disturbance_memory
    for i in range(N_STATES):
        covariance[i, 4] *= c.disturbance_memory
        covariance[4, i] *= c.disturbance_memory
    covariance[4, 4] += (1.0 - c.disturbance_memory * c.disturbance_memory) * c.disturbance_variance
    thrust, squares, deflection = _inputs(readings)
    by_rpm = c.step * c.beta * mean[2]
    jump = thrust - previous
    variance = by_rpm * by_rpm * (squares * c.rpm_variance + BETWEEN_STD**2 * jump * jump)
    _integrate(mean, previous, thrust, deflection, c, row)
    for i in range(N_STATES):
        work[0, i] = _dot(covariance[i], row)
    for i in range(N_STATES):
        variance += row[i] * work[0, i]
        covariance[0, i] = covariance[i, 0] = work[0, i]
    covariance[0, 0] = variance


@kernel
def _update_parameters(
    mean, covariance, innovation, variance, memory, observation, columns, constants
):
    """Update every lane of the parameter filter in place."""
    row = np.empty(N_STATES)
    work = np.empty((3, N_STATES))
    readings = np.empty(len(columns))
    for lane in range(len(mean)):
        for k in range(len(columns)):
            readings[k] = observation[lane, columns[k]]
        x = mean[lane]
        p = covariance[lane]
        _predict_parameters(x, p, memory[lane], readings, constants)
        memory[lane] = readings[1]
        _condition_on_speed(x, p, readings, constants, row, work)
        innovation[lane], variance[lane] = _condition_on_acceleration(
            x, p, readings, constants, row, work
        )


@kernel
def _update_surge(mean, covariance, innovation, variance, memory, observation, columns, constants):
    """Update every lane of the state-and-parameter filter in place."""
    row = np.empty(N_STATES)
    work = np.empty((3, N_STATES))
    readings = np.empty(len(columns))
    for lane in range(len(mean)):
        for k in range(len(columns)):
            readings[k] = observation[lane, columns[k]]
        x = mean[lane]
        p = covariance[lane]
        _predict_surge(x, p, memory[lane], readings, constants, row, work)
        memory[lane] = _inputs(readings)[0]
        innovation[lane], variance[lane] = _condition_on_speed(x, p, readings, constants, row, work)


@dataclass(frozen=True)
class _Filter:
    """Configuration and shape of both filters; they differ in states, start and compiled update."""

    vehicle: Vehicle = PRESETS["thesis1992"]
    sensor_noise: float = 1.0
    disturbance: float = 1.0
    prior_std: tuple[float, float, float] = (0.3, 0.3, 0.5)
    walk_std: tuple[float, float, float] = (0.03, 0.03, 0.03)
    states: ClassVar[tuple[str, ...]]
    kernel: ClassVar[Callable]

    def __post_init__(self):
        for name in ("sensor_noise", "disturbance"):
            finite_in_range(name, getattr(self, name), 0.0, 1e3)
        for name, low in (("prior_std", 1e-9), ("walk_std", 0.0)):
            for parameter, value in zip(PARAMETERS, getattr(self, name), strict=True):
                finite_in_range(f"{name} of {parameter}", value, low, 100.0)

    @cached_property
    def constants(self) -> FilterConstants:
        """What the compiled code gets: the nominal vehicle, noise variances, random walk and its ceiling."""
        vehicle = self.vehicle
        noise = max(self.sensor_noise, NOISE_FLOOR)
        variances = [
            (noise * CHANNELS[name].noise) ** 2 for name in ("speed", "acceleration", "port_rpm")
        ]
        disturbance = max(self.disturbance * vehicle.disturbance_std, DISTURBANCE_FLOOR)
        memory = exp(-SAMPLE_TIME / vehicle.disturbance_time)
        walk = tuple(SAMPLE_TIME * std**2 for std in self.walk_std)
        ceiling = tuple(std**2 for std in self.prior_std)
        model = (SAMPLE_TIME, opening_share(vehicle), vehicle.alpha, vehicle.beta, vehicle.gamma)
        return FilterConstants(*model, *variances, disturbance**2, memory, walk, ceiling)

    def initial(self, n_lanes: int) -> Estimate:
        """Start n_lanes lanes before any observation: nominal parameters with ``prior_std``, speed unknown."""
        c = self.constants
        zero = np.zeros(n_lanes)
        mean = np.array([0.0, 1.0, 1.0, 1.0, 0.0])
        covariance = np.diag([START_SPEED_STD**2, *c.ceiling, c.disturbance_variance])
        tiled = np.tile(mean, (n_lanes, 1)), np.tile(covariance, (n_lanes, 1, 1))
        return Estimate(*tiled, zero, np.ones(n_lanes), zero, zero)

    def update(self, estimate: Estimate, observation: np.ndarray) -> Estimate:
        """Return the estimate after the next observation (n_lanes, n_channels), 0.1 s later, channels as in `CHANNELS`.

        Raises `ValueError` if the shape is not the estimate's. A silent channel's zeros count as
        measurements.
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
        mean = estimate.mean.copy()
        covariance = estimate.covariance.copy()
        memory = estimate.memory.copy()
        innovation = np.empty(len(mean))
        variance = np.empty(len(mean))
        self.kernel(
            mean, covariance, innovation, variance, memory, observation, COLUMNS, self.constants
        )
        log_likelihood = -0.5 * (np.log(2 * pi * variance) + innovation * innovation / variance)
        return Estimate(mean, covariance, innovation, variance, log_likelihood, memory)

    def physical(self, estimate: Estimate) -> tuple[np.ndarray, np.ndarray]:
        """Return mean (n_lanes, n_states) and covariance (n_lanes, n_states, n_states) in SI units and rpm.

        Units as in `Vehicle`. Invert the relative covariance, not this one, which spans 14 decades.
        """
        scale = np.array([getattr(self.vehicle, state, 1.0) for state in self.states])
        return estimate.mean * scale, estimate.covariance * np.outer(scale, scale)


@dataclass(frozen=True)
class ParameterFilter(_Filter):
    """The thesis' parameter filter (IV.B.2): each measured acceleration is an equation in (alpha, beta, gamma).

    ``du/dt = H theta + v``, ``H = [u|u|, n|n|, u|u| delta^2]`` of one instant, theta a random walk.
    The paddle wheel's noise, squared in H, would pull alpha towards zero by several percent; so the
    speed in H is a state too: measured acceleration integrated, corrected by the paddle wheel (1.5
    mm/s instead of 1 cm/s; the bias falls below 1 %). The accelerometer's error enters both the
    integral and the equation, so it is the fifth state, drawn anew every sample. The rpm counters'
    noise enters the innovation's variance to first order.

    ``sensor_noise`` and ``disturbance`` scale the standard deviations of `CHANNELS` and vehicle,
    down to a floor. ``prior_std``: of (alpha, beta, gamma), relative, at the start; also the
    ceiling of the random walk, which slows as a variance nears it, so nothing winds up unobserved.
    0.3 makes a fault of 50 % an event of 1.7 sigma. ``walk_std``: random walk per square root of a
    second, relative. 0.03 follows a jump of 35 % within two speed changes and hardly adds to the
    scatter of a healthy estimate.

    When it misleads: at constant speed only beta/alpha is observable, so a drag fault moves both
    until the speed changes; gamma does not move without deflection; a bias b of the accelerometer
    is a force to it and shifts the speed by about 5 s x b; after a jump of a parameter the
    covariance says nothing of the lag. The coloured disturbance is taken as white of the same
    low-frequency density, (1 + rho)/(1 - rho) times its variance: honest for slow changes,
    pessimistic for quick ones, and NIS falls to 0.05. Take likelihoods from `SurgeFilter`.
    """

    states: ClassVar[tuple[str, ...]] = ("speed", *PARAMETERS, "acceleration_error")
    kernel: ClassVar[Callable] = staticmethod(_update_parameters)


@dataclass(frozen=True)
class SurgeFilter(_Filter):
    """Extended Kalman filter of (speed, alpha, beta, gamma, disturbance) from paddle wheel and shaft speeds alone.

    The surge equation is integrated over the sample by the midpoint rule; thrust is the mean of
    ``n|n|`` between the readings that bound the sample (`opening_share`), uncertain by 0.29 of
    their difference and by the counters' noise; d is an Ornstein-Uhlenbeck process held over a
    sample, ``d' = rho d + sqrt(1 - rho^2) std w``. The measurement is the paddle wheel.
    Configuration as in `ParameterFilter`.

    When it misleads: as the parameter filter at constant speed and without deflection. A paddle
    wheel's gain c reads as alpha/c and c beta. After a jump of a parameter, or with a prior far
    above 0.3, its covariance is too small.
    """

    states: ClassVar[tuple[str, ...]] = ("speed", *PARAMETERS, "disturbance")
    kernel: ClassVar[Callable] = staticmethod(_update_surge)
