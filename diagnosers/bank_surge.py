"""The surge filters of the bank: speed, disturbance, healthy deviations of drag and thrust, and the severity.

The equation and its integration are those of `kalman.SurgeFilter`; the accelerometer is a second measurement, of the
acceleration at the sample's end. Thrust enters through the shaft speeds that each hypothesis believes in.
"""

from auv_fault_env.compiling import inlined, scalar
from auv_fault_env.parameters import SAMPLE_TIME
from diagnosers.bank_algebra import N_STATES, SEVERITY, condition, cross, entry
from diagnosers.bank_sensors import GAIN, NOISE, deliver
from diagnosers.kalman import BETWEEN_STD

# Rows of surge's parameters, `hypotheses.OWN`
ALPHA, GAMMA, PORT_BETA, STARBOARD_BETA = range(4)
SPEED, ACCELERATION = 4, 9  # first row of each sensor
N_SURGE_ROWS = 14
U, D, DRAG, THRUST = range(4)  # states
NOW, BEFORE, BY_SEVERITY, BLUR = range(4)  # rows of a shaft: speed [rpm] now and a sample ago, its slope, its noise


@inlined
def form(values, by_severity, x, part, base, slope, offset):
    """Write the parameters (14, n_filters) at the filters' means, and their derivatives by severity."""
    for r in range(N_SURGE_ROWS):
        state = DRAG if r == ALPHA else THRUST
        varies = 1.0 if r in (ALPHA, PORT_BETA, STARBOARD_BETA) else 0.0
        for f in range(part[0], part[1]):
            healthy = base[r] * (1.0 + varies * x[state, f])
            by_severity[r, f] = healthy * slope[r, f] + offset[r, f]
            values[r, f] = healthy + x[SEVERITY, f] * by_severity[r, f]


@scalar
def push(values, by_severity, port, starboard, f, opening):
    """Acceleration by both propellers, `opening` the share of the sample's start in it, and its slope by severity."""
    closing = 1.0 - opening
    port_square = opening * port[BEFORE, f] ** 2 + closing * port[NOW, f] ** 2
    starboard_square = opening * starboard[BEFORE, f] ** 2 + closing * starboard[NOW, f] ** 2
    by_port, by_starboard = values[PORT_BETA, f], values[STARBOARD_BETA, f]
    slope = by_severity[PORT_BETA, f] * port_square + by_severity[STARBOARD_BETA, f] * starboard_square
    slope += 2.0 * by_port * port[NOW, f] * port[BY_SEVERITY, f]
    slope += 2.0 * by_starboard * starboard[NOW, f] * starboard[BY_SEVERITY, f]
    return by_port * port_square + by_starboard * starboard_square, slope


@scalar
def shaken(values, port, starboard, f):
    """Variance of the propellers' acceleration through the noise of the rpm counters."""
    by_port = 2.0 * values[PORT_BETA, f] * port[NOW, f] * port[BLUR, f]
    by_starboard = 2.0 * values[STARBOARD_BETA, f] * starboard[NOW, f] * starboard[BLUR, f]
    return by_port * by_port + by_starboard * by_starboard


@scalar
def unsteady(values, port, starboard, f):
    """Jump of the propellers' acceleration within the sample."""
    jump = values[PORT_BETA, f] * (port[NOW, f] ** 2 - port[BEFORE, f] ** 2)
    return jump + values[STARBOARD_BETA, f] * (starboard[NOW, f] ** 2 - starboard[BEFORE, f] ** 2)


@inlined
def drift(x, part, memory, variance):
    """Let the disturbance decay to `memory` of itself, towards its stationary variance."""
    for i in range(N_STATES):
        row, factor = entry(i, D), memory * memory if i == D else memory
        for f in range(part[0], part[1]):
            x[row, f] *= factor
    for f in range(part[0], part[1]):
        x[D, f] *= memory
        x[entry(D, D), f] += (1.0 - memory * memory) * variance


@inlined
def move(x, part, deflection, port, starboard, opening, work):
    """Carry the mean speed over the sample by the midpoint rule; fill its gradient and the noise that joins it."""
    values, by_severity, gradient, half = work.values, work.by_severity, work.gradient, 0.5 * SAMPLE_TIME
    for f in range(part[0], part[1]):
        thrust, slope = push(values, by_severity, port, starboard, f, opening)
        drag, u = values[ALPHA, f] + values[GAMMA, f] * deflection, x[U, f]
        middle = u + half * (drag * u * abs(u) + thrust + x[D, f])
        square, pull = middle * abs(middle), SAMPLE_TIME * drag * abs(middle)
        gain = SAMPLE_TIME * (1.0 + pull)
        gradient[U, f] = 1.0 + 2.0 * pull * (1.0 + SAMPLE_TIME * drag * abs(u))
        gradient[D, f] = gain
        gradient[DRAG, f] = gain * values[ALPHA, f] / (1.0 + x[DRAG, f]) * square
        gradient[THRUST, f] = gain * thrust / (1.0 + x[THRUST, f])
        slope += (by_severity[ALPHA, f] + by_severity[GAMMA, f] * deflection) * square
        gradient[SEVERITY, f] = gain * slope
        x[U, f] = u + SAMPLE_TIME * (drag * square + thrust + x[D, f])
        rough = BETWEEN_STD * unsteady(values, port, starboard, f)
        work.variance[0, f] = SAMPLE_TIME * SAMPLE_TIME * (shaken(values, port, starboard, f) + rough * rough)


@inlined
def carry(x, part, gradient, crossed, variance):
    """Carry the covariance over the sample: only the speed moves."""
    cross(x, part, gradient, crossed)
    for i in range(N_STATES):
        for f in range(part[0], part[1]):
            variance[f] += gradient[i, f] * crossed[i, f]
    for i in range(1, N_STATES):
        row = entry(U, i)
        for f in range(part[0], part[1]):
            x[row, f] = crossed[i, f]
    for f in range(part[0], part[1]):
        x[entry(U, U), f] = variance[f]


@inlined
def hear_speed(x, part, reading, work):
    """Fill gradient, innovation and variance of the paddle wheel."""
    values, by_severity, gradient = work.values, work.by_severity, work.gradient
    for f in range(part[0], part[1]):
        gain = values[SPEED + GAIN, f]
        gradient[U, f], gradient[D, f], gradient[DRAG, f], gradient[THRUST, f] = gain, 0.0, 0.0, 0.0
        gradient[SEVERITY, f] = by_severity[SPEED + GAIN, f] * x[U, f] + by_severity[SPEED, f]
        work.innovation[0, f] = reading - gain * x[U, f] - values[SPEED, f]
        work.variance[0, f] = values[SPEED + NOISE, f] ** 2


@inlined
def hear_acceleration(x, part, reading, deflection, port, starboard, work):
    """Fill gradient, innovation and variance of the accelerometer."""
    values, by_severity, gradient = work.values, work.by_severity, work.gradient
    for f in range(part[0], part[1]):
        thrust, slope = push(values, by_severity, port, starboard, f, 0.0)
        gain, u = values[ACCELERATION + GAIN, f], x[U, f]
        drag, square = values[ALPHA, f] + values[GAMMA, f] * deflection, u * abs(u)
        acceleration = drag * square + thrust + x[D, f]
        gradient[U, f] = gain * 2.0 * drag * abs(u)
        gradient[D, f] = gain
        gradient[DRAG, f] = gain * values[ALPHA, f] / (1.0 + x[DRAG, f]) * square
        gradient[THRUST, f] = gain * thrust / (1.0 + x[THRUST, f])
        slope += (by_severity[ALPHA, f] + by_severity[GAMMA, f] * deflection) * square
        by_sensor = by_severity[ACCELERATION + GAIN, f] * acceleration + by_severity[ACCELERATION, f]
        gradient[SEVERITY, f] = gain * slope + by_sensor
        work.innovation[0, f] = reading - gain * acceleration - values[ACCELERATION, f]
        noise = values[ACCELERATION + NOISE, f] ** 2
        work.variance[0, f] = noise + gain * gain * shaken(values, port, starboard, f)


@inlined
def update(x, part, base, slope, offset, seen, port, starboard, constants, work):
    """One sample of all surge filters: adds to the evidence. Port and starboard (4, n_filters): see `NOW`."""
    form(work.values, work.by_severity, x, part, base, slope, offset)
    drift(x, part, constants.disturbance_memory, constants.disturbance_variance)
    move(x, part, seen.deflection, port, starboard, constants.opening, work)
    carry(x, part, work.gradient, work.crossed, work.variance[0])
    gradient, innovation, variance, evidence = work.gradient, work.innovation[0], work.variance[0], work.evidence
    delivered, scratch = work.delivered[0], work.shift
    deliver(work.values, part, SPEED, seen, 0, delivered, evidence)
    hear_speed(x, part, seen.reading[0], work)
    condition(x, part, gradient, innovation, variance, delivered, work.crossed, scratch, evidence)
    deliver(work.values, part, ACCELERATION, seen, 1, delivered, evidence)
    form(work.values, work.by_severity, x, part, base, slope, offset)
    hear_acceleration(x, part, seen.reading[1], seen.deflection, port, starboard, work)
    condition(x, part, gradient, innovation, variance, delivered, work.crossed, scratch, evidence)
