"""The inputs of the integrated network: readings, residuals and the estimates of the filters.

Every signal comes with running means over several times, so that the network need not learn what a
first-order filter does: a step shows in the short mean first, a healthy offset stays in the long.
"""

from collections.abc import Mapping, Sequence
from math import sqrt
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS, COMMANDS, INDEX, READINGS
from auv_fault_env.compiling import kernel, scalar
from auv_fault_env.errors import known_name
from auv_fault_env.faults import CATALOGUE, UNKNOWN
from auv_fault_env.parameters import SAMPLE_TIME, SIDES, Vehicle, full_scale_factors
from auv_fault_env.physics import RPM, clipped
from diagnosers import kalman, motor_filter
from diagnosers.diagnoser import Belief
from diagnosers.filter_bank import FilterBank
from diagnosers.networks.class_list import SHIPPED_CLASSES
from diagnosers.shafts import with_equal_readings, with_equal_shafts
from diagnosers.symptoms.residuals import RESIDUALS, residuals

MEAN_TIMES = (1.0, 4.0, 15.0)  # s, time constants of the running means
SQUARE_TIME = 2.0  # s, of the running mean square
# s, in which the filters settle; the age of a vehicle beyond that is no feature
SETTLING_TIME = 5.0
OUTLIER = 30.0  # standard deviations, to which signals are clipped
# of the channels, for numbers near 1 on `thesis1992`
SCALE = (0.3, 0.3, 0.3, 0.3, 0.3, 0.03, 3.0, 0.4, 400.0, 3.0, 0.4, 400.0)
SIGNALS = (
    *(*RESIDUALS, "speed_innovation", "acceleration_innovation"),
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
N_MEANS = len(MEAN_TIMES)
SPEED = INDEX["speed"]
COMMAND, RUDDER, STERN_PLANE = map(COMMANDS.index, ("speed_command", "rudder", "stern_plane"))
# of the bank: one grade isolates nearly as well as three do, in half the time
GRADES = ((0.2, 1.0),)
HAZARD = 1e-4  # probability per sample that a fault begins, of the bank
# of the bank, for the vehicle of a vehicle file
BANK_SETTINGS = ("band", "noise", "faults")
EVIDENCE = 5.0  # nats, scale of the bank's log odds


_OF_SIGNAL = ("now", *(f"mean_{time:g}" for time in MEAN_TIMES), "burst")
_OF_READING = ("step", "repeated", "zero", "repeats", "zeros")
_OF_ESTIMATE = ("now", "std", "change")
_WITHOUT_BANK = (
    *(*CHANNELS, "command_error", "deflection"),
    *(f"{name}:{part}" for name in SIGNALS for part in _OF_SIGNAL),
    *(f"{name}:{part}" for name in READINGS for part in _OF_READING),
    *(f"{name}:{part}" for name in ESTIMATES for part in _OF_ESTIMATE),
    *("disturbance", "speed_correction", "youth"),
)


def feature_names(classes: Sequence[str]) -> tuple[str, ...]:
    """The features of a network that was trained on these classes, in their order."""
    of_bank = [f"bank_{part}:{name}" for part in ("odds", "severity") for name in classes[1:]]
    return (*_WITHOUT_BANK, *of_bank)


def bank_odds_columns(n_classes: int) -> slice:
    """Where the bank's log odds stand among the features of a network with that many classes."""
    n_faults = n_classes - 1
    return slice(-2 * n_faults, -n_faults)


class RunningValues(NamedTuple):
    """What the features remember of every lane."""

    observation: np.ndarray  # (n_lanes, n_channels), the last
    means: np.ndarray  # (n_lanes, n_signals, n_means), of the signals
    squares: np.ndarray  # (n_lanes, n_signals), running mean squares
    shares: np.ndarray  # (n_lanes, n_readings, 2), of repeated and of zero readings
    estimates: np.ndarray  # (n_lanes, n_estimates), slow means
    age: np.ndarray  # (n_lanes,), in samples


class FeatureState(NamedTuple):
    """The states of the filters and the running values."""

    surge: kalman.Estimate
    parameters: kalman.Estimate
    motors: motor_filter.MotorEstimate
    bank: Any
    running: RunningValues


class Features:
    """The recursion from observations to features: state in, next state out.

    `classes` are those of the network's training; `feature_names` names the features. `bank` has
    settings of the filter bank (`BANK_SETTINGS`) where not the default; by default it has every
    fault of the catalogue as it is when this object is made.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        classes: Sequence[str] = SHIPPED_CLASSES,
        bank: Mapping[str, Any] = MappingProxyType({}),
    ):
        self.vehicle = vehicle
        self._of_filters = with_equal_shafts(vehicle)
        of_hull = (
            kalman.SurgeFilter(self._of_filters),
            kalman.ParameterFilter(self._of_filters),
        )
        self.filters = (*of_hull, motor_filter.MotorFilter(self._of_filters))
        for name in bank:
            known_name("setting of the filter bank", name, BANK_SETTINGS)
        settings = {"faults": tuple(CATALOGUE)} | dict(bank)
        self.bank = FilterBank(
            vehicle,
            GRADES,
            hazard=HAZARD,
            temperature=1.0,
            class_temperature=1.0,
            **settings,
        )
        factors = full_scale_factors(vehicle)
        self._scale = np.array(
            [
                size * factors[channel.unit]
                for size, channel in zip(SCALE, CHANNELS.values(), strict=True)
            ]
        )
        noise = {name: CHANNELS[name].noise for name in READINGS} | dict(self.bank.noise)
        self._noise = np.array([noise[name] for name in READINGS])
        self.n_features = len(feature_names(classes))
        self.mean_shares = tuple(SAMPLE_TIME / time for time in MEAN_TIMES)
        # a fault that joins the catalogue later stands before `unknown`, which remains the last
        column = {name: k for k, name in enumerate(self.bank.classes)} | {UNKNOWN: -1}
        self._fault_columns = [column[name] for name in classes[1:]]

    def initial(self, n_lanes: int) -> FeatureState:
        """The state before any observation."""
        running = RunningValues(
            np.zeros((n_lanes, len(CHANNELS))),
            np.zeros((n_lanes, N_SIGNALS, N_MEANS)),
            np.ones((n_lanes, N_SIGNALS)),
            np.zeros((n_lanes, N_READINGS, 2)),
            np.zeros((n_lanes, N_ESTIMATES)),
            np.zeros(n_lanes, np.int64),
        )
        filters = (*self.filters, self.bank)
        return FeatureState(*(each.initial(n_lanes) for each in filters), running)

    def step(
        self, state: FeatureState, observation: np.ndarray
    ) -> tuple[FeatureState, np.ndarray, Belief]:
        """The next state, the features (n_lanes, n_features) float32, and the bank's belief.

        The last reading takes the place of one that has not arrived (NaN), except in the bank. Of a
        voltage it is the last one with the change that current and shaft speed imply.
        """
        bank, belief = self.bank.step(state.bank, observation)
        is_missing = np.isnan(observation)
        observation = self._without_gaps(state.running.observation, observation)
        observation = with_equal_readings(observation, self.vehicle)
        filters = zip(self.filters, state[:3], strict=True)
        estimates = [each.update(last, observation) for each, last in filters]
        is_later = state.running.age[:, None] > 0
        previous = np.where(is_later, state.running.observation, observation)
        signals = self._signals(previous, observation, *estimates)
        deviations = _deviations(*estimates)
        surge_mean = estimates[0].mean
        usual = max(self.vehicle.disturbance_std, kalman.DISTURBANCE_FLOOR)
        disturbance = surge_mean[:, 4] / usual
        surge_values = np.stack([disturbance, observation[:, SPEED] - surge_mean[:, 0]], 1)
        running = RunningValues(observation, *(part.copy() for part in state.running[1:]))
        features = np.empty((len(observation), self.n_features), np.float32)
        _fold(
            previous,
            running,
            is_missing,
            signals,
            *deviations,
            surge_values,
            self.mean_shares,
            self._scale,
            self._noise,
            features,
        )
        features[:, -2 * len(self._fault_columns) :] = self._bank_features(belief)
        return FeatureState(*estimates, bank, running), features, belief

    def _without_gaps(self, last: np.ndarray, observation: np.ndarray) -> np.ndarray:
        is_missing = np.isnan(observation)
        filled = np.where(is_missing, last, observation)
        change = filled - last
        for side in SIDES:
            voltage = INDEX[f"{side}_voltage"]
            by_current = self.vehicle.resistance * change[:, INDEX[f"{side}_current"]]
            by_speed = self.vehicle.torque_constant * change[:, INDEX[f"{side}_rpm"]] / RPM
            filled[:, voltage] += is_missing[:, voltage] * (by_current + by_speed)
        return filled

    def _signals(self, previous, observation, surge, parameters, motors) -> np.ndarray:
        """Residuals and innovations in standard deviations, (n_lanes, n_signals)."""
        physical = residuals(previous, observation, self._of_filters)
        signals = [physical.values / physical.std]
        for estimate in (surge, parameters, motors):
            innovation = estimate.innovation / np.sqrt(estimate.innovation_variance)
            signals.append(innovation.reshape(len(observation), -1))
        return np.concatenate(signals, axis=1)

    def _bank_features(self, belief: Belief) -> np.ndarray:
        """The bank's log odds of faults to normal, and severities, (n_lanes, 2 n_faults)."""
        faults = self._fault_columns
        log_probability = belief.log_probability
        odds = (log_probability[:, faults] - log_probability[:, :1]) / EVIDENCE
        compressed = odds / (1.0 + 0.25 * np.abs(odds))
        return np.concatenate([compressed, belief.severity_mean[:, faults]], axis=1)


def _deviations(surge, parameters, motors) -> tuple[np.ndarray, np.ndarray]:
    """Deviations of the estimates from nominal, and their stds, each (n_lanes, n_estimates)."""
    hull = slice(1, 1 + len(kalman.PARAMETERS))
    n_lanes = len(motors.mean)
    means = []
    variances = []
    for estimate in (surge, parameters):
        means.append(estimate.mean[:, hull])
        variances.append(np.einsum("lii->li", estimate.covariance)[:, hull])
    means.append(motors.mean.reshape(n_lanes, -1))
    variances.append(np.einsum("lsii->lsi", motors.covariance).reshape(n_lanes, -1))
    return np.concatenate(means, axis=1) - 1.0, np.sqrt(np.concatenate(variances, axis=1))


@scalar
def _compressed(value):
    """The value, compressed towards +-4: no reading, however wrong, outweighs all others."""
    return value / (1.0 + 0.25 * abs(value))


@scalar
def _fold_signals(signals, means, squares, age, mean_shares, features, at):
    """Signals, their running means and mean squares."""
    for k in range(N_SIGNALS):
        now = clipped(signals[k], -OUTLIER, OUTLIER)
        change = now - means[k, 0]
        squares[k] += SAMPLE_TIME / SQUARE_TIME * (change * change - squares[k])
        features[at] = _compressed(now)
        for m in range(N_MEANS):
            means[k, m] += max(mean_shares[m], 1.0 / (age + 1.0)) * (now - means[k, m])
            features[at + 1 + m] = _compressed(4.0 * means[k, m])
        features[at + 1 + N_MEANS] = _compressed(sqrt(squares[k]))
        at += 2 + N_MEANS
    return at


@scalar
def _fold_readings(previous, row, is_missing, shares, age, noise, features, at):
    """Steps of the readings in standard deviations, and how often they repeat or read zero."""
    for k in range(N_READINGS):
        reading = row[N_COMMANDS + k]
        last = previous[N_COMMANDS + k]
        has_arrived = not is_missing[N_COMMANDS + k]
        repeated = 1.0 if reading == last and age > 0 and has_arrived else 0.0
        zero = 1.0 if reading == 0.0 and has_arrived else 0.0
        shares[k, 0] += SAMPLE_TIME / MEAN_TIMES[1] * (repeated - shares[k, 0])
        shares[k, 1] += SAMPLE_TIME / MEAN_TIMES[1] * (zero - shares[k, 1])
        features[at] = _compressed((reading - last) / (sqrt(2.0) * noise[k]))
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
        features[at] = _compressed(10.0 * now)
        features[at + 1] = _compressed(10.0 * stds[k])
        features[at + 2] = _compressed(20.0 * (now - slow[k]))
        at += 3
    return at


@kernel
def _fold(
    previous,
    running,
    is_missing,
    signals,
    estimates,
    stds,
    surge_values,
    mean_shares,
    scale,
    noise,
    features,
):
    """Fold one sample into the running values of every lane and write its features."""
    observation, means, squares, shares, slow, age = running
    for lane in range(len(observation)):
        row = observation[lane]
        out = features[lane]
        old = age[lane]
        for c in range(len(scale)):
            out[c] = _compressed(row[c] / scale[c])
        at = len(scale)
        out[at] = 5.0 * (row[COMMAND] - row[SPEED])
        out[at + 1] = 10.0 * (row[RUDDER] * row[RUDDER] + row[STERN_PLANE] * row[STERN_PLANE])
        at = _fold_signals(signals[lane], means[lane], squares[lane], old, mean_shares, out, at + 2)
        gaps = is_missing[lane]
        at = _fold_readings(previous[lane], row, gaps, shares[lane], old, noise, out, at)
        at = _fold_estimates(estimates[lane], stds[lane], slow[lane], old, mean_shares[-1], out, at)
        out[at] = _compressed(surge_values[lane, 0])
        out[at + 1] = _compressed(2.0 * surge_values[lane, 1] / noise[0])
        out[at + 2] = max(0.0, 1.0 - SAMPLE_TIME / SETTLING_TIME * old)
        age[lane] += 1
