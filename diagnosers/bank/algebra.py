"""The algebra of the bank's filters: Gaussians of five states, the severity last, many at once.

A table of filters is an array ``x`` (N_MOMENTS, n_columns): five rows of means, then the lower
triangle of the covariance, row by row. A column is one filter of one lane (`bank.pack`). The loops
over ``columns``, a range (first, last), vectorise because its numbers are unsigned. ``work`` is the
memory of `bank.pack`.

Sources: Blom & Bar-Shalom, "The interacting multiple model algorithm for systems with Markovian
switching coefficients", IEEE Trans. Autom. Control 33(8), 1988, doi:10.1109/9.1299 (`mix`);
Jeffrey, "The Logic of Decision", McGraw-Hill 1965, ch. 11 (`replace_severity`).
"""

import math
from typing import NamedTuple

import numpy as np

from auv_fault_env.compiling import inlined, scalar
from auv_fault_env.noise import logarithm

N_STATES = 5
SEVERITY = N_STATES - 1
SEVERITY_VARIANCE = N_STATES + SEVERITY * (SEVERITY + 3) // 2  # row of a table of filters
N_MOMENTS = SEVERITY_VARIANCE + 1
MAX_SQUARED_INNOVATION = 36.0  # normalised: the weight of one outlier is bounded
MAX_DEVIATION = 0.9  # from the nominal vehicle, relative; healthy vehicles are within 0.1
MIN_VARIANCE = 1e-12  # of a severity; below, it is certain
LOG_TWO_PI = math.log(2.0 * math.pi)


class Measurement(NamedTuple):
    """One measurement of every filter."""

    gradient: np.ndarray  # (N_STATES, n_columns), of the prediction by the states
    innovation: np.ndarray  # (n_columns,)
    variance: np.ndarray  # (n_columns,), of the noise
    available: np.ndarray  # (n_columns,), 1 or 0


@scalar
def covariance_row(i, j):
    """Row of the covariance of states i and j."""
    high = max(i, j)
    low = min(i, j)
    return N_STATES + high * (high + 1) // 2 + low


@scalar
def variance_after_walk(variance, prior, walk):
    """Variance of a severity after a sample of its walk, which slows down near the prior's."""
    step = walk * max(0.0, 1.0 - variance / max(prior, MIN_VARIANCE))
    return variance + step if variance > 0.0 else 0.0


@inlined
def mix(columns, work, walk):
    """Mix each filter with the normal one of its lane, by ``work.mixing_probability``; then walk.

    That is the probability that the vehicle, if the hypothesis is true, left the normal hypothesis
    at this sample. Its severity then has the moments ``work.prior``.
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
                stay = 1.0 - probability[c]
                stayed = stay * x[row, c]
                switched = covariance + stay * distance_i * distance_j
                x[row, c] = stayed + probability[c] * switched
    for i in range(N_STATES):
        for c in range(first, last):
            mean = prior_mean[c] if i == SEVERITY else normal[i, c]
            x[i, c] += probability[c] * (mean - x[i, c])
    for c in range(first, last):
        variance = x[SEVERITY_VARIANCE, c]
        x[SEVERITY_VARIANCE, c] = variance_after_walk(variance, prior_variance[c], walk)


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
def clip_deviations(columns, first_row, work):
    """Keep the healthy deviations, from `first_row` on, where no parameter changes its sign."""
    first, last = columns
    x = work.filters
    for i in range(first_row, SEVERITY):
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
        for c in range(first, last):
            total = x[row_0, c] * gradient[0, c]
            total += x[row_1, c] * gradient[1, c]
            total += x[row_2, c] * gradient[2, c]
            total += x[row_3, c] * gradient[3, c]
            total += x[row_4, c] * gradient[4, c]
            work.covariance[i, c] = total


@inlined
def condition(columns, measurement, work):
    """Condition every filter on a measurement where available; add its log density to the evidence.

    An innovation beyond six standard deviations counts as six: one outlier must not decide.
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
        # rounding must not make the states' part of the variance negative
        total = max(total, variance[c])
        square = innovation[c] * innovation[c] / total
        bounded = innovation[c]
        if square > MAX_SQUARED_INNOVATION:
            largest = math.sqrt(MAX_SQUARED_INNOVATION * total)
            bounded = math.copysign(largest, innovation[c])
        misfit = LOG_TWO_PI + logarithm(total) + min(square, MAX_SQUARED_INNOVATION)
        work.evidence[c] -= available[c] * 0.5 * misfit
        innovation[c] = bounded
        gain[c] = available[c] / total
    for i in range(N_STATES):
        for c in range(first, last):
            x[i, c] += gain[c] * covariance[i, c] * innovation[c]
        for j in range(i + 1):
            row = covariance_row(i, j)
            for c in range(first, last):
                x[row, c] -= gain[c] * covariance[i, c] * covariance[j, c]
