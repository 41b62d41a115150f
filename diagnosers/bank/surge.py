"""The surge filters of the bank: speed, disturbance, healthy deviations of drag and thrust, and the severity.

The equation and its integration are those of `kalman.SurgeFilter`; the accelerometer is a second
measurement, of the acceleration at the sample's end. Thrust enters through the shaft speeds that
each hypothesis believes in.
"""

from auv_fault_env.compiling import inlined
from auv_fault_env.parameters import SAMPLE_TIME
from diagnosers.bank.algebra import N_STATES, SEVERITY, condition, cross, entry
from diagnosers.bank.pack import spread
from diagnosers.bank.sensors import GAIN, NOISE, deliver
from diagnosers.kalman import BETWEEN_STD

# Rows of surge's parameters, `hypotheses.OWN`
ALPHA, GAMMA, PORT_BETA, STARBOARD_BETA = range(4)
# first row of each sensor
SPEED = 4
ACCELERATION = 9
N_SURGE_ROWS = 14
U, D, DRAG, THRUST = range(4)  # states
# rows of a shaft: speed [rpm] now and a sample ago, its slope, its noise
NOW, BEFORE, BY_SEVERITY, BLUR = range(4)
# rows of `push`: the acceleration, its slope by severity, its variance
THRUSTING, TILT, SHAKEN = range(3)


@inlined
def form(x, part, work):
    """Write the parameters (14, n_columns) at the filters' means, and their derivatives by severity."""
    for r in range(N_SURGE_ROWS):
        state = DRAG if r == ALPHA else THRUST
        varies = 1.0 if r in (ALPHA, PORT_BETA, STARBOARD_BETA) else 0.0
        for f in range(part[0], part[1]):
            healthy = work.base[r, f] * (1.0 + varies * x[state, f])
            by_severity = healthy * work.slope[r, f] + work.offset[r, f]
            work.values[r, f] = healthy + x[SEVERITY, f] * by_severity
            work.by_severity[r, f] = by_severity


@inlined
def push(part, port, starboard, opening, work):
    """Fill the acceleration by both propellers, with slope by severity and variance by the noise of the rpm counters.

    `opening` is the share of the sample's start in it.
    """
    values = work.values
    by_severity = work.by_severity
    out = work.pushed
    closing = 1.0 - opening
    for f in range(part[0], part[1]):
        port_square = opening * port[BEFORE, f] ** 2 + closing * port[NOW, f] ** 2
        starboard_square = opening * starboard[BEFORE, f] ** 2 + closing * starboard[NOW, f] ** 2
        by_port = values[PORT_BETA, f]
        by_starboard = values[STARBOARD_BETA, f]
        slope = (
            by_severity[PORT_BETA, f] * port_square
            + by_severity[STARBOARD_BETA, f] * starboard_square
        )
        by_port_now = 2.0 * by_port * port[NOW, f]
        by_starboard_now = 2.0 * by_starboard * starboard[NOW, f]
        slope += by_port_now * port[BY_SEVERITY, f]
        slope += by_starboard_now * starboard[BY_SEVERITY, f]
        port_blur = by_port_now * port[BLUR, f]
        starboard_blur = by_starboard_now * starboard[BLUR, f]
        out[THRUSTING, f] = by_port * port_square + by_starboard * starboard_square
        out[TILT, f] = slope
        out[SHAKEN, f] = port_blur * port_blur + starboard_blur * starboard_blur


@inlined
def drift(x, part, memory, variance):
    """Let the disturbance decay to `memory` of itself, towards its stationary variance."""
    for i in range(N_STATES):
        row = entry(i, D)
        factor = memory * memory if i == D else memory
        for f in range(part[0], part[1]):
            x[row, f] *= factor
    for f in range(part[0], part[1]):
        x[D, f] *= memory
        x[entry(D, D), f] += (1.0 - memory * memory) * variance


@inlined
def move(x, part, work):
    """Carry the mean speed over the sample by the midpoint rule; fill its gradient."""
    values = work.values
    by_severity = work.by_severity
    gradient = work.gradient
    half = 0.5 * SAMPLE_TIME
    for f in range(part[0], part[1]):
        thrust = work.pushed[THRUSTING, f]
        slope = work.pushed[TILT, f]
        deflection = work.deflection[f]
        drag = values[ALPHA, f] + values[GAMMA, f] * deflection
        u = x[U, f]
        middle = u + half * (drag * u * abs(u) + thrust + x[D, f])
        square = middle * abs(middle)
        pull = SAMPLE_TIME * drag * abs(middle)
        gain = SAMPLE_TIME * (1.0 + pull)
        gradient[U, f] = 1.0 + 2.0 * pull * (1.0 + SAMPLE_TIME * drag * abs(u))
        gradient[D, f] = gain
        gradient[DRAG, f] = gain * values[ALPHA, f] / (1.0 + x[DRAG, f]) * square
        gradient[THRUST, f] = gain * thrust / (1.0 + x[THRUST, f])
        slope += (by_severity[ALPHA, f] + by_severity[GAMMA, f] * deflection) * square
        gradient[SEVERITY, f] = gain * slope
        x[U, f] = u + SAMPLE_TIME * (drag * square + thrust + x[D, f])


@inlined
def roughen(part, port, starboard, work):
    """Fill the noise that joins the speed: that of the rpm counters, and the propellers' jump within the sample."""
    values = work.values
    for f in range(part[0], part[1]):
        jump = values[PORT_BETA, f] * (port[NOW, f] ** 2 - port[BEFORE, f] ** 2)
        jump += values[STARBOARD_BETA, f] * (starboard[NOW, f] ** 2 - starboard[BEFORE, f] ** 2)
        rough = BETWEEN_STD * jump
        work.variance[0, f] = SAMPLE_TIME * SAMPLE_TIME * (work.pushed[SHAKEN, f] + rough * rough)


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
def hear_speed(x, part, work):
    """Fill gradient, innovation and variance of the paddle wheel."""
    values = work.values
    by_severity = work.by_severity
    gradient = work.gradient
    for f in range(part[0], part[1]):
        gain = values[SPEED + GAIN, f]
        gradient[U, f] = gain
        gradient[D, f] = 0.0
        gradient[DRAG, f] = 0.0
        gradient[THRUST, f] = 0.0
        gradient[SEVERITY, f] = by_severity[SPEED + GAIN, f] * x[U, f] + by_severity[SPEED, f]
        work.innovation[0, f] = work.readings[0, f] - gain * x[U, f] - values[SPEED, f]
        work.variance[0, f] = values[SPEED + NOISE, f] ** 2


@inlined
def hear_acceleration(x, part, work):
    """Fill gradient, innovation and variance of the accelerometer."""
    values = work.values
    by_severity = work.by_severity
    gradient = work.gradient
    expected = work.expected[0]
    for f in range(part[0], part[1]):
        thrust = work.pushed[THRUSTING, f]
        slope = work.pushed[TILT, f]
        deflection = work.deflection[f]
        gain = values[ACCELERATION + GAIN, f]
        u = x[U, f]
        drag = values[ALPHA, f] + values[GAMMA, f] * deflection
        square = u * abs(u)
        acceleration = drag * square + thrust + x[D, f]
        gradient[U, f] = gain * 2.0 * drag * abs(u)
        gradient[D, f] = gain
        gradient[DRAG, f] = gain * values[ALPHA, f] / (1.0 + x[DRAG, f]) * square
        gradient[THRUST, f] = gain * thrust / (1.0 + x[THRUST, f])
        slope += (by_severity[ALPHA, f] + by_severity[GAMMA, f] * deflection) * square
        by_sensor = (
            by_severity[ACCELERATION + GAIN, f] * acceleration + by_severity[ACCELERATION, f]
        )
        gradient[SEVERITY, f] = gain * slope + by_sensor
        expected[f] = acceleration
    for f in range(part[0], part[1]):
        gain = values[ACCELERATION + GAIN, f]
        noise = values[ACCELERATION + NOISE, f] ** 2
        work.innovation[0, f] = work.readings[1, f] - gain * expected[f] - values[ACCELERATION, f]
        work.variance[0, f] = noise + gain * gain * work.pushed[SHAKEN, f]


@inlined
def update(x, part, seen, port, starboard, constants, work):
    """One sample of all surge filters: adds to the evidence. Port and starboard (4, n_columns): see `NOW`."""
    gradient = work.gradient
    innovation = work.innovation[0]
    variance = work.variance[0]
    evidence = work.evidence
    delivered = work.delivered[0]
    scratch = work.shift
    spread(seen.deflection, part, work.deflection)
    for c in range(2):
        spread(seen.reading[c], part, work.readings[c])
    form(x, part, work)
    drift(x, part, constants.disturbance_memory, constants.disturbance_variance)
    push(part, port, starboard, constants.opening, work)
    roughen(part, port, starboard, work)
    move(x, part, work)
    carry(x, part, gradient, work.crossed, variance)
    deliver(work.values, part, SPEED, seen, 0, delivered, evidence)
    hear_speed(x, part, work)
    condition(x, part, gradient, innovation, variance, delivered, work.crossed, scratch, evidence)
    deliver(work.values, part, ACCELERATION, seen, 1, delivered, evidence)
    form(x, part, work)
    push(part, port, starboard, 0.0, work)
    hear_acceleration(x, part, work)
    condition(x, part, gradient, innovation, variance, delivered, work.crossed, scratch, evidence)
