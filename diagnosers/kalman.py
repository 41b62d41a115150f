"""Kalman filters of the surge equation, batched over lanes: the thesis' parameter filter and a state-and-parameter EKF.

Both work on the surge equation ``du/dt = alpha u|u| + beta n|n| + gamma u|u| delta^2 + d``, where ``n|n|`` is the mean of
the two shafts [rpm^2], ``delta^2 = rudder^2 + stern_plane^2`` and ``beta`` is that of both propellers together.

* `ParameterFilter` reads the accelerometer: each measured acceleration is one equation in the three parameters.
* `SurgeFilter` does without it: the paddle wheel corrects a speed that the equation predicts.

A filter is a frozen configuration; an `Estimate` is an immutable tuple of arrays; ``update`` is a pure function of the
two and of an observation, so a batch of lanes gives bit for bit what each lane gives alone.

Units: a parameter's estimate is relative to its nominal value (1 = nominal), because ``beta`` is about 1e-7 and a
covariance in SI units would be singular to working precision; `physical` converts. Speed is in m/s, d in m/s^2.

Sources
-------
Thesis (NPS, June 1992), IV.B: the parameter filter. Gelb (ed.), "Applied Optimal Estimation", MIT Press 1974, 4.2 and
6.1: the Kalman filter, the Joseph form and the extended filter. Bar-Shalom, Li & Kirubarajan, "Estimation with
Applications to Tracking and Navigation", Wiley 2001, 5.4: NEES and NIS.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import exp, pi
from typing import ClassVar, NamedTuple

import numpy as np
from numba import njit

from auv_fault_env.channels import CHANNELS
from auv_fault_env.errors import finite_in_range, refusal
from auv_fault_env.parameters import PRESETS, SAMPLE_TIME, Vehicle

NOISE_FLOOR = 1e-3  # least scale of the sensor noise: keeps every variance positive in noise-free runs
DISTURBANCE_FLOOR = 1e-6  # m/s^2, least standard deviation of the disturbance, for the same reason
START_SPEED_STD = 1.0  # m/s, what is known of the speed before the first reading
BETWEEN_STD = 12**-0.5  # of a jump between two readings: standard deviation of a mean anywhere between them
PARAMETERS = ("alpha", "beta", "gamma")
COLUMNS = ("speed", "acceleration", "port_rpm", "starboard_rpm", "rudder", "stern_plane")


class Estimate(NamedTuple):
    """What a filter knows after an observation; n_states and their names are those of ``filter.states``.

    mean (n_lanes, n_states) and covariance (n_lanes, n_states, n_states): parameters relative to nominal, speed m/s,
    disturbance m/s^2. innovation and innovation_variance (n_lanes,): last measurement minus its prediction, and its
    variance, in the measurement's unit. log_likelihood (n_lanes,): log density of the last measurement given those
    before; a hypothesis' evidence is their sum. memory (n_lanes, n_memory): what the next update needs besides.
    """

    mean: np.ndarray
    covariance: np.ndarray
    innovation: np.ndarray
    innovation_variance: np.ndarray
    log_likelihood: np.ndarray
    memory: np.ndarray


class Constants(NamedTuple):
    """What the compiled code gets of a configuration: SI units and rpm, variances per sample, ``walk`` relative."""

    step: float
    opening: float
    between: float
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

    The voltage is held over the sample, so shaft speed (and with it thrust and acceleration) jumps towards a new value
    with the motor's time constant ``tau = J R / (K_T^2 + R b)``; the mean over T is ``s`` first plus ``1 - s`` last
    value, ``s = (tau/T)(1 - exp(-T/tau))``. 0.19 on the NPS AUV II; the trapezoid's 1/2 holds for tau far above T.
    """
    stiffness = vehicle.torque_constant**2 / vehicle.resistance + vehicle.viscous_friction
    ratio = vehicle.inertia / (stiffness * SAMPLE_TIME)
    return 0.5 if ratio > 1e3 else ratio * (1 - exp(-1 / ratio))


@njit(cache=True, error_model="numpy", forceinline=True)
def _dot(size, left, right):
    """Scalar product."""
    total = 0.0
    for i in range(size):
        total += left[i] * right[i]
    return total


@njit(cache=True, error_model="numpy", forceinline=True)
def _condition(size, mean, covariance, row, innovation, variance, work):
    """Condition one lane on a scalar measurement ``z = row x + v``; returns the innovation's variance.

    Joseph form ``(I - K h) P (I - K h)^T + K r K^T``, multiplied out: ``P + S K K^T - K (P h)^T - (P h) K^T``, which
    rounding of the gain K changes in second order only; one triangle is computed and mirrored.
    """
    total = variance
    for i in range(size):
        work[0, i] = _dot(size, covariance[i], row)
        total += row[i] * work[0, i]
    inverse = 1.0 / total
    for i in range(size):
        crossed = work[0, i]
        gain = crossed * inverse
        mean[i] += gain * innovation
        work[1, i], work[2, i] = gain, gain * total - crossed
        for j in range(i + 1):
            covariance[i, j] += gain * work[2, j] - crossed * work[1, j]
            covariance[j, i] = covariance[i, j]
    return total


@njit(cache=True, error_model="numpy", forceinline=True)
def _walk(covariance, constants):
    """Random walk of the parameters over one sample, slower the nearer a variance is to its ceiling."""
    for i in range(3):
        used = covariance[i + 1, i + 1] / constants.ceiling[i]
        covariance[i + 1, i + 1] += constants.walk[i] * max(0.0, 1.0 - used)


@njit(cache=True, error_model="numpy", forceinline=True)
def _inputs(readings):
    """Thrust input (mean ``n|n|`` of the shafts), the sum of the shafts' ``n^2`` and the squared deflection."""
    port, starboard, rudder, plane = readings[2], readings[3], readings[4], readings[5]
    thrust = 0.5 * (port * abs(port) + starboard * abs(starboard))
    return thrust, port * port + starboard * starboard, rudder * rudder + plane * plane


@njit(cache=True, error_model="numpy", forceinline=True)
def _condition_on_speed(size, mean, covariance, readings, constants, row, work):
    """Condition on the paddle wheel; returns innovation and its variance."""
    row[:] = 0.0
    row[0] = 1.0
    innovation = readings[0] - mean[0]
    return innovation, _condition(size, mean, covariance, row, innovation, constants.speed_variance, work)


@njit(cache=True, error_model="numpy", forceinline=True)
def _predict_parameters(mean, covariance, memory, readings, constants):
    """Let the parameters walk and the speed follow the measured acceleration."""
    c = constants
    _walk(covariance, c)
    jump = readings[1] - memory[0]
    mean[0] += c.step * (memory[0] + (1.0 - c.opening) * jump)
    covariance[0, 0] += c.step * c.step * (c.acceleration_variance + c.between * jump * jump)
    memory[0] = readings[1]


@njit(cache=True, error_model="numpy", forceinline=True)
def _condition_on_acceleration(mean, covariance, readings, constants, row, work):
    """Condition speed and parameters on the measured acceleration; returns innovation and its variance."""
    c = constants
    thrust, squares, deflection = _inputs(readings)
    drag = mean[0] * abs(mean[0])
    by_rpm = c.beta * mean[2]
    row[0] = 2.0 * abs(mean[0]) * (c.alpha * mean[1] + c.gamma * deflection * mean[3])
    row[1], row[2], row[3] = c.alpha * drag, c.beta * thrust, c.gamma * drag * deflection
    variance = c.acceleration_variance + by_rpm * by_rpm * squares * c.rpm_variance
    variance += c.disturbance_variance * (1.0 + c.disturbance_memory) / (1.0 - c.disturbance_memory)
    innovation = readings[1] - row[1] * mean[1] - row[2] * mean[2] - row[3] * mean[3]
    return innovation, _condition(4, mean, covariance, row, innovation, variance, work)


@njit(cache=True, error_model="numpy", forceinline=True)
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


@njit(cache=True, error_model="numpy", forceinline=True)
def _predict_surge(mean, covariance, memory, readings, constants, row, work):
    """Draw this sample's parameters and disturbance, then carry speed and covariance over the sample."""
    c = constants
    _walk(covariance, c)
    mean[4] *= c.disturbance_memory
    for i in range(5):
        covariance[i, 4] *= c.disturbance_memory
        covariance[4, i] *= c.disturbance_memory
    covariance[4, 4] += (1.0 - c.disturbance_memory * c.disturbance_memory) * c.disturbance_variance
    thrust, squares, deflection = _inputs(readings)
    by_rpm = c.step * c.beta * mean[2]
    jump = thrust - memory[0]
    variance = by_rpm * by_rpm * (squares * c.rpm_variance + c.between * jump * jump)
    _integrate(mean, memory[0], thrust, deflection, c, row)
    memory[0] = thrust
    for i in range(5):
        work[0, i] = _dot(5, covariance[i], row)
    for i in range(5):
        variance += row[i] * work[0, i]
        covariance[0, i] = covariance[i, 0] = work[0, i]
    covariance[0, 0] = variance


@njit(cache=True, error_model="numpy")
def _update_parameters(mean, covariance, innovation, variance, memory, observation, columns, constants):
    """Update every lane of the parameter filter in place."""
    row, work, readings = np.empty(4), np.empty((3, 4)), np.empty(6)
    for lane in range(len(mean)):
        for k in range(6):
            readings[k] = observation[lane, columns[k]]
        x, p = mean[lane], covariance[lane]
        _predict_parameters(x, p, memory[lane], readings, constants)
        _condition_on_speed(4, x, p, readings, constants, row, work)
        innovation[lane], variance[lane] = _condition_on_acceleration(x, p, readings, constants, row, work)


@njit(cache=True, error_model="numpy")
def _update_surge(mean, covariance, innovation, variance, memory, observation, columns, constants):
    """Update every lane of the state-and-parameter filter in place."""
    row, work, readings = np.empty(5), np.empty((3, 5)), np.empty(6)
    for lane in range(len(mean)):
        for k in range(6):
            readings[k] = observation[lane, columns[k]]
        x, p = mean[lane], covariance[lane]
        _predict_surge(x, p, memory[lane], readings, constants, row, work)
        innovation[lane], variance[lane] = _condition_on_speed(5, x, p, readings, constants, row, work)


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
    def constants(self) -> Constants:
        """What the compiled code gets: the nominal vehicle, noise variances, random walk and its ceiling."""
        noise = max(self.sensor_noise, NOISE_FLOOR)
        vehicle = self.vehicle
        return Constants(
            step=SAMPLE_TIME,
            opening=opening_share(vehicle),
            between=BETWEEN_STD**2,
            alpha=vehicle.alpha,
            beta=vehicle.beta,
            gamma=vehicle.gamma,
            speed_variance=(noise * CHANNELS["speed"].noise) ** 2,
            acceleration_variance=(noise * CHANNELS["acceleration"].noise) ** 2,
            rpm_variance=(noise * CHANNELS["port_rpm"].noise) ** 2,
            disturbance_variance=max(self.disturbance * vehicle.disturbance_std, DISTURBANCE_FLOOR) ** 2,
            disturbance_memory=exp(-SAMPLE_TIME / vehicle.disturbance_time),
            walk=tuple(SAMPLE_TIME * std**2 for std in self.walk_std),
            ceiling=tuple(std**2 for std in self.prior_std),
        )

    @cached_property
    def scale(self) -> np.ndarray:
        """Nominal value of every state, (n_states,): what `physical` multiplies by; 1 for speed and disturbance."""
        nominal = {name: getattr(self.vehicle, name) for name in PARAMETERS}
        return np.array([nominal.get(state, 1.0) for state in self.states])

    def initial(self, n_lanes: int) -> Estimate:
        """The estimate before any observation: nominal parameters with ``prior_std``, speed unknown."""
        mean, variance, memory = (np.array(values, dtype=float) for values in self._start())
        nothing = np.zeros(n_lanes)
        covariance = np.tile(np.diag(variance), (n_lanes, 1, 1))
        means, memories = np.tile(mean, (n_lanes, 1)), np.tile(memory, (n_lanes, 1))
        return Estimate(means, covariance, nothing, np.ones(n_lanes), nothing, memories)

    def update(self, estimate: Estimate, observation: np.ndarray) -> Estimate:
        """The estimate after the next observation (n_lanes, n_channels), channels as in `CHANNELS`, 0.1 s later.

        Raises `ValueError` if the shape is not that of the estimate. Readings are taken as they come: a silent channel's
        zeros are measurements to the filter, so mask or diagnose the sensor elsewhere.
        """
        observation = np.ascontiguousarray(observation, dtype=np.float64)
        shape = (len(estimate.mean), len(CHANNELS))
        if observation.shape != shape:
            raise refusal("observation's shape", observation.shape, f"{shape}", "give one row per lane of the estimate")
        mean, covariance, memory = estimate.mean.copy(), estimate.covariance.copy(), estimate.memory.copy()
        innovation, variance = np.empty(len(mean)), np.empty(len(mean))
        self.kernel(mean, covariance, innovation, variance, memory, observation, _columns(), self.constants)
        log_likelihood = -0.5 * (np.log(2 * pi * variance) + innovation * innovation / variance)
        return Estimate(mean, covariance, innovation, variance, log_likelihood, memory)

    def physical(self, estimate: Estimate) -> tuple[np.ndarray, np.ndarray]:
        """Mean (n_lanes, n_states) and covariance (n_lanes, n_states, n_states) in SI units and rpm.

        alpha 1/m, beta (m/s^2)/rpm^2, gamma 1/(m rad^2), speed m/s, disturbance m/s^2. The SI covariance spans some
        14 decades: read standard deviations off it, and invert the relative one.
        """
        return estimate.mean * self.scale, estimate.covariance * np.outer(self.scale, self.scale)


@dataclass(frozen=True)
class ParameterFilter(_Filter):
    """The thesis' parameter filter (IV.B.2): each measured acceleration is an equation in (alpha, beta, gamma).

    The parameters walk at random; ``du/dt = H theta + v`` with ``H = [u|u|, n|n|, u|u| delta^2]`` of the same instant.
    The paddle wheel's noise, squared in H, would pull alpha towards zero by several percent, so the speed in H comes
    from a kinematic stage: measured acceleration integrated, corrected by the paddle wheel (1.4 mm/s instead of 1 cm/s
    at default noise). What noise is left in H is added, to first order, to the variance of v.

    Parameters
    ----------
    vehicle
        Its nominal constants; the filter is not told the true ones.
    sensor_noise
        Scale of the standard deviations in `CHANNELS`; below `NOISE_FLOOR` it counts as `NOISE_FLOOR`.
    disturbance
        Scale of the vehicle's ``disturbance_std``.
    prior_std
        Relative standard deviation of (alpha, beta, gamma) at the start, and the ceiling of the random walk: it slows
        as a variance nears ``prior_std**2`` and never carries it beyond, so nothing winds up while a parameter is
        unobservable. 30 % covers the healthy band and makes a 50 % fault a 1.7 sigma event.
    walk_std
        Relative random walk of (alpha, beta, gamma) per square root of a second. 3 % follows a jump of 35 % within two
        speed changes and adds a tenth to the scatter of a healthy estimate.

    When it misleads
    ----------------
    At constant speed only beta/alpha is observable: a drag fault moves both estimates until the speed changes. gamma
    does not move without deflection. A bias of the accelerometer b is a force to it, and biases its speed stage by
    about 5 s x b. A disturbance is coloured, the filter takes it as white with the same density at low frequency,
    ``(1 + rho)/(1 - rho)`` times its variance: honest for slow changes, pessimistic for quick ones; its NIS is then far
    below 1 (0.05 at default), so use `SurgeFilter` for likelihoods. After a jump of a parameter, the
    covariance says nothing of the lag.
    """

    states: ClassVar[tuple[str, ...]] = ("speed", *PARAMETERS)
    kernel: ClassVar[Callable] = staticmethod(_update_parameters)

    def _start(self):
        return (0, 1, 1, 1), (START_SPEED_STD**2, *self.constants.ceiling), (0,)


@dataclass(frozen=True)
class SurgeFilter(_Filter):
    """Extended Kalman filter of (speed, alpha, beta, gamma, disturbance) from paddle wheel and shaft speeds alone.

    Prediction integrates the surge equation over the sample with the midpoint rule; thrust is the mean of ``n|n|`` over
    the sample, between the readings that bound it (`opening_share`), with an uncertainty of 0.29 of their difference
    and the noise of the rpm counters. The disturbance is an Ornstein-Uhlenbeck process held over a sample,
    ``d' = rho d + sqrt(1 - rho^2) std w``. The measurement is the paddle wheel. Parameters as in `ParameterFilter`.

    When it misleads
    ----------------
    As the parameter filter does at constant speed and without deflection. A speed gain c reads as alpha/c and c beta.
    It linearises about its own estimate: after a jump of a parameter, or with a prior far above 30 %, its covariance is
    too small. It has no sensor fault in its model.
    """

    states: ClassVar[tuple[str, ...]] = ("speed", *PARAMETERS, "disturbance")
    kernel: ClassVar[Callable] = staticmethod(_update_surge)

    def _start(self):
        variance = (START_SPEED_STD**2, *self.constants.ceiling, self.constants.disturbance_variance)
        return (0, 1, 1, 1, 0), variance, (0,)


def _columns() -> tuple[int, ...]:
    names = tuple(CHANNELS)
    return tuple(names.index(name) for name in COLUMNS)


def nees(estimate: Estimate, truth: np.ndarray) -> np.ndarray:
    """Normalised estimation error squared (n_lanes,), truth (n_lanes, n_states) in the units of ``estimate.mean``.

    Chi-square with n_states degrees of freedom if the filter's model is true, so its mean over lanes is n_states; above
    it the filter is overconfident. Misleads over time: successive values of one lane are correlated. Bar-Shalom 5.4.
    """
    error = truth - estimate.mean
    return np.einsum("li,li->l", error, np.linalg.solve(estimate.covariance, error[..., None])[..., 0])


def nis(estimate: Estimate) -> np.ndarray:
    """Normalised innovation squared (n_lanes,) of the last measurement: chi-square, one degree of freedom, mean 1.

    Needs no truth, so it works at sea; but it weighs all directions alike, and hardly sees a wrong parameter at
    constant speed. Bar-Shalom 5.4.
    """
    return estimate.innovation**2 / estimate.innovation_variance
