"""The algebra of a bank's filters: Gaussians of five states, the severity last, all filters of a subsystem at once.

A table of filters is an array (20, n_columns): five rows of means, then the lower triangle of the
covariance, row by row. A column is one filter of one lane, see `bank_pack`; the innermost loops run
over the columns, and so vectorise. `part` is a range (first, last) of columns, unsigned: with
numbers that might be negative they would not vectorise.

Sources: Blom & Bar-Shalom, "The interacting multiple model algorithm for systems with Markovian
switching coefficients", IEEE Trans. Autom. Control 33(8), 1988, doi:10.1109/9.1299 (mixing);
Jeffrey, "The Logic of Decision", McGraw-Hill 1965, ch. 11 (belief kinematics, here in `inform`).
"""

import math

from auv_fault_env.compiling import inlined, scalar
from auv_fault_env.noise import logarithm

N_STATES = 5
SEVERITY = N_STATES - 1
SPREAD = N_STATES + SEVERITY * (SEVERITY + 3) // 2  # row of the severity's variance
N_PACKED = SPREAD + 1
CEILING = 36.0  # of a squared normalised innovation: what one outlier may say
FARTHEST = 0.9  # of a deviation from the nominal vehicle, relative; healthy ones are within 0.1
LOG_TWO_PI = math.log(2.0 * math.pi)
LEAST_VARIANCE = 1e-12  # of a severity; below, it is known


@scalar
def entry(i, j):
    """Row of the covariance of states i and j."""
    high = max(i, j)
    low = min(i, j)
    return N_STATES + high * (high + 1) // 2 + low


@scalar
def widened(variance, prior, walk):
    """A severity's variance after a sample's random walk, which slows as it nears the prior's; zero stays zero."""
    step = walk * max(0.0, 1.0 - variance / max(prior, LEAST_VARIANCE))
    return variance + step if variance > 0.0 else 0.0


@inlined
def mix(x, part, normal, share, centre, variance, walk):
    """Merge each filter with its share of vehicles that have just left the lane's normal filter, `normal` (like x).

    Newcomers have the prior's severity, mean `centre` and `variance`, each (n_columns,). Then the
    severity walks.
    """
    first, last = part
    for i in range(N_STATES - 1, -1, -1):
        for j in range(i, -1, -1):
            row = entry(i, j)
            for f in range(first, last):
                from_i = (centre[f] if i == SEVERITY else normal[i, f]) - x[i, f]
                from_j = (centre[f] if j == SEVERITY else normal[j, f]) - x[j, f]
                other = normal[row, f]
                if i == SEVERITY:
                    other = variance[f] if j == SEVERITY else 0.0
                keep = 1.0 - share[f]
                x[row, f] = keep * x[row, f] + share[f] * (other + keep * from_i * from_j)
    for i in range(N_STATES):
        for f in range(first, last):
            x[i, f] += share[f] * ((centre[f] if i == SEVERITY else normal[i, f]) - x[i, f])
    for f in range(first, last):
        x[SPREAD, f] = widened(x[SPREAD, f], variance[f], walk)


@inlined
def inform(x, part, severity, variance, shift, growth):
    """Give the severities the means and variances (n_columns,) learnt elsewhere; the other states follow.

    What they are at a given severity stays as it was (Jeffrey's rule): exact if the subsystems are
    independent at a given severity. `shift` and `growth` are scratch.
    """
    first, last = part
    for f in range(first, last):
        known = x[SPREAD, f]
        scale = 1.0 / known if known > LEAST_VARIANCE else 0.0
        shift[f] = (severity[f] - x[SEVERITY, f]) * scale
        growth[f] = (variance[f] - known) * scale * scale
    for i in range(SEVERITY):
        crossed = entry(SEVERITY, i)
        for f in range(first, last):
            x[i, f] += x[crossed, f] * shift[f]
        for j in range(i + 1):
            row = entry(i, j)
            other = entry(SEVERITY, j)
            for f in range(first, last):
                x[row, f] += x[crossed, f] * x[other, f] * growth[f]
    for i in range(SEVERITY):
        crossed = entry(SEVERITY, i)
        for f in range(first, last):
            x[crossed, f] *= 1.0 + growth[f] * x[SPREAD, f]
    for f in range(first, last):
        x[SPREAD, f] += growth[f] * x[SPREAD, f] * x[SPREAD, f]
        x[SEVERITY, f] = severity[f]


@inlined
def bound(x, part, first_row):
    """Keep the healthy deviations, from `first_row` on, where parameters keep their sign: far off, filters diverge."""
    for i in range(first_row, SEVERITY):
        for f in range(part[0], part[1]):
            x[i, f] = min(max(x[i, f], -FARTHEST), FARTHEST)


@inlined
def cross(x, part, gradient, crossed):
    """Covariances (5, n_columns) of the states with a quantity of that gradient (5, n_columns)."""
    first, last = part
    for i in range(N_STATES):
        a = entry(i, 0)
        b = entry(i, 1)
        c = entry(i, 2)
        d = entry(i, 3)
        e = entry(i, 4)
        for f in range(first, last):
            head = x[a, f] * gradient[0, f] + x[b, f] * gradient[1, f] + x[c, f] * gradient[2, f]
            crossed[i, f] = head + x[d, f] * gradient[3, f] + x[e, f] * gradient[4, f]


@inlined
def condition(x, part, gradient, innovation, variance, delivered, crossed, gain, evidence):
    """Condition on one measurement of every filter whose sensor has delivered (1, else 0); add its log density.

    Gradient (5, n_columns); innovation and variance of the noise (n_columns,). An innovation beyond
    six standard deviations counts as six: one outlier, or a moment that the model does not know,
    must not decide.
    """
    first, last = part
    cross(x, part, gradient, crossed)
    for f in range(first, last):
        head = (
            gradient[0, f] * crossed[0, f]
            + gradient[1, f] * crossed[1, f]
            + gradient[2, f] * crossed[2, f]
        )
        total = variance[f] + head + gradient[3, f] * crossed[3, f] + gradient[4, f] * crossed[4, f]
        # rounding must not make a covariance speak of less than no doubt
        total = max(total, variance[f])
        square = innovation[f] * innovation[f] / total
        bounded = (
            innovation[f]
            if square <= CEILING
            else math.copysign(math.sqrt(CEILING * total), innovation[f])
        )
        evidence[f] -= delivered[f] * 0.5 * (LOG_TWO_PI + logarithm(total) + min(square, CEILING))
        innovation[f] = bounded
        gain[f] = delivered[f] / total
    for i in range(N_STATES):
        for f in range(first, last):
            x[i, f] += gain[f] * crossed[i, f] * innovation[f]
        for j in range(i + 1):
            row = entry(i, j)
            for f in range(first, last):
                x[row, f] -= gain[f] * crossed[i, f] * crossed[j, f]
