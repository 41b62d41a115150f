"""What is odd about a single reading, whatever the vehicle does: repeated, zero, or too noisy."""

from collections.abc import Sequence
from math import exp, pi
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS, COMMANDS, READINGS
from auv_fault_env.parameters import SAMPLE_TIME

KINDS = ("held", "lost", "rough")
SYMPTOMS = tuple(f"{channel}_{kind}" for kind in KINDS for channel in READINGS)
RULES = {f"sensor:{channel}": tuple(f"+{channel}_{kind}" for kind in KINDS) for channel in READINGS}

FORGET = exp(-SAMPLE_TIME / 8.0)  # of counts and averages, per sample
ODD = 1.5  # symptom of a held or lost reading that is not yet forgotten
# of second differences in standard deviations: most, and mean
CLIPPED = 3.0
HEALTHY_BEND = (2.0 / pi) ** 0.5
# their averaged excess, healthy, once an hour
ROUGH = {"m/s": 0.27, "m/s^2": 0.33, "V": 0.67, "A": 0.39, "rpm": 1.25}
NOISE = np.array([CHANNELS[name].noise for name in READINGS])
SCALE = np.stack(
    [np.full(len(READINGS), 1 / ODD)] * 2
    + [np.array([ROUGH[CHANNELS[name].unit] for name in READINGS])]
)


class Oddities(NamedTuple):
    """Lane first: the last two readings, counts and averages (n_lanes, 3, 8) by kind and reading, samples so far."""

    last: np.ndarray
    before: np.ndarray
    seen: np.ndarray
    samples: np.ndarray


def initial(n_lanes: int) -> Oddities:
    """Nothing odd has been seen."""
    readings = np.zeros((n_lanes, len(READINGS)))
    return Oddities(
        readings, readings, np.zeros((n_lanes, len(KINDS), len(READINGS))), np.zeros((n_lanes, 1))
    )


def update(old: Oddities, observation: np.ndarray) -> Oddities:
    """After the next observation (n_lanes, n_channels)."""
    readings = observation[:, len(COMMANDS) :]
    lost = readings == 0.0
    held = (readings == old.last) & ~lost & (old.samples > 0)
    bend = np.abs(readings - 2.0 * old.last + old.before) / (6.0**0.5 * NOISE)
    rough = (np.minimum(bend, CLIPPED) - HEALTHY_BEND) * (old.samples > 1)
    seen = FORGET * old.seen + np.stack([held, lost, (1.0 - FORGET) * rough], axis=1)
    return Oddities(readings, old.last, seen, old.samples + 1)


def symptoms(oddities: Oddities) -> np.ndarray:
    """(n_lanes, 24) in the order of `SYMPTOMS`; 1 is what a healthy vehicle shows about once an hour."""
    return (oddities.seen / SCALE).reshape(len(oddities.seen), -1)


def sensor_columns(classes: Sequence[str]) -> list[int]:
    """The columns of the classes of `READINGS` in a belief."""
    return [classes.index(f"sensor:{channel}") for channel in READINGS]


def write_severity(severity: np.ndarray, sensors: list[int], oddities: Oddities) -> None:
    """Where readings have been held or lost, the sensor's severity is how often of late.

    severity (n_lanes, n_classes) is changed in place; sensors are the `sensor_columns`.
    """
    often = np.minimum((1.0 - FORGET) * oddities.seen[:, :2].max(axis=1), 1.0)
    severity[:, sensors] = np.where(often > 0.0, often, severity[:, sensors])
