"""The readings of a sample, see `bank.sensors`: how they are rounded, and those of exactly zero."""

import math

from auv_fault_env.compiling import part, scalar
from diagnosers.bank.pack import columns_of_lane
from diagnosers.bank.sensors import (
    N_READINGS,
    NOISE,
    NOISE_STD,
    RESOLUTION,
    fill_readings,
    log_spacing,
)

MIN_ZERO = 2e-4  # probability of a reading of zero, whatever is expected
MIN_NATURAL = 0.03  # probability of a repeated reading below which it is negligible
MAX_ROUNDING = 100.0  # standard deviations of noise, of the step that counts as rounding


@scalar
def spacing_of_values(spacing, now, before):
    """Distance of the values that a sensor reports: the least difference of two readings so far.

    A converter reports multiples of its step; the readings of one without steps come ever closer
    to one another. NaN before two readings differed.
    """
    difference = abs(now - before)
    is_less = difference < spacing or math.isnan(spacing)
    return difference if difference > 0.0 and is_less else spacing


@part
def fill_sample(observation, last, spacing, noise_ratio, sensors, sample):
    """Fill a sample from the observation (n_lanes, n_channels), where NaN means no reading.

    last (n_lanes, N_READINGS): the last readings. spacing (n_lanes, N_READINGS): see
    `spacing_of_values`, updated. noise_ratio (n_lanes, N_READINGS): see `BankState`. sensors
    (N_READINGS, 4): see `LOW`.
    """
    fill_readings(observation, last, sensors, sample)
    for lane in range(len(last)):
        for channel in range(N_READINGS):
            value = sample.reading[channel, lane]
            sample.resting[channel, lane] = False
            noise = sensors[channel, NOISE_STD]
            if not sample.silent[channel, lane]:
                before = last[lane, channel]
                spacing[lane, channel] = spacing_of_values(spacing[lane, channel], value, before)
            step = spacing[lane, channel]
            if math.isnan(step):
                step = noise
            step = max(step, sensors[channel, RESOLUTION])
            rounding = min(step, MAX_ROUNDING * noise)
            by_noise = (noise_ratio[lane, channel] - 1.0) * noise * noise
            sample.excess[channel, lane] = rounding * rounding / 12.0 + by_noise
            std = math.sqrt(noise * noise + rounding * rounding / 12.0)
            natural = step / (2.0 * math.sqrt(math.pi) * std)
            is_coarse = natural > MIN_NATURAL
            sample.natural[channel, lane] = min(natural, 1.0) if is_coarse else 0.0
            sample.log_spacing[channel, lane] = log_spacing(value, step, noise)


@part
def keep_evidence(columns, work):
    """Keep the evidence from before a reading."""
    first, last = columns
    for c in range(first, last):
        work.evidence_before[c] = work.evidence[c]


@part
def replace_evidence(columns, lanes, evidence, work):
    """Let the evidence be another one on some lanes, (n_lanes,)."""
    n_lanes = lanes.size
    for lane in range(n_lanes):
        if lanes[lane]:
            first, last = columns_of_lane(lane, columns, n_lanes)
            for c in range(first, last):
                work.evidence[c] = evidence[c]


@part
def begin_zero(columns, sample, channel, sensor, available, work):
    """Find the evidence of readings of exactly zero, which is a probability and not a density.

    A sensor of one direction reads zero for all that is less, so that the probability is that of
    a negative reading. ``work.expected`` and ``work.expected_std`` are those of the reading. Where
    about zero is expected, nothing else follows from it. `end_zero` counts the evidence.
    """
    n_lanes = sample.deflection.size
    for lane in range(n_lanes):
        if sample.zero[channel, lane]:
            first, last = columns_of_lane(lane, columns, n_lanes)
            for c in range(first, last):
                distance = work.expected[c] / work.expected_std[c]
                probability = 0.5 * math.erfc(distance * math.sqrt(0.5))
                log_probability = math.log(max(probability, MIN_ZERO))
                density = log_probability - sample.log_spacing[channel, lane]
                work.evidence_of_zero[c] = work.evidence[c] + available[c] * density
                if work.expected[c] < work.parameters[sensor + NOISE, c]:
                    available[c] = 0.0


@part
def end_zero(columns, sample, channel, work):
    """Let the evidence of readings of exactly zero be what `begin_zero` has found."""
    replace_evidence(columns, sample.zero[channel], work.evidence_of_zero, work)
