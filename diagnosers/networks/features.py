"""What the integrated network sees: readings, motor and surge residuals, and what the filters make of them.

The filters are the parameter filters of hull and shafts, with their innovations and variances, and
the bank of filters with its belief. Every signal comes with running means over several times, so
that the network need not learn to remember what a first order filter keeps: a step shows in the
short mean before the long one, a healthy vehicle's own offset stays in the long.
"""

from functools import cached_property
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS, COMMANDS, INDEX, READINGS
from auv_fault_env.compiling import kernel, scalar
from auv_fault_env.faults import classes
from auv_fault_env.parameters import SAMPLE_TIME, SIDES, Vehicle
from auv_fault_env.physics import clipped
from diagnosers import kalman, motor_filter
from diagnosers.diagnoser import Belief
from diagnosers.filter_bank import FilterBank
from diagnosers.symptoms.residuals import RESIDUALS, residuals

MEMORIES = (1.0, 4.0, 15.0)  # s, time constants of the running means
BURST = 2.0  # s, of the running mean square
# s, in which the filters settle; how old a vehicle is thereafter must not tell of faults
YOUNG = 5.0
LIMIT = 30.0  # standard deviations: what lies beyond is an outlier, and its size says nothing
# of the channels, for numbers near 1
SCALE = (0.3, 0.3, 0.3, 0.3, 0.3, 0.03, 3.0, 0.4, 400.0, 3.0, 0.4, 400.0)
SIGNALS = (
    *RESIDUALS,
    "speed_innovation",
    "acceleration_innovation",
    *(f"{side}_{kind}_innovation" for side in SIDES for kind in ("current", "voltage")),
)
ESTIMATES = (
    *(f"{kind}_{name}" for kind in ("surge", "parameter") for name in kalman.PARAMETERS),
    *(f"{side}_{name}" for side in SIDES for name in motor_filter.PARAMETERS),
)
N_SIGNALS = len(SIGNALS)
N_ESTIMATES = len(ESTIMATES)
N_COMMANDS = len(COMMANDS)
N_READINGS = len(READINGS)
NOISE = tuple(CHANNELS[name].noise for name in READINGS)
SPEED_NOISE = CHANNELS["speed"].noise
SPEED = INDEX["speed"]
COMMAND, RUDDER, STERN_PLANE = (
    COMMANDS.index(name) for name in ("speed_command", "rudder", "stern_plane")
)


CLASSES = classes()
# of the bank: one filter per fault names it as well as three, and the network grades it
GRADES = ((0.1, 1.0),)
EVIDENCE = 5.0  # nats, scale of the bank's log odds


def _names() -> tuple[str, ...]:
    past = [f"mean_{memory:g}" for memory in MEMORIES]
    return (
        *CHANNELS,
        "command_error",
        "deflection",
        *(f"{name}:{part}" for name in SIGNALS for part in ("now", *past, "burst")),
        *(
            f"{name}:{part}"
            for name in READINGS
            for part in ("step", "repeated", "zero", "repeats", "zeros")
        ),
        *(f"{name}:{part}" for name in ESTIMATES for part in ("now", "std", "change")),
        "disturbance",
        "speed_correction",
        "youth",
        *(f"bank_{part}:{name}" for part in ("odds", "severity") for name in CLASSES[1:]),
    )


FEATURES = _names()
BANK_ODDS = slice(-2 * (len(CLASSES) - 1), -(len(CLASSES) - 1))


class Past(NamedTuple):
    """Running values of every lane.

    observation (n_lanes, n_channels), the last; means (n_lanes, n_signals, n_memories) and squares
    (n_lanes, n_signals) of the signals; shares of repeated and of zero readings (n_lanes,
    n_readings, 2); slow means of the estimates (n_lanes, n_estimates); age (n_lanes,) in samples.
    """

    observation: np.ndarray
    means: np.ndarray
    squares: np.ndarray
    shares: np.ndarray
    estimates: np.ndarray
    age: np.ndarray


class FeatureState(NamedTuple):
    """The filters and the running values."""

    surge: kalman.Estimate
    parameters: kalman.Estimate
    motors: motor_filter.MotorEstimate
    bank: Any
    past: Past


class Features:
    """The recursion from observations to `FEATURES`, for a nominal vehicle; state in, next state out."""

    def __init__(self, vehicle: Vehicle):
        self.vehicle = vehicle
        self.surge = kalman.SurgeFilter(vehicle)
        self.parameters = kalman.ParameterFilter(vehicle)
        self.motors = motor_filter.MotorFilter(vehicle)
        self.bank = FilterBank(vehicle, GRADES)

    @cached_property
    def shares(self) -> tuple[float, float, float]:
        """Share by which a sample moves each running mean."""
        return tuple(SAMPLE_TIME / memory for memory in MEMORIES)

    def initial(self, n_lanes: int) -> FeatureState:
        """The state before any observation."""
        past = Past(
            np.zeros((n_lanes, len(CHANNELS))),
            np.zeros((n_lanes, N_SIGNALS, len(MEMORIES))),
            np.ones((n_lanes, N_SIGNALS)),
            np.zeros((n_lanes, N_READINGS, 2)),
            np.zeros((n_lanes, N_ESTIMATES)),
            np.zeros(n_lanes, np.int64),
        )
        filters = (self.surge, self.parameters, self.motors, self.bank)
        return FeatureState(*(part.initial(n_lanes) for part in filters), past)

    def step(self, state: FeatureState, observation: np.ndarray) -> tuple[FeatureState, np.ndarray]:
        """The next state, and the features (n_lanes, n_features) float32, each of the order of 1."""
        surge = self.surge.update(state.surge, observation)
        parameters = self.parameters.update(state.parameters, observation)
        motors = self.motors.update(state.motors, observation)
        bank, belief = self.bank.step(state.bank, observation)
        before = np.where(state.past.age[:, None] > 0, state.past.observation, observation)
        signals = self._signals(before, observation, surge, parameters, motors)
        means, stds = self._estimates(surge, parameters, motors)
        past = Past(observation, *(part.copy() for part in state.past[1:]))
        features = np.empty((len(observation), len(FEATURES)), np.float32)
        extra = np.stack(
            [
                surge.mean[:, 4] / self.vehicle.disturbance_std,
                observation[:, SPEED] - surge.mean[:, 0],
            ],
            1,
        )
        _fold(before, *past, signals, means, stds, extra, self.shares, features)
        features[:, -2 * (len(CLASSES) - 1) :] = _told(belief, self.bank)
        return FeatureState(surge, parameters, motors, bank, past), features

    def _signals(self, before, observation, surge, parameters, motors) -> np.ndarray:
        """Residuals and innovations in standard deviations, (n_lanes, n_signals)."""
        left = residuals(before, observation, self.vehicle)
        return np.concatenate(
            [
                left.values / left.std,
                *(
                    (e.innovation / np.sqrt(e.innovation_variance))[:, None]
                    for e in (surge, parameters)
                ),
                (motors.innovation / np.sqrt(motors.innovation_variance)).reshape(-1, 4),
            ],
            axis=1,
        )

    @staticmethod
    def _estimates(surge, parameters, motors) -> tuple[np.ndarray, np.ndarray]:
        """Deviations of the estimates from nominal and their standard deviations, each (n_lanes, n_estimates)."""
        hull = slice(1, 1 + len(kalman.PARAMETERS))
        mean = [
            *(e.mean[:, hull] for e in (surge, parameters)),
            motors.mean.reshape(len(motors.mean), -1),
        ]
        variance = [
            np.diagonal(e.covariance, axis1=1, axis2=2)[:, hull] for e in (surge, parameters)
        ]
        variance.append(
            np.diagonal(motors.covariance, axis1=2, axis2=3).reshape(len(motors.mean), -1)
        )
        return np.concatenate(mean, axis=1) - 1.0, np.sqrt(np.concatenate(variance, axis=1))


def _told(belief: Belief, bank: FilterBank) -> np.ndarray:
    """The bank's log odds of every fault class against normal, bent, and its severities, (n_lanes, 2 n_faults)."""
    known: slice | list[int] = slice(1, None)
    # the catalogue has grown since this module was loaded
    if belief.log_probability.shape[1] != len(CLASSES):
        known = [bank.classes.index(name) for name in CLASSES[1:]]
    odds = (belief.log_probability[:, known] - belief.log_probability[:, :1]) / EVIDENCE
    return np.concatenate(
        [odds / (1.0 + 0.25 * np.abs(odds)), belief.severity_mean[:, known]], axis=1
    )


@scalar
def _squashed(value):
    """The value, bent towards +-4 where it is large: nothing a sensor delivers may drown the rest."""
    return value / (1.0 + 0.25 * abs(value))


@scalar
def _fold_signals(signals, means, squares, age, shares, features, at):
    """Signals, their running means and mean squares."""
    for k in range(N_SIGNALS):
        now = clipped(signals[k], -LIMIT, LIMIT)
        rest = now - means[k, 0]
        squares[k] += SAMPLE_TIME / BURST * (rest * rest - squares[k])
        features[at] = _squashed(now)
        for m in range(len(MEMORIES)):
            means[k, m] += max(shares[m], 1.0 / (age + 1.0)) * (now - means[k, m])
            features[at + 1 + m] = _squashed(4.0 * means[k, m])
        features[at + 1 + len(MEMORIES)] = _squashed(sqrt(squares[k]))
        at += 2 + len(MEMORIES)
    return at


@scalar
def _fold_readings(before, row, shares, age, features, at):
    """Steps of the readings in standard deviations, and how often they repeat or read zero."""
    for k in range(N_READINGS):
        got = row[N_COMMANDS + k]
        last = before[N_COMMANDS + k]
        repeated = 1.0 if got == last and age > 0 else 0.0
        zero = 1.0 if got == 0.0 else 0.0
        shares[k, 0] += SAMPLE_TIME / MEMORIES[1] * (repeated - shares[k, 0])
        shares[k, 1] += SAMPLE_TIME / MEMORIES[1] * (zero - shares[k, 1])
        features[at] = _squashed((got - last) / (sqrt(2.0) * NOISE[k]))
        features[at + 1] = repeated
        features[at + 2] = zero
        features[at + 3] = sqrt(shares[k, 0])
        features[at + 4] = sqrt(shares[k, 1])
        at += 5
    return at


@scalar
def _fold_estimates(estimates, stds, slow, age, share, features, at):
    """Estimates, their standard deviations, and how far they have moved from their slow means."""
    for k in range(N_ESTIMATES):
        now = min(max(estimates[k], -3.0), 3.0)
        slow[k] += max(share, 1.0 / (age + 1.0)) * (now - slow[k])
        features[at] = _squashed(10.0 * now)
        features[at + 1] = _squashed(10.0 * stds[k])
        features[at + 2] = _squashed(20.0 * (now - slow[k]))
        at += 3
    return at


@kernel
def _fold(
    before,
    observation,
    means,
    squares,
    slots,
    slow,
    age,
    signals,
    estimates,
    stds,
    extra,
    shares,
    features,
):
    """Fold one sample into the running values of every lane and write its features."""
    for lane in range(len(observation)):
        row = observation[lane]
        out = features[lane]
        old = age[lane]
        for c in range(len(SCALE)):
            out[c] = _squashed(row[c] / SCALE[c])
        at = len(SCALE)
        out[at] = 5.0 * (row[COMMAND] - row[SPEED])
        out[at + 1] = 10.0 * (row[RUDDER] * row[RUDDER] + row[STERN_PLANE] * row[STERN_PLANE])
        at = _fold_signals(signals[lane], means[lane], squares[lane], old, shares, out, at + 2)
        at = _fold_readings(before[lane], row, slots[lane], old, out, at)
        at = _fold_estimates(estimates[lane], stds[lane], slow[lane], old, shares[-1], out, at)
        out[at] = _squashed(extra[lane, 0])
        out[at + 1] = _squashed(2.0 * extra[lane, 1] / SPEED_NOISE)
        out[at + 2] = max(0.0, 1.0 - SAMPLE_TIME / YOUNG * old)
        age[lane] += 1
