"""The filter bank's part of the algebra: filters of seven states, see `bank.algebra`.

Readings have heavy tails, deviations of the healthy vehicle change slowly, and filters merge.
"""

import math
from typing import NamedTuple

from auv_fault_env.compiling import part
from auv_fault_env.noise import logarithm
from diagnosers.bank.algebra import (
    LOG_TWO_PI,
    covariance_row,
    covary,
    forget_state,
    mixed_covariance,
    moments_of,
    take_available,
    update_states,
)

N_STATES = 7
SEVERITY = N_STATES - 1
N_MOMENTS = moments_of(N_STATES)
SEVERITY_VARIANCE = N_MOMENTS - 1  # row of a table of filters
# An innovation of more standard deviations counts as one of eight: no single sample decides.
MAX_SQUARED_INNOVATION = 64.0
MIN_MIXING = 1e-4  # probability below which a filter is not mixed into another


class Tails(NamedTuple):
    """The distribution of readings: Student's t.

    `scale` is its squared scale per variance of the noise, such that Gaussian readings give no
    preference to a filter with another variance than theirs.
    """

    freedom: float
    scale: float


@part
def merge(source, target, share, work):
    """Let a column hold the moments of a mixture of itself and another, which has that share."""
    x = work.filters
    for i in range(SEVERITY):
        for j in range(i + 1):
            row = covariance_row(i, j, N_STATES)
            between = (x[i, source] - x[i, target]) * (x[j, source] - x[j, target])
            x[row, target] = mixed_covariance(x[row, target], x[row, source], between, share)
    for i in range(SEVERITY):
        x[i, target] += share * (x[i, source] - x[i, target])


@part
def walk_deviations(columns, healthy_variance, memory, work):
    """Let the healthy vehicle's deviations change slowly, and those of a hypothesis that began.

    Of a deviation the share `memory` is left; its variance tends towards `healthy_variance`
    (SEVERITY,). A hypothesis has ``work.spread`` times as much more, from its beginning on.
    """
    first, last = columns
    for i in range(SEVERITY):
        if healthy_variance[i] > 0.0:
            row = covariance_row(i, i, N_STATES)
            for c in range(first, last):
                spread = work.spread[c] * healthy_variance[i]
                work.filters[row, c] += work.mixing_probability[c] * spread
                work.added[c] = (1.0 - memory * memory) * (healthy_variance[i] + spread)
            forget_state(columns, i, memory, work.added, work)


@part
def condition(columns, available, tails, work):
    """Condition every filter on the measurement where available, as `bank.algebra.condition`.

    The density is Student's t, whose heavy tails bound what one sample decides. The weight of the
    innovation in the update is that of the scale mixture of Gaussians, so that an outlier moves no
    state. Fill ``work.standardised``, the innovation by its scale, NaN where not available.
    """
    first, last = columns
    take_available(columns, available, work)
    covary(columns, work)
    for c in range(first, last):
        innovation = work.innovation[c]
        noise = work.variance[c]
        is_available = work.is_available[c]
        # rounding must not make the states' part of the variance negative
        total = max(noise + work.variance_by_states[c], noise)
        scale = tails.scale * total
        square = min(innovation * innovation / scale, MAX_SQUARED_INNOVATION)
        relative = 1.0 + square / tails.freedom
        misfit = LOG_TWO_PI + logarithm(scale) + (tails.freedom + 1.0) * logarithm(relative)
        work.evidence[c] -= is_available * 0.5 * misfit
        # of the innovation: 1 in the middle, falling with its square
        weight = min(1.0, (tails.freedom + 1.0) / (tails.freedom * relative))
        work.weight[c] = weight
        work.standardised[c] = innovation / math.sqrt(scale) if is_available > 0.0 else math.nan
        work.gain[c] = is_available * weight / (noise + weight * (total - noise))
        largest = math.sqrt(MAX_SQUARED_INNOVATION * scale)
        work.innovation[c] = min(max(innovation, -largest), largest)
    update_states(columns, work)


@part
def keep_standardised(columns, row, work):
    """Keep the last standardised innovation as that of a reading."""
    first, last = columns
    for c in range(first, last):
        work.innovations[row, c] = work.standardised[c]
