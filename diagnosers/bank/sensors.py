"""The readings of a sample: which are silent or repeat, and how probable that is."""

import math
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import COMMANDS, READINGS
from auv_fault_env.compiling import part, scalar
from auv_fault_env.light import light
from diagnosers.bank.pack import columns_of_lane

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


@light
class Sample(NamedTuple):
    """The readings of one sample of a pack, (N_READINGS, n_lanes) if nothing else is said.

    For the Gaussian bank no reading rests or repeats naturally, and none is rounded.
    """

    reading: np.ndarray  # the last one where there is none now, 0 where there never was any
    excess: np.ndarray  # variance beyond the healthy noise: by rounding, and by noise as it is seen
    log_spacing: np.ndarray  # logarithm of the distance of these values
    natural: np.ndarray  # probability that a healthy sensor repeats itself; 0 if negligible
    repeated: np.ndarray  # whether it equals the last one
    zero: np.ndarray  # whether it is 0
    silent: np.ndarray  # whether there is none
    replaced: np.ndarray  # whether the last one replaces one that is silent
    resting: np.ndarray  # whether it gives no evidence because shaft or vehicle stand
    deflection: np.ndarray  # (n_lanes,), rudder and stern plane, squared and summed [rad^2]
    idle: np.ndarray  # (n_lanes,), whether all readings are exactly zero


def new_sample(n_lanes: int) -> Sample:
    """Memory for a sample."""
    numbers = np.zeros((4, N_READINGS, n_lanes))
    flags = np.zeros((5, N_READINGS, n_lanes), bool)
    return Sample(*numbers, *flags, np.zeros(n_lanes), np.zeros(n_lanes, bool))


@part
def fill_readings(observation, last, sensors, sample):
    """Fill what does not depend on the spacing of values, see `fill_sample`."""
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


@scalar
def log_spacing(value, spacing, noise):
    """Logarithm of the distance of the values that a sensor can report: float32 has its own."""
    size = max(abs(value), noise)
    return math.log(max(size * FLOAT32_STEP, spacing))


@part
def fill_sample(observation, last, sensors, sample):
    """Fill a sample from the observation (n_lanes, n_channels), where NaN means no reading.

    last (n_lanes, N_READINGS): the last readings. sensors (N_READINGS, 4): see `LOW`.
    """
    fill_readings(observation, last, sensors, sample)
    for lane in range(len(last)):
        for channel in range(N_READINGS):
            sample.log_spacing[channel, lane] = log_spacing(
                sample.reading[channel, lane],
                sensors[channel, RESOLUTION],
                sensors[channel, NOISE_STD],
            )


@part
def keep_readings(sample, readings):
    """Keep the last readings of a sample, (n_lanes, N_READINGS); NaN where there never was any."""
    for lane in range(len(readings)):
        for channel in range(N_READINGS):
            has_value = sample.replaced[channel, lane] or not sample.silent[channel, lane]
            readings[lane, channel] = sample.reading[channel, lane] if has_value else np.nan


@part
def condition_on_availability(parameters, columns, sensor, sample, channel, available, evidence):
    """Fill which filters take the reading for available (1, else 0); add the log probability.

    `sensor` is the sensor's first row of parameters. The probability of a lost sample, which is a
    single value, counts over the spacing of values, to compare with a density. A repeated value of
    a coarse sensor is taken for a reading that a stuck sensor would make more probable.
    """
    n_lanes = sample.deflection.size
    for lane in range(n_lanes):
        arrived = not (sample.silent[channel, lane] or sample.resting[channel, lane])
        first, last = columns_of_lane(lane, columns, n_lanes)
        for c in range(first, last):
            stuck = parameters[sensor + STUCK, c]
            dropout = parameters[sensor + DROPOUT, c]
            available[c] = 1.0 if arrived else 0.0
            if arrived and (stuck > 0.0 or dropout > 0.0):
                probability = (1.0 - stuck) * (1.0 - dropout)
                looks_stuck = sample.repeated[channel, lane] and stuck > 0.0
                natural = sample.natural[channel, lane]
                if looks_stuck and natural > 0.0:
                    probability += stuck / natural
                elif looks_stuck or (sample.zero[channel, lane] and dropout > 0.0):
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
