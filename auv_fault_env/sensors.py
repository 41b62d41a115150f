"""Compiled loops of the sensors: from true values to readings."""

import math

import numpy as np
from numba.np.unsafe.ndarray import to_fixed_tuple

from auv_fault_env import layout as row
from auv_fault_env import physics
from auv_fault_env.compiling import kernel, scalar
from auv_fault_env.layout import LANES
from auv_fault_env.noise import (
    CHANCE_WORD,
    OUTLIER_WORD,
    channel_uniform,
    random_bits,
    sine,
)
from auv_fault_env.parameters import RIPPLE_FREQUENCY, SAMPLE_TIME
from auv_fault_env.physics import RPM, clipped
from auv_fault_env.realism import N_CONVERSION, N_SURROUNDINGS, Conversion
from auv_fault_env.surroundings import surroundings_from_array

# row of the true value behind each reading, and factor of its unit
TRUE_ROW = (
    row.SPEED,
    row.ACCELERATION,
    row.PORT_VOLTAGE,
    row.PORT_CURRENT,
    row.PORT_SHAFT_SPEED,
    row.STARBOARD_VOLTAGE,
    row.STARBOARD_CURRENT,
    row.STARBOARD_SHAFT_SPEED,
)
TRUE_FACTOR = (1.0, 1.0, 1.0, 1.0, RPM, 1.0, 1.0, RPM)


@scalar
def conversion_from_array(effects, channel):
    """The `Conversion` of one reading in `realism.kernel_values`."""
    first = N_SURROUNDINGS + N_CONVERSION * channel
    return Conversion(*to_fixed_tuple(effects[first:], N_CONVERSION))


@kernel
def sample_words(words, width, key, step, first):
    """Write the random bits of each lane (2, n_lanes), from the word `first` on."""
    for i in range(2):
        word = first + np.uint64(i)
        for k in range(width):
            words[i, k] = random_bits(key[k], step[k], word)


@kernel
def write_signals(block, scratch, width, effects):
    """Write what acts on the sensors, in the units of their readings, into the scratch rows."""
    world = surroundings_from_array(effects)
    for channel in range(row.N_READINGS):
        true_row = TRUE_ROW[channel] * LANES
        signal = (row.SIGNAL_VALUE + channel) * LANES
        factor = TRUE_FACTOR[channel]
        for k in range(width):
            scratch[signal + k] = factor * block[true_row + k]
    wheel = (row.SIGNAL_VALUE + row.SPEED_READING - row.READING) * LANES
    acceleration = (row.SIGNAL_VALUE + row.ACCELERATION_READING - row.READING) * LANES
    for k in range(width):
        pitch = block[row.PITCH * LANES + k]
        roll = block[row.ROLL * LANES + k]
        scratch[wheel + k] += block[row.WHEEL_NOISE * LANES + k]
        scratch[acceleration + k] += physics.gravity_felt(pitch, roll, world.cross_axis)


@kernel
def start_history(block, scratch, width, effects):
    """Let the signals be what they are since long ago."""
    write_signals(block, scratch, width, effects)
    for channel in range(row.N_READINGS):
        for place in range(row.N_HISTORY):
            past = (row.HISTORY + row.N_HISTORY * channel + place) * LANES
            for k in range(width):
                block[past + k] = scratch[(row.SIGNAL_VALUE + channel) * LANES + k]


@kernel
def delay_signals(block, scratch, width, step):
    """Store the signals, and put those in their place that are as old as the latencies."""
    for channel in range(row.N_READINGS):
        signal = (row.SIGNAL_VALUE + channel) * LANES
        history = (row.HISTORY + row.N_HISTORY * channel) * LANES
        latency = (row.SIGNALS + row.N_SIGNAL_PARAMETERS * channel) * LANES
        for k in range(width):
            block[history + (step[k] % row.N_HISTORY) * LANES + k] = scratch[signal + k]
            late = np.int64(block[latency + k] + 0.5)
            place = (step[k] - late) % row.N_HISTORY
            scratch[signal + k] = block[history + place * LANES + k]


@scalar
def outlier(chance, probability, size):
    """A positive or a negative outlier, equally likely, or 0."""
    positive = size if chance < probability else 0.0
    return -size if chance < 0.5 * probability else positive


@kernel
def convert_signals(block, scratch, width, key, step, effects):
    """Put what the converters give in the place of the signals."""
    probability = surroundings_from_array(effects).outlier_probability
    words = np.empty((2, LANES), np.uint64)
    sample_words(words, width, key, step, OUTLIER_WORD)
    for k in range(width):
        turns = RIPPLE_FREQUENCY * SAMPLE_TIME * step[k]
        scratch[row.RIPPLE * LANES + k] = sine(turns - math.floor(turns))
    for channel in range(row.N_READINGS):
        converter = conversion_from_array(effects, channel)
        chances = words[channel // 4]
        value = (row.SIGNAL_VALUE + channel) * LANES
        sensor = (row.SENSORS + row.N_SENSOR_PARAMETERS * channel) * LANES
        ripple = (row.SIGNALS + row.N_SIGNAL_PARAMETERS * channel + 1) * LANES
        normal = (row.NORMAL + channel) * LANES
        for k in range(width):
            signal = scratch[value + k]
            fresh = physics.fresh_reading(
                signal,
                block[sensor + k],
                block[sensor + LANES + k],
                block[sensor + 2 * LANES + k],
                scratch[normal + k],
            )
            fresh += block[ripple + k] * scratch[row.RIPPLE * LANES + k]
            chance = channel_uniform(chances[k], channel)
            fresh += outlier(chance, probability, converter.outlier)
            counted = fresh if abs(signal) >= converter.least else 0.0
            scratch[value + k] = physics.converted(counted, converter)


@kernel
def read_real_sensors(block, scratch, width, key, step, limits, effects):
    """As `read_sensors`, with the imperfections of `realism.kernel_values`."""
    write_signals(block, scratch, width, effects)
    delay_signals(block, scratch, width, step)
    convert_signals(block, scratch, width, key, step, effects)
    words = np.empty((2, LANES), np.uint64)
    sample_words(words, width, key, step, CHANCE_WORD)
    for channel in range(row.N_READINGS):
        chances = words[channel // 4]
        read_into = row.READING + channel
        sensor = (row.SENSORS + row.N_SENSOR_PARAMETERS * channel) * LANES
        low = limits[read_into, 0]
        high = limits[read_into, 1]
        for k in range(width):
            unlimited = physics.reported(
                scratch[(row.SIGNAL_VALUE + channel) * LANES + k],
                block[sensor + 3 * LANES + k],
                block[sensor + 4 * LANES + k],
                channel_uniform(chances[k], channel),
                block[read_into * LANES + k],
            )
            block[read_into * LANES + k] = clipped(unlimited, low, high)


@kernel
def read_sensors(block, scratch, width, key, step, limits):
    """Write the readings of every sensor of every lane."""
    words = np.empty((2, LANES), np.uint64)
    sample_words(words, width, key, step, CHANCE_WORD)
    for channel in range(row.N_READINGS):
        chances = words[channel // 4]
        read_into = row.READING + channel
        true_row = TRUE_ROW[channel]
        factor = TRUE_FACTOR[channel]
        sensor = (row.SENSORS + row.N_SENSOR_PARAMETERS * channel) * LANES
        normal = (row.NORMAL + channel) * LANES
        low = limits[read_into, 0]
        high = limits[read_into, 1]
        for k in range(width):
            fresh = physics.fresh_reading(
                factor * block[true_row * LANES + k],
                block[sensor + k],
                block[sensor + LANES + k],
                block[sensor + 2 * LANES + k],
                scratch[normal + k],
            )
            unlimited = physics.reported(
                fresh,
                block[sensor + 3 * LANES + k],
                block[sensor + 4 * LANES + k],
                channel_uniform(chances[k], channel),
                block[read_into * LANES + k],
            )
            block[read_into * LANES + k] = clipped(unlimited, low, high)
