"""What a bank takes from the sensors: readings that repeat or vanish, and how likely each hypothesis makes that."""

import math
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import COMMANDS, READINGS
from auv_fault_env.compiling import inlined, scalar

# of an observation
FIRST_READING = len(COMMANDS)
N_READINGS = len(READINGS)
RUDDER = COMMANDS.index("rudder")
STERN_PLANE = COMMANDS.index("stern_plane")
BIAS, GAIN, NOISE, STUCK, DROPOUT = range(5)  # rows of a sensor, counted from its first
UNSURE = 0.01  # least share of the samples that a faulty sensor loses or delivers
LEAST_GAIN = 1e-3


class Seen(NamedTuple):
    """A sample of the lanes of a pack.

    Readings (8, n_lanes), which of them repeat the last one or are zero; which are silent, and of
    these which have been heard before, whose last reading stands in; log_spacing (8, n_lanes), the
    logarithm of the distance of values that the sensor can show there; deflection (n_lanes,),
    rudder and stern plane, squared and summed [rad^2].
    """

    reading: np.ndarray
    repeated: np.ndarray
    zero: np.ndarray
    silent: np.ndarray
    held: np.ndarray
    log_spacing: np.ndarray
    deflection: np.ndarray


def seen_by(n_lanes: int) -> Seen:
    """Room for a sample."""
    flags = (np.zeros((N_READINGS, n_lanes), bool) for _ in range(4))
    return Seen(
        np.zeros((N_READINGS, n_lanes)), *flags, np.zeros((N_READINGS, n_lanes)), np.zeros(n_lanes)
    )


@inlined
def look(observation, last, sensors, seen):
    """Fill `seen` from the observation (n_lanes, n_channels), NaN for silence, and the last readings, NaN before any.

    sensors (8, 4): full scale, noise, and resolution where that is coarser than float32.
    """
    for p in range(len(last)):
        rudder = observation[p, RUDDER]
        plane = observation[p, STERN_PLANE]
        seen.deflection[p] = rudder * rudder + plane * plane
        for c in range(N_READINGS):
            told = observation[p, FIRST_READING + c]
            before = last[p, c]
            silent = math.isnan(told)
            held = silent and not math.isnan(before)
            value = told if not silent else before if held else 0.0
            clipped = value <= sensors[c, 0] or value >= sensors[c, 1]
            seen.reading[c, p] = value
            seen.silent[c, p] = silent
            seen.held[c, p] = held
            seen.repeated[c, p] = value == before and not clipped
            seen.zero[c, p] = value == 0.0
            seen.log_spacing[c, p] = math.log(
                max(max(abs(value), sensors[c, 2]) * 2.0**-23, sensors[c, 3])
            )


@inlined
def deliver(values, part, sensor, seen, channel, delivered, evidence):
    """Find which filters hold a reading for delivered (1, else 0), and add the log probability of that.

    `sensor` is the sensor's first row of values. A lost sample is a single value, where a delivered
    one has a density: it counts over the spacing of such values. Of a silent sensor nothing is
    learnt.
    """
    n_lanes = np.uint64(seen.deflection.size)
    for p in range(n_lanes):
        heard = not seen.silent[channel, p]
        for f in range(part[0] + p, part[1], n_lanes):
            stuck = values[sensor + STUCK, f]
            dropout = values[sensor + DROPOUT, f]
            delivered[f] = 1.0 if heard else 0.0
            if heard and (stuck > 0.0 or dropout > 0.0):
                share = (1.0 - stuck) * (1.0 - dropout)
                if (seen.repeated[channel, p] and stuck > 0.0) or (
                    seen.zero[channel, p] and dropout > 0.0
                ):
                    delivered[f] = 0.0
                    share = 1.0 - share
                    evidence[f] -= seen.log_spacing[channel, p]
                evidence[f] += math.log(max(share, UNSURE))


@scalar
def shown(values, sensor, f, truth):
    """What a sensor shows of a true value, without noise."""
    return values[sensor + GAIN, f] * truth + values[sensor, f]


@scalar
def meant(values, sensor, f, reading):
    """The true value behind a reading without noise."""
    return (reading - values[sensor, f]) / max(values[sensor + GAIN, f], LEAST_GAIN)
