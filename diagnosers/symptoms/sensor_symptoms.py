"""Symptoms of single sensors, without a model: readings that repeat, are zero, or too noisy."""

from math import exp, pi
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS, COMMANDS, READINGS
from auv_fault_env.parameters import SAMPLE_TIME

KINDS = ("repeated", "zero", "noisy")
SYMPTOMS = tuple(f"{channel}_{kind}" for kind in KINDS for channel in READINGS)
RULES = {f"sensor:{channel}": tuple(f"+{channel}_{kind}" for kind in KINDS) for channel in READINGS}

FORGETTING = exp(-SAMPLE_TIME / 8.0)  # of counts and averages, per sample
COUNT_SYMPTOM = 1.5  # symptom of one repeated or zero reading
# of second differences in standard deviations: the largest that counts, and the healthy mean
LARGEST_DIFFERENCE = 3.0
HEALTHY_DIFFERENCE = (2.0 / pi) ** 0.5
# excess of their mean that a healthy vehicle reaches once an hour
NOISE_EXCESS = {"m/s": 0.27, "m/s^2": 0.33, "V": 0.67, "A": 0.39, "rpm": 1.25}
NOISE = np.array([CHANNELS[name].noise for name in READINGS])
SCALE = np.full((len(KINDS), len(READINGS)), 1 / COUNT_SYMPTOM)
SCALE[KINDS.index("noisy")] = [NOISE_EXCESS[CHANNELS[name].unit] for name in READINGS]


class SensorSymptoms(NamedTuple):
    """What the symptoms of every lane follow from."""

    last: np.ndarray  # (n_lanes, n_readings)
    second_last: np.ndarray
    level: np.ndarray  # (n_lanes, 3, n_readings), decaying counts, and mean excess of noise
    n_samples: np.ndarray  # (n_lanes, 1), so far


def initial(n_lanes: int) -> SensorSymptoms:
    """The state before the first sample."""
    readings = np.zeros((n_lanes, len(READINGS)))
    level = np.zeros((n_lanes, len(KINDS), len(READINGS)))
    return SensorSymptoms(readings, readings, level, np.zeros((n_lanes, 1)))


def update(state: SensorSymptoms, observation: np.ndarray) -> SensorSymptoms:
    """The state after the next observation (n_lanes, n_channels), NaN where no reading arrived.

    The last reading takes the place of a missing one, and is no symptom then.
    """
    readings = observation[:, len(COMMANDS) :]
    has_arrived = ~np.isnan(readings)
    readings = np.where(has_arrived, readings, state.last)
    is_zero = (readings == 0.0) & has_arrived
    is_repeated = (readings == state.last) & (readings != 0.0) & (state.n_samples > 0)
    is_repeated &= has_arrived
    second_difference = readings - 2.0 * state.last + state.second_last
    difference = np.abs(second_difference) / (6.0**0.5 * NOISE)
    excess = np.minimum(difference, LARGEST_DIFFERENCE) - HEALTHY_DIFFERENCE
    excess = excess * (has_arrived & (state.n_samples > 1))
    new = np.stack([is_repeated, is_zero, (1.0 - FORGETTING) * excess], axis=1)
    level = FORGETTING * state.level + new
    return SensorSymptoms(readings, state.last, level, state.n_samples + 1)


def filled(state: SensorSymptoms, observation: np.ndarray) -> np.ndarray:
    """The observation that has led to the state, with the last readings where it has none."""
    return np.hstack([observation[:, : len(COMMANDS)], state.last])


def symptoms(state: SensorSymptoms) -> np.ndarray:
    """(n_lanes, 24) in the order of `SYMPTOMS`; a healthy vehicle reaches 1 about once an hour."""
    return (state.level / SCALE).reshape(len(state.level), -1)


def write_severity(severity: np.ndarray, sensors: list[int], state: SensorSymptoms) -> None:
    """Write the recent share of repeated or zero readings as severity into the sensors' columns."""
    count = state.level[:, :2].max(axis=1)
    share = np.minimum((1.0 - FORGETTING) * count, 1.0)
    severity[:, sensors] = np.where(share > 0.0, share, severity[:, sensors])
