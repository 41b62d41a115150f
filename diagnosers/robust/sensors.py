"""The readings of a sample: which are silent, repeat or are zero, and how probable that is."""

import math
from typing import NamedTuple

import numpy as np

from auv_fault_env.compiling import inlined, scalar
from diagnosers.bank.sensors import (
    DROPOUT,
    FIRST_READING,
    FLOAT32_STEP,
    HIGH,
    LOW,
    MIN_PROBABILITY,
    N_READINGS,
    NOISE,
    NOISE_STD,
    RESOLUTION,
    RUDDER,
    STERN_PLANE,
    STUCK,
)

MIN_ZERO = 2e-4  # probability of a reading of zero, whatever is expected
MIN_NATURAL = 0.03  # probability of a repeated reading below which it is negligible
MAX_ROUNDING = 100.0  # standard deviations of noise, of the step that counts as rounding


class Sample(NamedTuple):
    """The readings of one sample of a pack, (N_READINGS, n_lanes) if nothing else is said."""

    reading: np.ndarray  # the last one where there is none now, 0 where there never was any
    repeated: np.ndarray  # whether it equals the last one
    zero: np.ndarray  # whether it is 0
    silent: np.ndarray  # whether there is none
    replaced: np.ndarray  # whether the last one replaces one that is silent
    resting: np.ndarray  # whether it gives no evidence because shaft or vehicle stand
    rounding: np.ndarray  # variance by the rounding to the values that the sensor reports
    log_spacing: np.ndarray  # logarithm of the distance of these values
    natural: np.ndarray  # probability that a healthy sensor repeats itself; 0 if negligible
    deflection: np.ndarray  # (n_lanes,), rudder and stern plane, squared and summed [rad^2]
    idle: np.ndarray  # (n_lanes,), whether all readings are exactly zero


def new_sample(n_lanes: int) -> Sample:
    """Memory for a sample."""
    shape = N_READINGS, n_lanes
    numbers = ("reading", "rounding", "log_spacing", "natural")
    parts = {name: np.zeros(shape, float if name in numbers else bool) for name in Sample._fields}
    of_lanes = {"deflection": np.zeros(n_lanes), "idle": np.zeros(n_lanes, bool)}
    return Sample(**parts | of_lanes)


@scalar
def spacing_of_values(spacing, now, before):
    """Distance of the values that a sensor reports: the least difference of two readings so far.

    A converter reports multiples of its step; the readings of one without steps come ever closer
    to one another. NaN before two readings differed.
    """
    difference = abs(now - before)
    is_less = difference < spacing or math.isnan(spacing)
    return difference if difference > 0.0 and is_less else spacing


@inlined
def fill_sample(observation, last, spacing, sensors, sample):
    """Fill a sample from the observation (n_lanes, n_channels), where NaN means no reading.

    last (n_lanes, N_READINGS): the last readings. spacing (n_lanes, N_READINGS): see
    `spacing_of_values`, updated. sensors (N_READINGS, 4): see `LOW`.
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
            sample.resting[channel, lane] = False
            noise = sensors[channel, NOISE_STD]
            if not silent:
                spacing[lane, channel] = spacing_of_values(spacing[lane, channel], now, before)
            step = spacing[lane, channel]
            if math.isnan(step):
                step = noise
            step = max(step, sensors[channel, RESOLUTION])
            rounding = min(step, MAX_ROUNDING * noise)
            sample.rounding[channel, lane] = rounding * rounding / 12.0
            std = math.sqrt(noise * noise + rounding * rounding / 12.0)
            natural = step / (2.0 * math.sqrt(math.pi) * std)
            is_coarse = natural > MIN_NATURAL
            sample.natural[channel, lane] = min(natural, 1.0) if is_coarse else 0.0
            size = max(abs(value), noise)
            sample.log_spacing[channel, lane] = math.log(max(step, size * FLOAT32_STEP))


@inlined
def condition_on_availability(parameters, columns, sensor, sample, channel, available, evidence):
    """Fill which filters take the reading for available (1, else 0); add the log probability.

    `sensor` is the sensor's first row of parameters. The probability of a lost sample, which is a
    single value, counts over the spacing of values, to compare with a density. A repeated value of
    a coarse sensor is taken for a reading that a stuck sensor would make more probable.
    """
    n_lanes = np.uint64(sample.deflection.size)
    for lane in range(n_lanes):
        arrived = not (sample.silent[channel, lane] or sample.resting[channel, lane])
        for c in range(columns[0] + lane, columns[1], n_lanes):
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


@inlined
def begin_zero(columns, sample, channel, sensor, available, work):
    """Find the evidence of readings of exactly zero, which is a probability and not a density.

    A sensor of one direction reads zero for all that is less, so that the probability is that of
    a negative reading. ``work.expected`` and ``work.expected_std`` are those of the reading. Where
    about zero is expected, nothing else follows from it. `end_zero` counts the evidence.
    """
    first, last = columns
    n_lanes = np.uint64(sample.deflection.size)
    for lane in range(n_lanes):
        if sample.zero[channel, lane]:
            for c in range(first + lane, last, n_lanes):
                distance = work.expected[c] / work.expected_std[c]
                probability = 0.5 * math.erfc(distance * math.sqrt(0.5))
                log_probability = math.log(max(probability, MIN_ZERO))
                density = log_probability - sample.log_spacing[channel, lane]
                work.evidence_of_zero[c] = work.evidence[c] + available[c] * density
                if work.expected[c] < work.parameters[sensor + NOISE, c]:
                    available[c] = 0.0


@inlined
def end_zero(columns, sample, channel, work):
    """Let the evidence of readings of exactly zero be what `begin_zero` has found."""
    first, last = columns
    n_lanes = np.uint64(sample.deflection.size)
    for lane in range(n_lanes):
        if sample.zero[channel, lane]:
            for c in range(first + lane, last, n_lanes):
                work.evidence[c] = work.evidence_of_zero[c]
