"""Sums of probabilities by their logarithms, with functions that vectorise, as libm's do not."""

import math

import numpy as np

from auv_fault_env.compiling import fused, scalar
from auv_fault_env.noise import U52

LEAST_EXPONENT = -708.0  # below, the exponential counts as 0
LOG2_E = 1.0 / math.log(2.0)
# ln 2 as the sum of two numbers, the first of few bits
LN2_HIGH = 6.93147180369123816490e-01
LN2_LOW = 1.90821492927058770002e-10
ROUNDING = 1.5 * 2.0**52  # added, it leaves an integer in the lowest bits
BIAS = np.uint64(1023)  # of the exponent of a float
TAYLOR = tuple(1.0 / math.factorial(n) for n in range(13, -1, -1))
ATANH = tuple(1.0 / n for n in range(31, 0, -2))


@scalar
def exponential(x):
    """Exponential of a number that is not positive, to 1e-15 of it."""
    bounded = max(x, LEAST_EXPONENT)
    shifted = fused(bounded, LOG2_E, ROUNDING)
    n = shifted - ROUNDING
    rest = fused(-n, LN2_LOW, fused(-n, LN2_HIGH, bounded))
    series = 0.0
    for k in range(len(TAYLOR)):
        series = fused(series, rest, TAYLOR[k])
    power = (np.float64(shifted).view(np.uint64) + BIAS) << U52
    return series * np.uint64(power).view(np.float64) if x >= LEAST_EXPONENT else 0.0


@scalar
def log_one_plus(x):
    """Logarithm of 1 + x for x in [0, 1], to 1e-15 of it: the series of atanh."""
    s = x / (2.0 + x)
    z = s * s
    series = 0.0
    for k in range(len(ATANH)):
        series = fused(series, z, ATANH[k])
    return 2.0 * s * series


@scalar
def log_sum(log_a, log_b):
    """Logarithm of the sum of two numbers, from their logarithms, of which one is finite."""
    high = max(log_a, log_b)
    return high + log_one_plus(exponential(min(log_a, log_b) - high))


@scalar
def share_of_second(log_a, log_b):
    """Share of the second of two numbers in their sum, from their logarithms."""
    ratio = exponential(-abs(log_b - log_a))
    share = 1.0 / (1.0 + ratio)
    return share if log_b > log_a else ratio * share
