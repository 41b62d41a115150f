"""Kalman filters of the surge equation: the thesis' parameter filter, and an EKF with the speed.

Both rest on ``du/dt = alpha u|u| + beta n|n| + gamma u|u| delta^2 + d``; ``n|n|`` is the mean of
both shafts [rpm^2], ``delta^2 = rudder^2 + stern_plane^2``, ``beta`` that of both propellers
together. `ParameterFilter` uses the accelerometer, `SurgeFilter` does not.

``update`` is a pure function; a batch of lanes gives bit for bit what each lane gives alone.
Parameters are relative to nominal, because a covariance in SI units would be singular to working
precision; `physical` converts. Sources: thesis (NPS, June 1992), IV.B; Gelb (ed.), "Applied Optimal
Estimation", MIT Press 1974 (filters, Joseph form).
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

NOISE_FLOOR = 1e-3  # least scale of the sensor noise: keeps variances positive in noise-free runs
DISTURBANCE_FLOOR = 1e-6  # m/s^2, least standard deviation of the disturbance, for the same reason
START_SPEED_STD = 1.0  # m/s, of the speed before the first reading
BETWEEN_STD = 12**-0.5  # of a value anywhere between two readings, per their difference
# of a parameter, relative: keeps the integration stable whatever the readings are
LOW = -9.0
HIGH = 11.0
PARAMETERS = ("alpha", "beta", "gamma")
N_STATES = 5  # speed, the three parameters, and one of each filter's own
U, ALPHA, BETA, GAMMA, OWN = range(N_STATES)
READINGS = (
    "speed",
    "acceleration",
    "port_rpm",
    "starboard_rpm",
    "rudder",
    "stern_plane",
)
SPEED, ACCELERATION, PORT_RPM, STARBOARD_RPM, RUDDER, STERN_PLANE = range(len(READINGS))
COLUMNS = tuple(INDEX[name] for name in READINGS)
CROSS, GAIN, REMAINDER = range(3)  # rows of scratch: P h, K and S K - P h


class Estimate(NamedTuple):
    """The estimate of a filter after an observation; ``filter.states`` names the states.

    Parameters are relative to nominal, speed is in m/s, disturbance in m/s^2. The sum of the log
    likelihoods of a `SurgeFilter` is the evidence of its model.
    """

    mean: np.ndarray  # (n_lanes, n_states)
    covariance: np.ndarray  # (n_lanes, n_states, n_states)
    innovation: np.ndarray  # (n_lanes,), last measurement minus its prediction
    innovation_variance: np.ndarray  # (n_lanes,)
    log_likelihood: np.ndarray  # (n_lanes,), of the last measurement given those before
    last_input: np.ndarray  # (n_lanes,), from which the next update integrates


class FilterConstants(NamedTuple):
    """A configuration for the kernel: SI units and rpm, variances per sample, ``walk`` relative."""

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
    """Share of a sample's first value in the mean over the sample, of a shaft that settles.

    With the sample T and the motor's time constant tau, ``tau/T - 1/(exp(T/tau) - 1)``: 0.19 on the
    NPS AUV II; 1/2, the trapezoid's, for a slow motor.
    """
    stiffness = vehicle.torque_constant**2 / vehicle.resistance + vehicle.viscous_friction
    ratio = vehicle.inertia / stiffness / SAMPLE_TIME
    decay = exp(-1 / ratio)
    return 0.5 if ratio > 1e3 else ratio - decay / (1 - decay)


@scalar
def _dot(left, right):
    total = 0.0
    for i in range(N_STATES):
        total += left[i] * right[i]
    return total


@scalar
def _condition(mean, covariance, gradient, innovation, variance, scratch):
    """Condition one lane on a scalar measurement ``z = h x + v``; return the innovation's variance.

    Joseph form, multiplied out: ``P + S K K^T - K (P h)^T - (P h) K^T``, which rounding of the gain
    K changes in second order only.
    """
    total = variance
    for i in range(N_STATES):
        scratch[CROSS, i] = _dot(covariance[i], gradient)
        total += gradient[i] * scratch[CROSS, i]
    inverse = 1.0 / total
    for i in range(N_STATES):
        cross = scratch[CROSS, i]
        gain = cross * inverse
        mean[i] += gain * innovation
        scratch[GAIN, i] = gain
        scratch[REMAINDER, i] = gain * total - cross
        for j in range(i + 1):
            change = gain * scratch[REMAINDER, j] - cross * scratch[GAIN, j]
            covariance[i, j] += change
            covariance[j, i] = covariance[i, j]
    return total


@scalar
def _walk(mean, covariance, constants):
    """Let the parameters walk over a sample, slower the nearer a variance is to its ceiling."""
    for k in range(len(PARAMETERS)):
        i = ALPHA + k
        mean[i] = min(max(mean[i], LOW), HIGH)
        share = covariance[i, i] / constants.ceiling[k]
        covariance[i, i] += constants.walk[k] * max(0.0, 1.0 - share)


@scalar
def _inputs(readings):
    """Thrust input (mean ``n|n|`` of the shafts), sum of their ``n^2``, squared deflection."""
    port = readings[PORT_RPM]
    starboard = readings[STARBOARD_RPM]
    rudder = readings[RUDDER]
    plane = readings[STERN_PLANE]
    thrust = 0.5 * (port * abs(port) + starboard * abs(starboard))
    squares = port * port + starboard * starboard
    deflection = rudder * rudder + plane * plane
    return thrust, squares, deflection


@scalar
def _condition_on_speed(mean, covariance, readings, constants, gradient, scratch):
    """Condition on the paddle wheel; return innovation and its variance."""
    gradient[:] = 0.0
    gradient[U] = 1.0
    innovation = readings[SPEED] - mean[U]
    variance = constants.speed_variance
    return innovation, _condition(mean, covariance, gradient, innovation, variance, scratch)


@scalar
def _predict_parameters(mean, covariance, last_acceleration, readings, constants):
    """Predict parameters, speed (from measured accelerations less errors) and the new error."""
    c = constants
    _walk(mean, covariance, c)
    opening = c.step * c.opening
    closing = c.step * (1.0 - c.opening)
    mean[U] += opening * (last_acceleration - mean[OWN]) + closing * readings[ACCELERATION]
    mean[OWN] = 0.0
    variance = covariance[U, U] - 2.0 * opening * covariance[U, OWN]
    variance += opening * opening * covariance[OWN, OWN]
    jump = readings[ACCELERATION] - last_acceleration
    # noise alone jumps by sqrt(2) sigma
    unexplained = max(0.0, jump * jump - 9.0 * c.acceleration_variance)
    between = c.step * c.step * BETWEEN_STD**2 * unexplained
    variance += closing * closing * c.acceleration_variance + between
    for i in (ALPHA, BETA, GAMMA):
        with_speed = covariance[i, U] - opening * covariance[i, OWN]
        covariance[i, U] = with_speed
        covariance[U, i] = with_speed
        covariance[i, OWN] = 0.0
        covariance[OWN, i] = 0.0
    covariance[U, U] = variance
    covariance[OWN, OWN] = c.acceleration_variance
    with_error = -closing * c.acceleration_variance
    covariance[OWN, U] = with_error
    covariance[U, OWN] = with_error


@scalar
def _condition_on_acceleration(mean, covariance, readings, constants, gradient, scratch):
    """Condition on the measured acceleration; return innovation and its variance."""
    c = constants
    thrust, squares, deflection = _inputs(readings)
    speed = mean[U]
    square = speed * abs(speed)
    by_rpm = c.beta * mean[BETA]
    drag = c.alpha * mean[ALPHA] + c.gamma * deflection * mean[GAMMA]
    gradient[U] = 2.0 * abs(speed) * drag
    gradient[ALPHA] = c.alpha * square
    gradient[BETA] = c.beta * thrust
    gradient[GAMMA] = c.gamma * square * deflection
    gradient[OWN] = 1.0
    variance = by_rpm * by_rpm * squares * c.rpm_variance
    # white noise of the same density at low frequencies as the disturbance
    memory = c.disturbance_memory
    variance += c.disturbance_variance * (1.0 + memory) / (1.0 - memory)
    innovation = readings[ACCELERATION] - gradient[ALPHA] * mean[ALPHA]
    innovation = innovation - gradient[BETA] * mean[BETA]
    innovation = innovation - gradient[GAMMA] * mean[GAMMA] - mean[OWN]
    return innovation, _condition(mean, covariance, gradient, innovation, variance, scratch)


@scalar
def _integrate(mean, opening_thrust, thrust, deflection, constants, gradient):
    """Advance the mean speed over a sample by the midpoint rule; fill its gradient by the state."""
    c = constants
    drag = c.alpha * mean[ALPHA] + c.gamma * deflection * mean[GAMMA]
    mean_thrust = c.opening * opening_thrust + (1.0 - c.opening) * thrust
    drive = c.beta * mean_thrust
    force = drive * mean[BETA] + mean[OWN]
    half = 0.5 * c.step
    speed = mean[U]
    middle = speed + half * (drag * speed * abs(speed) + force)
    square = middle * abs(middle)
    gain = 1.0 + half * 2.0 * drag * abs(middle)
    of_start = 1.0 + half * 2.0 * drag * abs(speed)
    gradient[U] = 1.0 + c.step * 2.0 * drag * abs(middle) * of_start
    gradient[ALPHA] = c.step * gain * c.alpha * square
    gradient[BETA] = c.step * gain * drive
    gradient[GAMMA] = c.step * gain * c.gamma * deflection * square
    gradient[OWN] = c.step * gain
    mean[U] += c.step * (drag * square + force)


@scalar
def _predict_surge(mean, covariance, last_thrust, readings, constants, gradient, scratch):
    """Predict parameters and disturbance, then speed and covariance over the sample."""
    c = constants
    _walk(mean, covariance, c)
    mean[OWN] *= c.disturbance_memory
    for i in range(N_STATES):
        covariance[i, OWN] *= c.disturbance_memory
        covariance[OWN, i] *= c.disturbance_memory
    joining = 1.0 - c.disturbance_memory * c.disturbance_memory
    covariance[OWN, OWN] += joining * c.disturbance_variance
    thrust, squares, deflection = _inputs(readings)
    by_rpm = c.step * c.beta * mean[BETA]
    jump = thrust - last_thrust
    input_variance = squares * c.rpm_variance + BETWEEN_STD**2 * jump * jump
    variance = by_rpm * by_rpm * input_variance
    _integrate(mean, last_thrust, thrust, deflection, c, gradient)
    for i in range(N_STATES):
        scratch[CROSS, i] = _dot(covariance[i], gradient)
    for i in range(N_STATES):
        variance += gradient[i] * scratch[CROSS, i]
        covariance[i, U] = scratch[CROSS, i]
        covariance[U, i] = scratch[CROSS, i]
    covariance[U, U] = variance


@kernel
def _update_parameters(
    mean,
    covariance,
    innovation,
    variance,
    last_input,
    observation,
    columns,
    constants,
):
    """Update every lane of the parameter filter in place."""
    gradient = np.empty(N_STATES)
    scratch = np.empty((3, N_STATES))
    readings = np.empty(len(columns))
    for lane in range(len(mean)):
        for k in range(len(columns)):
            readings[k] = observation[lane, columns[k]]
        x = mean[lane]
        p = covariance[lane]
        _predict_parameters(x, p, last_input[lane], readings, constants)
        last_input[lane] = readings[ACCELERATION]
        _condition_on_speed(x, p, readings, constants, gradient, scratch)
        innovation[lane], variance[lane] = _condition_on_acceleration(
            x, p, readings, constants, gradient, scratch
        )


@kernel
def _update_surge(
    mean,
    covariance,
    innovation,
    variance,
    last_input,
    observation,
    columns,
    constants,
):
    """Update every lane of the state-and-parameter filter in place."""
    gradient = np.empty(N_STATES)
    scratch = np.empty((3, N_STATES))
    readings = np.empty(len(columns))
    for lane in range(len(mean)):
        for k in range(len(columns)):
            readings[k] = observation[lane, columns[k]]
        x = mean[lane]
        p = covariance[lane]
        _predict_surge(x, p, last_input[lane], readings, constants, gradient, scratch)
        last_input[lane] = _inputs(readings)[0]
        innovation[lane], variance[lane] = _condition_on_speed(
            x, p, readings, constants, gradient, scratch
        )


@dataclass(frozen=True)
class _Filter:
    """Configuration and shape of both filters; they differ in states, start and kernel."""

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
        """The kernel's constants: nominal vehicle, noise variances, random walk and its ceiling."""
        vehicle = self.vehicle
        noise = max(self.sensor_noise, NOISE_FLOOR)
        disturbance_std = max(self.disturbance * vehicle.disturbance_std, DISTURBANCE_FLOOR)
        return FilterConstants(
            step=SAMPLE_TIME,
            opening=opening_share(vehicle),
            alpha=vehicle.alpha,
            beta=vehicle.beta,
            gamma=vehicle.gamma,
            speed_variance=(noise * CHANNELS["speed"].noise) ** 2,
            acceleration_variance=(noise * CHANNELS["acceleration"].noise) ** 2,
            rpm_variance=(noise * CHANNELS["port_rpm"].noise) ** 2,
            disturbance_variance=disturbance_std**2,
            disturbance_memory=exp(-SAMPLE_TIME / vehicle.disturbance_time),
            walk=tuple(SAMPLE_TIME * std**2 for std in self.walk_std),
            ceiling=tuple(std**2 for std in self.prior_std),
        )

    def initial(self, n_lanes: int) -> Estimate:
        """The estimate before any observation: nominal parameters, speed unknown."""
        constants = self.constants
        zeros = np.zeros(n_lanes)
        mean = np.array([0.0, 1.0, 1.0, 1.0, 0.0])
        variances = [
            START_SPEED_STD**2,
            *constants.ceiling,
            constants.disturbance_variance,
        ]
        return Estimate(
            mean=np.tile(mean, (n_lanes, 1)),
            covariance=np.tile(np.diag(variances), (n_lanes, 1, 1)),
            innovation=zeros,
            innovation_variance=np.ones(n_lanes),
            log_likelihood=zeros,
            last_input=zeros,
        )

    def update(self, estimate: Estimate, observation: np.ndarray) -> Estimate:
        """The estimate after the next observation (n_lanes, n_channels), 0.1 s later.

        Raises `ValueError` for another shape and for readings that are not finite. The zeros of a
        disconnected sensor count as measurements.
        """
        observation = checked_observation(observation, len(estimate.mean))
        mean, covariance, innovation, variance, _, last_input = map(np.copy, estimate)
        changed = mean, covariance, innovation, variance, last_input
        self.kernel(*changed, observation, COLUMNS, self.constants)
        misfit = innovation * innovation / variance
        log_likelihood = -0.5 * (np.log(2 * pi * variance) + misfit)
        return Estimate(mean, covariance, innovation, variance, log_likelihood, last_input)

    def physical(self, estimate: Estimate) -> tuple[np.ndarray, np.ndarray]:
        """Mean (n_lanes, n_states) and covariance (n_lanes, n_states, n_states) in SI and rpm.

        Units as in `Vehicle`. Invert the relative covariance, not this one, which spans 14 decades.
        """
        scale = np.array([getattr(self.vehicle, state, 1.0) for state in self.states])
        return estimate.mean * scale, estimate.covariance * np.outer(scale, scale)


def checked_observation(observation: np.ndarray, n_lanes: int) -> np.ndarray:
    """The observation as float64 if it is (n_lanes, n_channels) and finite, else a refusal."""
    observation = np.ascontiguousarray(observation, dtype=np.float64)
    shape = n_lanes, len(CHANNELS)
    if observation.shape != shape:
        remedy = "give one row per lane of the estimate"
        raise refusal("observation's shape", observation.shape, f"{shape}", remedy)
    if not np.isfinite(observation).all():
        remedy = "repeat the last value or give zero"
        raise refusal("observation", "NaN or infinity", "finite readings", remedy)
    return observation


@dataclass(frozen=True)
class ParameterFilter(_Filter):
    """The thesis' parameter filter (IV.B.2): each acceleration is an equation in the parameters.

    ``du/dt = H theta + v``, ``H = [u|u|, n|n|, u|u| delta^2]`` of one instant, theta = (alpha,
    beta, gamma) a random walk. The paddle wheel's noise, squared in H, would bias alpha by several
    percent; so the speed in H is a state too: the integral of the measured acceleration, corrected
    by the paddle wheel. The accelerometer's error enters both the integral and the equation, so it
    is the fifth state.

    When it misleads: at constant speed only beta/alpha is observable, so a drag fault moves both
    until the speed changes; gamma does not move without deflection; a bias b of the accelerometer
    acts like a force and shifts the speed by about 5 s x b; after a jump of a parameter the
    covariance does not show the lag. White noise of the same low-frequency density replaces the
    coloured disturbance: pessimistic for quick changes. Take likelihoods from `SurgeFilter`.

    Attributes
    ----------
    vehicle
        The nominal vehicle.
    sensor_noise, disturbance
        Scales of the standard deviations of `CHANNELS` and vehicle, down to a floor.
    prior_std
        Of (alpha, beta, gamma), relative, at the start; also the ceiling of the random walk, which
        slows down as a variance nears it.
    walk_std
        Random walk per square root of a second, relative. 0.03 follows a jump of 35 % within two
        speed changes.
    """

    states: ClassVar[tuple[str, ...]] = ("speed", *PARAMETERS, "acceleration_error")
    kernel: ClassVar[Callable] = staticmethod(_update_parameters)


@dataclass(frozen=True)
class SurgeFilter(_Filter):
    """Extended Kalman filter of speed, parameters and disturbance, without the accelerometer.

    The surge equation is integrated by the midpoint rule. Thrust is the mean of ``n|n|`` between
    two readings (`opening_share`), uncertain by 0.29 of their difference and by their noise. The
    disturbance is an Ornstein-Uhlenbeck process, constant over a sample. The measurement is the
    paddle wheel. Attributes as in `ParameterFilter`.

    When it misleads: as the parameter filter at constant speed and without deflection. A paddle
    wheel's gain c looks like alpha/c and c beta. After a jump of a parameter, or with a prior far
    above 0.3, its covariance is too small.
    """

    states: ClassVar[tuple[str, ...]] = ("speed", *PARAMETERS, "disturbance")
    kernel: ClassVar[Callable] = staticmethod(_update_surge)
