"""Counter-based noise: random numbers depend on key, step and channel alone.

So any lane of any batch can be replayed. The bits are those of SplitMix64; normals follow by Box
and Muller, with a logarithm and a sine that vectorise over lanes, as those of libm do not.
"""

import math

import numpy as np

from auv_fault_env.compiling import kernel, scalar

# Streams of uniform numbers of one lane, by purpose. A number never changes its purpose: else the
# episodes of all seeds would change.
STREAMS = {
    "healthy_parameters": 0,
    "fault_events": 1,
    "number_of_faults": 2,
    "mission": 3,
    "steering": 4,
    "stand_in_onset": 5,
    "random_instants": 6,
    "constant_speed": 7,
}
# random words of one step: five pairs of normals, the chances of stuck and dropped samples, those
# of outliers, two pairs of normals of the surroundings, and the change of the water's current
WORDS_PER_STEP = np.uint64(16)
CHANCE_WORD = np.uint64(8)
OUTLIER_WORD = np.uint64(10)
ANGLE_WORD = np.uint64(12)
WHEEL_WORD = np.uint64(13)
WATER_WORD = np.uint64(14)
GOLDEN = np.uint64(0x9E3779B97F4A7C15)
MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
MIX_2 = np.uint64(0x94D049BB133111EB)
U12, U27, U30, U31, U32, U52 = map(np.uint64, (12, 27, 30, 31, 32, 52))
LOW_16, LOW_32, LOW_52 = (np.uint64((1 << bits) - 1) for bits in (16, 32, 52))
TWO_52 = 4503599627370496.0
BITS_OF_ONE = np.uint64(0x3FF0000000000000)
BITS_OF_TWO_52 = np.uint64(0x4330000000000000)


@scalar
def mix_bits(word):
    """SplitMix64's finaliser (Steele, Lea & Flood 2014, doi:10.1145/2714064.2660195)."""
    word = (word ^ (word >> U30)) * MIX_1
    word = (word ^ (word >> U27)) * MIX_2
    return word ^ (word >> U31)


@scalar
def random_bits(key, step, word):
    """64 random bits of (key, step, word): SplitMix64's output at that place."""
    return mix_bits(key + (np.uint64(step) * WORDS_PER_STEP + word) * GOLDEN)


@scalar
def float_of_integer(word):
    """An integer below 2^52 as a float, by its bits: a conversion that vectorises everywhere."""
    return np.uint64(word | BITS_OF_TWO_52).view(np.float64) - TWO_52


@scalar
def logarithm(x):
    """Natural logarithm of a normal positive number, to 1e-9: atanh series on the mantissa."""
    bits = np.float64(x).view(np.uint64)
    exponent = float_of_integer(bits >> U52) - 1023.0
    mantissa = np.uint64((bits & LOW_52) | BITS_OF_ONE).view(np.float64)
    high = mantissa > 1.4142135623730951
    mantissa = 0.5 * mantissa if high else mantissa
    exponent = exponent + 1.0 if high else exponent
    s = (mantissa - 1.0) / (mantissa + 1.0)
    z = s * s
    series = 1 / 7 + z * (1 / 9 + z * (1 / 11 + z * (1 / 13)))
    series = 1.0 + z * (1 / 3 + z * (1 / 5 + z * series))
    return 0.6931471805599453 * exponent + 2.0 * s * series


@scalar
def sine_of_turns(x):
    """Sine of 2 pi x for x in [-1/4, 1/4], to 1e-11."""
    y = 2.0 * math.pi * x
    z = y * y
    series = 1 / 39916800 + z * (-1 / 6227020800 + z * (1 / 1307674368000))
    series = -1 / 6 + z * (1 / 120 + z * (-1 / 5040 + z * (1 / 362880 - z * series)))
    return y + y * z * series


@scalar
def sine(turn):
    """Sine of 2 pi x for x in [0, 1)."""
    shifted = turn - 0.25 if turn >= 0.25 else turn + 0.75
    return sine_of_turns(abs(shifted - 0.5) - 0.25)


@scalar
def upper_half_of_word(word):
    """A uniform number in [0, 1) from the upper 32 bits of a word."""
    return float_of_integer(word >> U32) * 2.0**-32


@scalar
def lower_half_of_word(word):
    """A uniform number in [0, 1) from the lower 32 bits of a word."""
    return float_of_integer(word & LOW_32) * 2.0**-32


@scalar
def normal_pair(word):
    """Two independent standard normals from 64 random bits (Box & Muller 1958), bounded by 6.8."""
    uniform = upper_half_of_word(word) + 0.5 * 2.0**-32
    radius = math.sqrt(-2.0 * logarithm(uniform))
    turn = lower_half_of_word(word)
    cosine = sine_of_turns(abs(turn - 0.5) - 0.25)
    return radius * cosine, radius * sine(turn)


@scalar
def channel_uniform(word, channel):
    """A uniform number in [0, 1) from the 16 bits of a word that belong to a channel."""
    shift = np.uint64(16 * (channel % 4))
    return float_of_integer((word >> shift) & LOW_16) * 2.0**-16


@kernel
def episode_keys(seed, episode):
    """Noise keys (n_lanes,) of the given episodes of the given seeds, both uint64 (n_lanes,)."""
    keys = np.empty_like(seed)
    for k in range(seed.size):
        seed_bits = mix_bits(seed[k] + GOLDEN)
        keys[k] = mix_bits(seed_bits ^ (episode[k] * MIX_1))
    return keys


@kernel
def uniforms(key, stream, count):
    """Uniform numbers in (0, 1), (n_lanes, count), from one of the `STREAMS` of each lane's key."""
    out = np.empty((key.size, count))
    for k in range(key.size):
        stream_bits = (np.uint64(stream) + np.uint64(1)) * MIX_2
        start = mix_bits(key[k] ^ stream_bits)
        for c in range(count):
            word = mix_bits(start + np.uint64(c + 1) * GOLDEN)
            out[k, c] = (float_of_integer(word >> U12) + 0.5) * 2.0**-52
    return out
