"""The readings of a sample: which are silent or repeat, and how probable that is."""

import math
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import COMMANDS, READINGS
from auv_fault_env.compiling import inlined, scalar

# channels of an observation
FIRST_READING = len(COMMANDS)
N_READINGS = len(READINGS)
RUDDER = COMMANDS.index("rudder")
STERN_PLANE = COMMANDS.index("stern_plane")
# parameters of a sensor, counted from its first row
BIAS, GAIN, NOISE, STUCK, DROPOUT = range(5)
N_SENSOR_ROWS = 5
# columns of `diagnosers.bank.base.BankConstants.sensors`
LOW, HIGH, NOISE_STD, RESOLUTION = range(4)
FLOAT32_STEP = 2.0**-23  # relative distance of neighbouring values
MIN_PROBABILITY = 0.01  # of a lost or of an available sample of a faulty sensor
MIN_GAIN = 1e-3


class Sample(NamedTuple):
    """The readings of one sample of a pack, (N_READINGS, n_lanes); deflection is (n_lanes,)."""

    reading: np.ndarray  # the last one where there is none now, 0 where there never was any
    repeated: np.ndarray  # whether it equals the last one
    zero: np.ndarray  # whether it is 0
    silent: np.ndarray  # whether there is none
    replaced: np.ndarray  # whether the last one replaces one that is silent
    log_spacing: np.ndarray  # logarithm of the distance of values that the sensor can report there
    deflection: np.ndarray  # rudder and stern plane, squared and summed [rad^2]


def new_sample(n_lanes: int) -> Sample:
    """Memory for a sample."""
    shape = N_READINGS, n_lanes
    return Sample(
        reading=np.zeros(shape),
        repeated=np.zeros(shape, bool),
        zero=np.zeros(shape, bool),
        silent=np.zeros(shape, bool),
        replaced=np.zeros(shape, bool),
        log_spacing=np.zeros(shape),
        deflection=np.zeros(n_lanes),
    )


@inlined
def fill_sample(observation, last, sensors, sample):
    """Fill a sample from the observation (n_lanes, n_channels), where NaN means no reading.

    last (n_lanes, N_READINGS): the last readings. sensors (N_READINGS, 4): see `LOW`.
    """
    for lane in range(len(last)):
        rudder = observation[lane, RUDDER]
        plane = observation[lane, STERN_PLANE]
        sample.deflection[lane] = rudder * rudder + plane * plane
        for channel in range(N_READINGS):
            now = observation[lane, FIRST_READING + channel]
            before = last[lane, channel]
            silent = math.isnan(now)
            replaced = silent and not math.isnan(before)
            value = now
            if silent:
                value = before if replaced else 0.0
            clipped = value <= sensors[channel, LOW] or value >= sensors[channel, HIGH]
            sample.reading[channel, lane] = value
            sample.silent[channel, lane] = silent
            sample.replaced[channel, lane] = replaced
            sample.repeated[channel, lane] = value == before and not clipped
            sample.zero[channel, lane] = value == 0.0
            size = max(abs(value), sensors[channel, NOISE_STD])
            spacing = max(size * FLOAT32_STEP, sensors[channel, RESOLUTION])
            sample.log_spacing[channel, lane] = math.log(spacing)


@inlined
def condition_on_availability(parameters, columns, sensor, sample, channel, available, evidence):
    """Fill which filters take the reading for available (1, else 0); add the log probability.

    `sensor` is the sensor's first row of parameters. The probability of a lost sample, which is a
    single value, counts over the spacing of values, to compare with a density.
    """
    n_lanes = np.uint64(sample.deflection.size)
    for lane in range(n_lanes):
        arrived = not sample.silent[channel, lane]
        for c in range(columns[0] + lane, columns[1], n_lanes):
            stuck = parameters[sensor + STUCK, c]
            dropout = parameters[sensor + DROPOUT, c]
            available[c] = 1.0 if arrived else 0.0
            if arrived and (stuck > 0.0 or dropout > 0.0):
                probability = (1.0 - stuck) * (1.0 - dropout)
                looks_stuck = sample.repeated[channel, lane] and stuck > 0.0
                if looks_stuck or (sample.zero[channel, lane] and dropout > 0.0):
                    available[c] = 0.0
                    probability = 1.0 - probability
                    evidence[c] -= sample.log_spacing[channel, lane]
                evidence[c] += math.log(max(probability, MIN_PROBABILITY))


@scalar
def reading_of(parameters, sensor, c, truth):
    """Reading of a true value, without noise."""
    return parameters[sensor + GAIN, c] * truth + parameters[sensor + BIAS, c]


@scalar
def truth_of(parameters, sensor, c, reading):
    """True value behind a reading without noise."""
    unbiased = reading - parameters[sensor + BIAS, c]
    return unbiased / max(parameters[sensor + GAIN, c], MIN_GAIN)
