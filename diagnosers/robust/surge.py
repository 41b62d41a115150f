"""The surge filters of the filter bank: six states and the severity.

They are speed, disturbance, deviations of drag and thrust, the error of the accelerometer by its
zero offset and the vehicle's attitude, and the slow error of the paddle wheel. Otherwise as
`diagnosers.bank.surge`.
"""

import numpy as np

from auv_fault_env.compiling import inlined
from auv_fault_env.parameters import SAMPLE_TIME
from diagnosers.bank.algebra import Measurement
from diagnosers.bank.pack import broadcast
from diagnosers.bank.sensors import BIAS, GAIN, NOISE
from diagnosers.bank.surge import (
    ACCELERATION,
    ACCELERATION_CHANNEL,
    ALPHA,
    DRAG,
    GAMMA,
    N_SURGE_ROWS,
    PORT_BETA,
    RPM_BEFORE,
    RPM_NOW,
    SPEED,
    SPEED_CHANNEL,
    STARBOARD_BETA,
    THRUST,
    THRUST_DEVIATION,
    THRUST_SLOPE,
    THRUST_VARIANCE,
    D,
    U,
    compute_thrust,
)
from diagnosers.kalman import BETWEEN_STD
from diagnosers.robust.algebra import (
    N_STATES,
    SEVERITY,
    condition,
    covariance_row,
    covary,
    forget_state,
)
from diagnosers.robust.sensors import condition_on_availability

# states after those of `bank.surge`: errors of accelerometer and paddle wheel
TILT = THRUST_DEVIATION + 1
PADDLE = TILT + 1
WALK_OF_TILT = 0  # column of `BankState.walk`
HALF_SAMPLE = 0.5 * SAMPLE_TIME
# m/s, below which the paddle wheel may stand, and what it may then miss
STANDING = 0.1
STANDING_STD = 0.03


@inlined
def set_parameters(columns, work):
    """Set the parameters to the filters' means, and their derivatives by severity."""
    first, last = columns
    x = work.filters
    for r in range(N_SURGE_ROWS):
        state = DRAG if r == ALPHA else THRUST_DEVIATION
        varies = 1.0 if r in (ALPHA, PORT_BETA, STARBOARD_BETA) else 0.0
        for c in range(first, last):
            deviation = varies * x[state, c]
            healthy = work.healthy[r, c] * (1.0 + deviation)
            by_severity = healthy * work.slope[r, c] + work.offset[r, c]
            work.parameters[r, c] = healthy + x[SEVERITY, c] * by_severity
            work.by_severity[r, c] = by_severity


@inlined
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
        work.variance[0, c] = SAMPLE_TIME * SAMPLE_TIME * variance + work.water[c]


@inlined
def predict_speed(columns, work):
    """Advance the mean speed over the sample by the midpoint rule; fill its gradient."""
    first, last = columns
    x = work.filters
    parameters = work.parameters
    by_severity = work.by_severity
    gradient = work.gradient
    for c in range(first, last):
        thrust = work.thrust[THRUST, c]
        slope = work.thrust[THRUST_SLOPE, c]
        deflection = work.deflection[c]
        drag = parameters[ALPHA, c] + parameters[GAMMA, c] * deflection
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
        drag_slope = by_severity[ALPHA, c] + by_severity[GAMMA, c] * deflection
        slope += drag_slope * square
        gradient[TILT, c] = 0.0
        gradient[PADDLE, c] = 0.0
        gradient[SEVERITY, c] = gain * slope
        at_middle = drag * square + thrust + x[D, c]
        x[U, c] = u + SAMPLE_TIME * at_middle


@inlined
def predict_covariance(columns, work):
    """Advance the covariance over the sample, in which only the speed changes."""
    first, last = columns
    x = work.filters
    covariance = work.covariance
    variance = work.variance[0]
    covary(columns, work.gradient, work)
    for i in range(N_STATES):
        for c in range(first, last):
            variance[c] += work.gradient[i, c] * covariance[i, c]
    for i in range(1, N_STATES):
        row = covariance_row(U, i)
        for c in range(first, last):
            x[row, c] = covariance[i, c]
    for c in range(first, last):
        x[covariance_row(U, U), c] = variance[c]


@inlined
def condition_on_speed(columns, tails, work):
    """Condition on the paddle wheel."""
    first, last = columns
    x = work.filters
    parameters = work.parameters
    by_severity = work.by_severity
    gradient = work.gradient
    for c in range(first, last):
        gain = parameters[SPEED + GAIN, c]
        gradient[U, c] = gain
        gradient[D, c] = 0.0
        gradient[DRAG, c] = 0.0
        gradient[THRUST_DEVIATION, c] = 0.0
        gradient[TILT, c] = 0.0
        gradient[PADDLE, c] = 1.0
        gain_slope = by_severity[SPEED + GAIN, c] * x[U, c]
        gradient[SEVERITY, c] = gain_slope + by_severity[SPEED + BIAS, c]
        unbiased = work.readings[SPEED_CHANNEL, c] - gain * x[U, c] - x[PADDLE, c]
        work.innovation[0, c] = unbiased - parameters[SPEED + BIAS, c]
        standing = min(max(1.0 - x[U, c] / STANDING, 0.0), 1.0)
        noise = parameters[SPEED + NOISE, c] ** 2 + (standing * STANDING_STD) ** 2
        work.variance[0, c] = noise + work.rounding[SPEED_CHANNEL, c]
    condition(columns, _measurement(work), tails, work)


@inlined
def hold_at_rest(columns, sample, available, work):
    """Let a paddle wheel that may stand hold the speed low; keep the evidence from before."""
    first, last = columns
    n_lanes = np.uint64(sample.idle.size)
    for lane in range(n_lanes):
        for c in range(first + lane, last, n_lanes):
            work.added[c] = work.evidence[c]
        arrived = not (sample.silent[SPEED_CHANNEL, lane] or sample.idle[lane])
        if sample.resting[SPEED_CHANNEL, lane] and arrived:
            available[first + lane : last : n_lanes] = 1.0


@inlined
def restore_evidence(columns, sample, work):
    """Forget the evidence of a paddle wheel that may stand."""
    first, last = columns
    n_lanes = np.uint64(sample.idle.size)
    for lane in range(n_lanes):
        if sample.resting[SPEED_CHANNEL, lane]:
            for c in range(first + lane, last, n_lanes):
                work.evidence[c] = work.added[c]


@inlined
def condition_on_acceleration(columns, tails, work):
    """Condition on the accelerometer."""
    first, last = columns
    x = work.filters
    parameters = work.parameters
    by_severity = work.by_severity
    gradient = work.gradient
    predicted = work.predicted[0]
    for c in range(first, last):
        thrust = work.thrust[THRUST, c]
        slope = work.thrust[THRUST_SLOPE, c]
        deflection = work.deflection[c]
        gain = parameters[ACCELERATION + GAIN, c]
        u = x[U, c]
        drag = parameters[ALPHA, c] + parameters[GAMMA, c] * deflection
        square = u * abs(u)
        acceleration = drag * square + thrust + x[D, c]
        gradient[U, c] = gain * 2.0 * drag * abs(u)
        gradient[D, c] = gain
        gradient[DRAG, c] = gain * parameters[ALPHA, c] / (1.0 + x[DRAG, c]) * square
        gradient[THRUST_DEVIATION, c] = gain * thrust / (1.0 + x[THRUST_DEVIATION, c])
        drag_slope = by_severity[ALPHA, c] + by_severity[GAMMA, c] * deflection
        slope += drag_slope * square
        gain_slope = by_severity[ACCELERATION + GAIN, c] * acceleration
        gradient[TILT, c] = 1.0
        gradient[PADDLE, c] = 0.0
        sensor_slope = gain_slope + by_severity[ACCELERATION + BIAS, c]
        gradient[SEVERITY, c] = gain * slope + sensor_slope
        predicted[c] = acceleration
    for c in range(first, last):
        gain = parameters[ACCELERATION + GAIN, c]
        noise = parameters[ACCELERATION + NOISE, c] ** 2
        unbiased = work.readings[ACCELERATION_CHANNEL, c] - gain * predicted[c]
        work.innovation[0, c] = unbiased - parameters[ACCELERATION + BIAS, c] - x[TILT, c]
        noise += work.rounding[ACCELERATION_CHANNEL, c]
        work.variance[0, c] = noise + gain * gain * work.thrust[THRUST_VARIANCE, c]
    condition(columns, _measurement(work), tails, work)


@inlined
def _measurement(work):
    return Measurement(work.gradient, work.innovation[0], work.variance[0], work.available[0])


@inlined
def update(columns, sample, walk, constants, work):
    """Take all surge filters through one sample, with the shaft speeds of `RPM_NOW` and others."""
    available = work.available[0]
    evidence = work.evidence
    broadcast(sample.deflection, columns, work.deflection)
    for channel in (SPEED_CHANNEL, ACCELERATION_CHANNEL):
        broadcast(sample.reading[channel], columns, work.readings[channel])
        broadcast(sample.rounding[channel], columns, work.rounding[channel])
    set_parameters(columns, work)
    memory = constants.disturbance_memory
    work.added[columns[0] : columns[1]] = (1.0 - memory**2) * constants.disturbance_variance
    forget_state(columns, D, memory, work.added, work)
    broadcast(walk[:, WALK_OF_TILT], columns, work.added)
    forget_state(columns, TILT, 1.0, work.added, work)
    memory = constants.paddle_memory
    work.added[columns[0] : columns[1]] = (1.0 - memory**2) * constants.paddle_variance
    forget_state(columns, PADDLE, memory, work.added, work)
    compute_thrust(columns, constants.opening, work)
    compute_process_noise(columns, work)
    predict_speed(columns, work)
    predict_covariance(columns, work)
    condition_on_availability(
        work.parameters, columns, SPEED, sample, SPEED_CHANNEL, available, evidence
    )
    hold_at_rest(columns, sample, available, work)
    condition_on_speed(columns, constants.tails, work)
    restore_evidence(columns, sample, work)
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
    condition_on_acceleration(columns, constants.tails, work)
