"""The algebra of all banks' filters: Gaussians, the severity their last state, many at once.

A table of filters is an array ``x`` (n_moments, n_columns): the means of the states, then the lower
triangle of the covariance, row by row. A column is one filter of one lane (`bank.pack`). The loops
over ``columns``, a range (first, last), vectorise because its numbers are unsigned. The compiler
writes out those over states within them, if the inner one's range depends on the outer one and
rows are those of `lower_row`: a column's moments are then read and written once. ``work`` is the
memory of `bank.pack`.

Sources: Blom & Bar-Shalom, "The interacting multiple model algorithm for systems with Markovian
switching coefficients", IEEE Trans. Autom. Control 33(8), 1988, doi:10.1109/9.1299 (`mix`);
Jeffrey, "The Logic of Decision", McGraw-Hill 1965, ch. 11 (`replace_severity`).
"""

import math

from auv_fault_env.compiling import fused, part, scalar
from auv_fault_env.noise import logarithm


def moments_of(n_states: int) -> int:
    """Rows of a table of filters of so many states."""
    return n_states * (n_states + 3) // 2


# of the Gaussian bank
N_STATES = 5
SEVERITY = N_STATES - 1
N_MOMENTS = moments_of(N_STATES)
SEVERITY_VARIANCE = N_MOMENTS - 1  # row of a table of filters
MAX_SQUARED_INNOVATION = 36.0  # normalised: the weight of one outlier is bounded
# of all banks
MAX_DEVIATION = 0.9  # from the nominal vehicle, relative; healthy vehicles are within 0.1
MIN_VARIANCE = 1e-12  # of a severity; below, it is certain
LOG_TWO_PI = math.log(2.0 * math.pi)


@scalar
def lower_row(i, j, n_states):
    """Row of the covariance of states i and j, of which j is not above i."""
    return n_states + i * (i + 1) // 2 + j


@scalar
def covariance_row(i, j, n_states):
    """Row of the covariance of states i and j."""
    return lower_row(max(i, j), min(i, j), n_states)


@scalar
def severity_rows(work):
    """Rows of the severity's mean and variance in a table of filters."""
    n_states = len(work.states)
    return n_states - 1, covariance_row(n_states - 1, n_states - 1, n_states)


@scalar
def mixed_covariance(covariance, other, between, share):
    """Covariance of a mixture with another distribution, which has that share.

    between: the product of the distances of both means.
    """
    stay = 1.0 - share
    return fused(share, other + stay * between, stay * covariance)


@scalar
def variance_after_walk(variance, prior, walk):
    """Variance of a severity after a sample of its walk, which slows down near the prior's."""
    step = walk * max(0.0, 1.0 - variance / max(prior, MIN_VARIANCE))
    return variance + step if variance > 0.0 else 0.0


@part
def mix(columns, work):
    """Mix each filter with ``work.normal``, by ``work.mixing_probability``.

    That is the probability that the vehicle, if the hypothesis is true, left the normal hypothesis
    at this sample.
    """
    first, last = columns
    x = work.filters
    normal = work.normal
    probability = work.mixing_probability
    n_states = len(work.states)
    for c in range(first, last):
        for i in range(n_states):
            for j in range(i + 1):
                row = lower_row(i, j, n_states)
                between = (normal[i, c] - x[i, c]) * (normal[j, c] - x[j, c])
                mixed = mixed_covariance(x[row, c], normal[row, c], between, probability[c])
                x[row, c] = mixed
        for i in range(n_states):
            x[i, c] += probability[c] * (normal[i, c] - x[i, c])


@part
def walk_severity(columns, walk, work):
    """Let the severities walk over a sample, towards the variance of those that begin."""
    first, last = columns
    x = work.filters
    _, row = severity_rows(work)
    for c in range(first, last):
        x[row, c] = variance_after_walk(x[row, c], work.normal[row, c], walk)


@part
def forget_state(columns, state, memory, added, work):
    """Let a state decay to `memory` of itself, and add the variance `added` (n_columns,)."""
    first, last = columns
    x = work.filters
    n_states = len(work.states)
    for i in range(n_states):
        row = covariance_row(i, state, n_states)
        factor = memory * memory if i == state else memory
        for c in range(first, last):
            x[row, c] *= factor
    for c in range(first, last):
        x[state, c] *= memory
        x[covariance_row(state, state, n_states), c] += added[c]


@part
def relax_state(columns, state, memory, variance, work):
    """Let a state decay to `memory` of itself, towards its stationary `variance`."""
    first, last = columns
    for c in range(first, last):
        work.added[c] = (1.0 - memory * memory) * variance
    forget_state(columns, state, memory, work.added, work)


@part
def replace_severity(columns, work):
    """Replace mean and variance of the severities by ``work.severity``; the other states follow.

    By Jeffrey's rule, exact if the subsystems are independent at a given severity.
    """
    first, last = columns
    x = work.filters
    mean = work.severity[0]
    variance = work.severity[1]
    n_states = len(work.states)
    severity, variance_row = severity_rows(work)
    for c in range(first, last):
        before = x[variance_row, c]
        scale = 1.0 / before if before > MIN_VARIANCE else 0.0
        shift = (mean[c] - x[severity, c]) * scale
        growth = (variance[c] - before) * scale * scale
        for i in range(severity):
            row_i = lower_row(severity, i, n_states)
            x[i, c] += x[row_i, c] * shift
            for j in range(i + 1):
                row_j = lower_row(severity, j, n_states)
                x[lower_row(i, j, n_states), c] += x[row_i, c] * x[row_j, c] * growth
        for i in range(severity):
            x[lower_row(severity, i, n_states), c] *= 1.0 + growth * before
        x[variance_row, c] += growth * before * before
        x[severity, c] = mean[c]


@part
def clip_deviations(columns, deviations, work):
    """Keep the healthy deviations, a range of states, where no parameter changes its sign."""
    first, last = columns
    x = work.filters
    for i in deviations:
        for c in range(first, last):
            x[i, c] = min(max(x[i, c], -MAX_DEVIATION), MAX_DEVIATION)


@part
def covary(columns, work):
    """Fill ``work.covariance`` of the states with a quantity of the gradient ``work.gradient``.

    Fill ``work.variance_by_states``, the variance of that quantity.
    """
    first, last = columns
    x = work.filters
    gradient = work.gradient
    covariance = work.covariance
    n_states = len(work.states)
    for c in range(first, last):
        for i in range(n_states):
            total = 0.0
            for j in range(i):
                total += x[lower_row(i, j, n_states), c] * gradient[j, c]
            for j in range(i, n_states):
                total += x[lower_row(j, i, n_states), c] * gradient[j, c]
            covariance[i, c] = total
    for c in range(first, last):
        variance = 0.0
        for i in range(n_states):
            variance += gradient[i, c] * covariance[i, c]
        work.variance_by_states[c] = variance


@part
def update_states(columns, work):
    """Update the states by an innovation of ``work.covariance`` with them, by ``work.gain``."""
    first, last = columns
    x = work.filters
    covariance = work.covariance
    n_states = len(work.states)
    for c in range(first, last):
        for i in range(n_states):
            share = work.gain[c] * covariance[i, c]
            x[i, c] += share * work.innovation[c]
            for j in range(i + 1):
                x[lower_row(i, j, n_states), c] -= share * covariance[j, c]


@part
def condition(columns, available, work):
    """Condition every filter on the measurement where available (1, else 0), (n_columns,).

    Its log density is added to the evidence. ``work.gradient`` is that of the prediction by the
    states, ``work.variance`` that of the noise. An innovation beyond six standard deviations counts
    as six: one outlier must not decide.
    """
    first, last = columns
    take_available(columns, available, work)
    covary(columns, work)
    for c in range(first, last):
        innovation = work.innovation[c]
        # rounding must not make the states' part of the variance negative
        total = max(work.variance[c] + work.variance_by_states[c], work.variance[c])
        square = min(innovation * innovation / total, MAX_SQUARED_INNOVATION)
        density = LOG_TWO_PI + logarithm(total) + square
        work.evidence[c] -= work.is_available[c] * 0.5 * density
        work.gain[c] = work.is_available[c] / total
        largest = math.sqrt(MAX_SQUARED_INNOVATION * total)
        work.innovation[c] = min(max(innovation, -largest), largest)
    update_states(columns, work)


@part
def take_available(columns, available, work):
    """Fill ``work.is_available`` of the measurement."""
    first, last = columns
    for c in range(first, last):
        work.is_available[c] = available[c]
