"""The algebra of the filter bank's filters: as `bank.algebra`, but of seven states.

Readings have heavy tails, deviations of the healthy vehicle change slowly, and filters merge.

Sources: Blom & Bar-Shalom, "The interacting multiple model algorithm for systems with Markovian
switching coefficients", IEEE Trans. Autom. Control 33(8), 1988, doi:10.1109/9.1299 (`mix`);
Jeffrey, "The Logic of Decision", McGraw-Hill 1965, ch. 11 (`replace_severity`).
"""

import math
from typing import NamedTuple

from auv_fault_env.compiling import inlined, scalar
from auv_fault_env.noise import logarithm
from diagnosers.bank.algebra import LOG_TWO_PI, MAX_DEVIATION, MIN_VARIANCE, variance_after_walk

N_STATES = 7
SEVERITY = N_STATES - 1
SEVERITY_VARIANCE = N_STATES + SEVERITY * (SEVERITY + 3) // 2  # row of a table of filters
N_MOMENTS = SEVERITY_VARIANCE + 1
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


@scalar
def covariance_row(i, j):
    """Row of the covariance of states i and j."""
    high = max(i, j)
    low = min(i, j)
    return N_STATES + high * (high + 1) // 2 + low


@inlined
def mix(columns, healthy_variance, work):
    """Mix each filter with the normal one of its lane, by ``work.mixing_probability``.

    That is the probability that the vehicle, if the hypothesis is true, left the normal hypothesis
    at this sample. Its severity then has the moments ``work.prior``, and its other states have
    ``work.spread`` times the `healthy_variance` (SEVERITY,) more variance.
    """
    first, last = columns
    x = work.filters
    normal = work.normal
    probability = work.mixing_probability
    prior_mean = work.prior[0]
    prior_variance = work.prior[1]
    for i in range(N_STATES - 1, -1, -1):
        for j in range(i, -1, -1):
            row = covariance_row(i, j)
            for c in range(first, last):
                mean_i = prior_mean[c] if i == SEVERITY else normal[i, c]
                distance_i = mean_i - x[i, c]
                mean_j = prior_mean[c] if j == SEVERITY else normal[j, c]
                distance_j = mean_j - x[j, c]
                covariance = normal[row, c]
                if i == SEVERITY:
                    covariance = prior_variance[c] if j == SEVERITY else 0.0
                elif i == j:
                    covariance += work.spread[c] * healthy_variance[i]
                stay = 1.0 - probability[c]
                stayed = stay * x[row, c]
                switched = covariance + stay * distance_i * distance_j
                x[row, c] = stayed + probability[c] * switched
    for i in range(N_STATES):
        for c in range(first, last):
            mean = prior_mean[c] if i == SEVERITY else normal[i, c]
            x[i, c] += probability[c] * (mean - x[i, c])


@inlined
def merge(source, target, share, work):
    """Let a column hold the moments of a mixture of itself and another, which has that share."""
    x = work.filters
    for i in range(SEVERITY):
        for j in range(i + 1):
            row = covariance_row(i, j)
            between = (x[i, source] - x[i, target]) * (x[j, source] - x[j, target])
            within = x[row, source] - x[row, target]
            x[row, target] += share * (within + (1.0 - share) * between)
    for i in range(SEVERITY):
        x[i, target] += share * (x[i, source] - x[i, target])


@inlined
def walk_states(columns, healthy_variance, memory, severity_walk, work):
    """Let the severities walk over a sample, and the healthy vehicle's deviations change slowly.

    Of a deviation the share `memory` is left; its variance tends towards `healthy_variance`.
    """
    first, last = columns
    x = work.filters
    prior_variance = work.prior[1]
    for c in range(first, last):
        variance = x[SEVERITY_VARIANCE, c]
        walked = variance_after_walk(variance, prior_variance[c], severity_walk)
        x[SEVERITY_VARIANCE, c] = walked
    for i in range(SEVERITY):
        if healthy_variance[i] > 0.0:
            for c in range(first, last):
                stationary = (1.0 + work.spread[c]) * healthy_variance[i]
                work.added[c] = (1.0 - memory * memory) * stationary
            forget_state(columns, i, memory, work.added, work)


@inlined
def forget_state(columns, state, memory, added, work):
    """Let a state decay to `memory` of itself, and add the variance `added` (n_columns,)."""
    first, last = columns
    x = work.filters
    for i in range(N_STATES):
        row = covariance_row(i, state)
        factor = memory * memory if i == state else memory
        for c in range(first, last):
            x[row, c] *= factor
    for c in range(first, last):
        x[state, c] *= memory
        x[covariance_row(state, state), c] += added[c]


@inlined
def replace_severity(columns, work):
    """Replace mean and variance of the severities by ``work.severity``; the other states follow.

    By Jeffrey's rule, exact if the subsystems are independent at a given severity.
    """
    first, last = columns
    x = work.filters
    mean = work.severity[0]
    variance = work.severity[1]
    shift = work.severity_shift
    growth = work.variance_growth
    for c in range(first, last):
        before = x[SEVERITY_VARIANCE, c]
        scale = 1.0 / before if before > MIN_VARIANCE else 0.0
        shift[c] = (mean[c] - x[SEVERITY, c]) * scale
        growth[c] = (variance[c] - before) * scale * scale
    for i in range(SEVERITY):
        row_i = covariance_row(SEVERITY, i)
        for c in range(first, last):
            x[i, c] += x[row_i, c] * shift[c]
        for j in range(i + 1):
            row = covariance_row(i, j)
            row_j = covariance_row(SEVERITY, j)
            for c in range(first, last):
                x[row, c] += x[row_i, c] * x[row_j, c] * growth[c]
    for i in range(SEVERITY):
        row_i = covariance_row(SEVERITY, i)
        for c in range(first, last):
            x[row_i, c] *= 1.0 + growth[c] * x[SEVERITY_VARIANCE, c]
    for c in range(first, last):
        before = x[SEVERITY_VARIANCE, c]
        x[SEVERITY_VARIANCE, c] += growth[c] * before * before
        x[SEVERITY, c] = mean[c]


@inlined
def clip_deviations(columns, deviations, work):
    """Keep the healthy deviations, a range of states, where no parameter changes its sign."""
    first, last = columns
    x = work.filters
    for i in deviations:
        for c in range(first, last):
            x[i, c] = min(max(x[i, c], -MAX_DEVIATION), MAX_DEVIATION)


@inlined
def covary(columns, gradient, work):
    """Fill ``work.covariance`` of the states with a quantity of that gradient."""
    first, last = columns
    x = work.filters
    for i in range(N_STATES):
        row_0 = covariance_row(i, 0)
        row_1 = covariance_row(i, 1)
        row_2 = covariance_row(i, 2)
        row_3 = covariance_row(i, 3)
        row_4 = covariance_row(i, 4)
        row_5 = covariance_row(i, 5)
        row_6 = covariance_row(i, 6)
        for c in range(first, last):
            total = x[row_0, c] * gradient[0, c]
            total += x[row_1, c] * gradient[1, c]
            total += x[row_2, c] * gradient[2, c]
            total += x[row_3, c] * gradient[3, c]
            total += x[row_4, c] * gradient[4, c]
            total += x[row_5, c] * gradient[5, c]
            total += x[row_6, c] * gradient[6, c]
            work.covariance[i, c] = total


@inlined
def condition(columns, measurement, tails, work):
    """Condition every filter on a measurement where available; add its log density to the evidence.

    The density is Student's t, whose heavy tails bound what one sample decides. The weight of the
    innovation in the update is that of the scale mixture of Gaussians, so that an outlier moves no
    state.
    """
    first, last = columns
    x = work.filters
    gradient, innovation, variance, available = measurement
    covariance = work.covariance
    gain = work.gain
    covary(columns, gradient, work)
    for c in range(first, last):
        by_states = gradient[0, c] * covariance[0, c]
        by_states += gradient[1, c] * covariance[1, c]
        by_states += gradient[2, c] * covariance[2, c]
        total = variance[c] + by_states
        total += gradient[3, c] * covariance[3, c]
        total += gradient[4, c] * covariance[4, c]
        total += gradient[5, c] * covariance[5, c]
        total += gradient[6, c] * covariance[6, c]
        # rounding must not make the states' part of the variance negative
        total = max(total, variance[c])
        scale = tails.scale * total
        square = min(innovation[c] * innovation[c] / scale, MAX_SQUARED_INNOVATION)
        relative = 1.0 + square / tails.freedom
        misfit = LOG_TWO_PI + logarithm(scale) + (tails.freedom + 1.0) * logarithm(relative)
        work.evidence[c] -= available[c] * 0.5 * misfit
        # of the innovation: 1 in the middle, falling with its square
        weight = min(1.0, (tails.freedom + 1.0) / (tails.freedom * relative))
        work.weight[c] = weight
        gain[c] = available[c] * weight / (variance[c] + weight * (total - variance[c]))
        largest = math.sqrt(MAX_SQUARED_INNOVATION * scale)
        innovation[c] = min(max(innovation[c], -largest), largest)
    for i in range(N_STATES):
        for c in range(first, last):
            x[i, c] += gain[c] * covariance[i, c] * innovation[c]
        for j in range(i + 1):
            row = covariance_row(i, j)
            for c in range(first, last):
                x[row, c] -= gain[c] * covariance[i, c] * covariance[j, c]
