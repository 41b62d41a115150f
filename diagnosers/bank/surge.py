"""The surge filters of the bank: speed, disturbance, deviations of drag and thrust, severity.

As `kalman.SurgeFilter`, with the accelerometer as a second measurement, of the acceleration at the
sample's end, and the thrust from the shaft speeds of the motor filters.
"""

from auv_fault_env.compiling import part, scalar
from auv_fault_env.parameters import SAMPLE_TIME
from diagnosers.bank.algebra import (
    condition,
    covariance_row,
    covary,
    relax_state,
    severity_rows,
)
from diagnosers.bank.pack import broadcast
from diagnosers.bank.sensors import BIAS, GAIN, NOISE, condition_on_availability
from diagnosers.kalman import BETWEEN_STD

# rows of the parameters, in the order of `hypotheses.OWN_PARAMETERS`; of a sensor the first one
ALPHA, GAMMA, PORT_BETA, STARBOARD_BETA = range(4)
SPEED = 4
ACCELERATION = 9
N_SURGE_ROWS = 14
SPEED_CHANNEL, ACCELERATION_CHANNEL = range(2)  # among the readings
U, D, DRAG, THRUST_DEVIATION = range(4)  # states: speed, disturbance, relative deviations
DEVIATIONS = (DRAG, THRUST_DEVIATION)
# rows of `work.port` and `work.starboard`: shaft speed [rpm] at the end and at the start of the
# sample, its slope by severity and its standard deviation
RPM_NOW, RPM_BEFORE, RPM_SLOPE, RPM_STD = range(4)
# rows of `work.thrust`: acceleration by both propellers, slope by severity, variance
THRUST, THRUST_SLOPE, THRUST_VARIANCE = range(3)
HALF_SAMPLE = 0.5 * SAMPLE_TIME


@part
def set_parameters(columns, work):
    """Set the parameters to the filters' means, and their derivatives by severity."""
    first, last = columns
    x = work.filters
    severity, _ = severity_rows(work)
    for r in range(N_SURGE_ROWS):
        state = DRAG if r == ALPHA else THRUST_DEVIATION
        varies = 1.0 if r in (ALPHA, PORT_BETA, STARBOARD_BETA) else 0.0
        for c in range(first, last):
            deviation = varies * x[state, c]
            healthy = work.healthy[r, c] * (1.0 + deviation)
            by_severity = healthy * work.slope[r, c] + work.offset[r, c]
            work.parameters[r, c] = healthy + x[severity, c] * by_severity
            work.by_severity[r, c] = by_severity


@scalar
def drag_of(parameters, c, work):
    """Drag with the rudders deflected, by the parameters, or its derivative by theirs."""
    return parameters[ALPHA, c] + parameters[GAMMA, c] * work.deflection[c]


@part
def compute_thrust(columns, opening, work):
    """Fill ``work.thrust``, of which the sample's start has the share `opening`."""
    first, last = columns
    parameters = work.parameters
    by_severity = work.by_severity
    port = work.port
    starboard = work.starboard
    thrust = work.thrust
    closing = 1.0 - opening
    for c in range(first, last):
        port_square = opening * port[RPM_BEFORE, c] ** 2
        port_square += closing * port[RPM_NOW, c] ** 2
        starboard_square = opening * starboard[RPM_BEFORE, c] ** 2
        starboard_square += closing * starboard[RPM_NOW, c] ** 2
        port_beta = parameters[PORT_BETA, c]
        starboard_beta = parameters[STARBOARD_BETA, c]
        slope = by_severity[PORT_BETA, c] * port_square
        slope += by_severity[STARBOARD_BETA, c] * starboard_square
        by_port_rpm = 2.0 * port_beta * port[RPM_NOW, c]
        by_starboard_rpm = 2.0 * starboard_beta * starboard[RPM_NOW, c]
        slope += by_port_rpm * port[RPM_SLOPE, c]
        slope += by_starboard_rpm * starboard[RPM_SLOPE, c]
        port_std = by_port_rpm * port[RPM_STD, c]
        starboard_std = by_starboard_rpm * starboard[RPM_STD, c]
        acceleration = port_beta * port_square
        acceleration += starboard_beta * starboard_square
        variance = port_std * port_std
        variance += starboard_std * starboard_std
        thrust[THRUST, c] = acceleration
        thrust[THRUST_SLOPE, c] = slope
        thrust[THRUST_VARIANCE, c] = variance


@part
def compute_process_noise(columns, work):
    """Fill the variance of the speed by the rpm counters and the thrust between two readings."""
    first, last = columns
    port = work.port
    starboard = work.starboard
    for c in range(first, last):
        port_jump = port[RPM_NOW, c] ** 2 - port[RPM_BEFORE, c] ** 2
        jump = work.parameters[PORT_BETA, c] * port_jump
        starboard_jump = starboard[RPM_NOW, c] ** 2 - starboard[RPM_BEFORE, c] ** 2
        jump += work.parameters[STARBOARD_BETA, c] * starboard_jump
        std = BETWEEN_STD * jump
        variance = work.thrust[THRUST_VARIANCE, c] + std * std
        work.variance[c] = SAMPLE_TIME * SAMPLE_TIME * variance


@part
def predict_speed(columns, work):
    """Advance the mean speed over the sample by the midpoint rule; fill its gradient."""
    first, last = columns
    x = work.filters
    parameters = work.parameters
    by_severity = work.by_severity
    gradient = work.gradient
    severity, _ = severity_rows(work)
    for c in range(first, last):
        thrust = work.thrust[THRUST, c]
        slope = work.thrust[THRUST_SLOPE, c]
        drag = drag_of(parameters, c, work)
        u = x[U, c]
        at_start = drag * u * abs(u) + thrust + x[D, c]
        middle = u + HALF_SAMPLE * at_start
        square = middle * abs(middle)
        damping = SAMPLE_TIME * drag * abs(middle)
        gain = SAMPLE_TIME * (1.0 + damping)
        start_damping = SAMPLE_TIME * drag * abs(u)
        gradient[U, c] = 1.0 + 2.0 * damping * (1.0 + start_damping)
        gradient[D, c] = gain
        gradient[DRAG, c] = gain * parameters[ALPHA, c] / (1.0 + x[DRAG, c]) * square
        gradient[THRUST_DEVIATION, c] = gain * thrust / (1.0 + x[THRUST_DEVIATION, c])
        slope += drag_of(by_severity, c, work) * square
        gradient[severity, c] = gain * slope
        at_middle = drag * square + thrust + x[D, c]
        x[U, c] = u + SAMPLE_TIME * at_middle


@part
def predict_covariance(columns, work):
    """Advance the covariance over the sample, in which only the speed changes."""
    first, last = columns
    x = work.filters
    covariance = work.covariance
    n_states = len(work.states)
    covary(columns, work)
    for i in range(1, n_states):
        row = covariance_row(U, i, n_states)
        for c in range(first, last):
            x[row, c] = covariance[i, c]
    for c in range(first, last):
        variance = work.variance[c] + work.variance_by_states[c]
        x[covariance_row(U, U, n_states), c] = variance


@part
def expect_speed(columns, work):
    """Fill innovation, variance and gradient of the paddle wheel's reading."""
    first, last = columns
    x = work.filters
    parameters = work.parameters
    by_severity = work.by_severity
    gradient = work.gradient
    severity, _ = severity_rows(work)
    for c in range(first, last):
        gain = parameters[SPEED + GAIN, c]
        gradient[U, c] = gain
        gradient[D, c] = 0.0
        gradient[DRAG, c] = 0.0
        gradient[THRUST_DEVIATION, c] = 0.0
        gain_slope = by_severity[SPEED + GAIN, c] * x[U, c]
        gradient[severity, c] = gain_slope + by_severity[SPEED + BIAS, c]
        unbiased = work.readings[SPEED_CHANNEL, c] - gain * x[U, c]
        work.innovation[c] = unbiased - parameters[SPEED + BIAS, c]
        work.variance[c] = parameters[SPEED + NOISE, c] ** 2


@part
def expect_acceleration(columns, work):
    """Fill innovation, variance and gradient of the accelerometer's reading."""
    first, last = columns
    x = work.filters
    parameters = work.parameters
    by_severity = work.by_severity
    gradient = work.gradient
    severity, _ = severity_rows(work)
    predicted = work.predicted[0]
    for c in range(first, last):
        thrust = work.thrust[THRUST, c]
        slope = work.thrust[THRUST_SLOPE, c]
        gain = parameters[ACCELERATION + GAIN, c]
        u = x[U, c]
        drag = drag_of(parameters, c, work)
        square = u * abs(u)
        acceleration = drag * square + thrust + x[D, c]
        gradient[U, c] = gain * 2.0 * drag * abs(u)
        gradient[D, c] = gain
        gradient[DRAG, c] = gain * parameters[ALPHA, c] / (1.0 + x[DRAG, c]) * square
        gradient[THRUST_DEVIATION, c] = gain * thrust / (1.0 + x[THRUST_DEVIATION, c])
        slope += drag_of(by_severity, c, work) * square
        gain_slope = by_severity[ACCELERATION + GAIN, c] * acceleration
        sensor_slope = gain_slope + by_severity[ACCELERATION + BIAS, c]
        gradient[severity, c] = gain * slope + sensor_slope
        predicted[c] = acceleration
    for c in range(first, last):
        gain = parameters[ACCELERATION + GAIN, c]
        noise = parameters[ACCELERATION + NOISE, c] ** 2
        unbiased = work.readings[ACCELERATION_CHANNEL, c] - gain * predicted[c]
        work.innovation[c] = unbiased - parameters[ACCELERATION + BIAS, c]
        work.variance[c] = noise + gain * gain * work.thrust[THRUST_VARIANCE, c]


@part
def update(columns, sample, constants, work):
    """Take all surge filters through one sample, with the shaft speeds of `RPM_NOW` and others."""
    available = work.available[0]
    evidence = work.evidence
    broadcast(sample.deflection, columns, work.deflection)
    for channel in (SPEED_CHANNEL, ACCELERATION_CHANNEL):
        broadcast(sample.reading[channel], columns, work.readings[channel])
    set_parameters(columns, work)
    memory = constants.disturbance_memory
    relax_state(columns, D, memory, constants.disturbance_variance, work)
    compute_thrust(columns, constants.opening, work)
    compute_process_noise(columns, work)
    predict_speed(columns, work)
    predict_covariance(columns, work)
    condition_on_availability(
        work.parameters, columns, SPEED, sample, SPEED_CHANNEL, available, evidence
    )
    expect_speed(columns, work)
    condition(columns, available, work)
    condition_on_availability(
        work.parameters,
        columns,
        ACCELERATION,
        sample,
        ACCELERATION_CHANNEL,
        available,
        evidence,
    )
    set_parameters(columns, work)
    compute_thrust(columns, 0.0, work)
    expect_acceleration(columns, work)
    condition(columns, available, work)
