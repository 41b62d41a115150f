"""What a bank takes from the sensors: readings that repeat or vanish, and how likely each hypothesis makes that."""

import math
from typing import NamedTuple

import numpy as np

from auv_fault_env.compiling import inlined, scalar

BIAS, GAIN, NOISE, STUCK, DROPOUT = range(5)  # rows of a sensor, counted from its first
UNSURE = 0.01  # least share of the samples that a faulty sensor loses or delivers
LEAST_GAIN = 1e-3


class Seen(NamedTuple):
    """A sample of one lane.

    Readings (8,), which of them repeat the last one or are zero; which are silent, and of these which have been heard
    before, whose last reading stands in; log_spacing (8,), the logarithm of the distance of values that the sensor can
    show there; rudder and stern plane, squared and summed [rad^2].
    """

    reading: np.ndarray
    repeated: np.ndarray
    zero: np.ndarray
    silent: np.ndarray
    held: np.ndarray
    log_spacing: np.ndarray
    deflection: float


@inlined
def look(observation, last, sensors, seen):
    """Fill `seen` from the readings (8,), NaN for silence, and the last ones, NaN before the first.

    sensors (8, 4): full scale, noise, and resolution where that is coarser than float32.
    """
    for c in range(len(last)):
        seen.silent[c] = math.isnan(observation[c])
        seen.held[c] = seen.silent[c] and not math.isnan(last[c])
        value = observation[c] if not seen.silent[c] else last[c] if seen.held[c] else 0.0
        clipped = value <= sensors[c, 0] or value >= sensors[c, 1]
        seen.reading[c] = value
        seen.repeated[c] = value == last[c] and not clipped
        seen.zero[c] = value == 0.0
        seen.log_spacing[c] = math.log(max(max(abs(value), sensors[c, 2]) * 2.0**-23, sensors[c, 3]))


@inlined
def deliver(values, part, sensor, seen, channel, delivered, evidence):
    """Find which filters hold a reading for delivered (1, else 0), and add the log probability of that.

    `sensor` is the sensor's first row of values. A lost sample is a single value, where a delivered one has a density:
    it counts over the spacing of such values. Of a silent sensor nothing is learnt.
    """
    for f in range(part[0], part[1]):
        stuck, dropout = values[sensor + STUCK, f], values[sensor + DROPOUT, f]
        delivered[f] = 0.0 if seen.silent[channel] else 1.0
        if not seen.silent[channel] and (stuck > 0.0 or dropout > 0.0):
            share = (1.0 - stuck) * (1.0 - dropout)
            if (seen.repeated[channel] and stuck > 0.0) or (seen.zero[channel] and dropout > 0.0):
                delivered[f], share = 0.0, 1.0 - share
                evidence[f] -= seen.log_spacing[channel]
            evidence[f] += math.log(max(share, UNSURE))


@scalar
def shown(values, sensor, f, truth):
    """What a sensor shows of a true value, without noise."""
    return values[sensor + GAIN, f] * truth + values[sensor, f]


@scalar
def meant(values, sensor, f, reading):
    """The true value behind a reading without noise."""
    return (reading - values[sensor, f]) / max(values[sensor + GAIN, f], LEAST_GAIN)
