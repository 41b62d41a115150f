"""The surge filters of the filter bank: six states and the severity.

They are speed, disturbance, deviations of drag and thrust, the error of the accelerometer by its
zero offset and the vehicle's attitude, and the slow error of the paddle wheel. Otherwise as
`diagnosers.bank.surge`.
"""

import numpy as np

from auv_fault_env.compiling import inlined
from diagnosers.bank.pack import broadcast
from diagnosers.bank.surge import (
    ACCELERATION,
    ACCELERATION_CHANNEL,
    SPEED,
    SPEED_CHANNEL,
    THRUST_DEVIATION,
    D,
    U,
    compute_process_noise,
    compute_thrust,
    expect_acceleration,
    expect_speed,
    expected_measurement,
    predict_speed,
    set_parameters,
)
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
# m/s, below which the paddle wheel may stand, and what it may then miss
STANDING = 0.1
STANDING_STD = 0.03


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
def add_to_speed(columns, work):
    """Add the paddle wheel's slow error, and what it misses where it may stand."""
    first, last = columns
    x = work.filters
    for c in range(first, last):
        work.gradient[TILT, c] = 0.0
        work.gradient[PADDLE, c] = 1.0
        work.innovation[0, c] -= x[PADDLE, c]
        standing = min(max(1.0 - x[U, c] / STANDING, 0.0), 1.0)
        rounding = work.rounding[SPEED_CHANNEL, c]
        work.variance[0, c] += (standing * STANDING_STD) ** 2 + rounding


@inlined
def add_to_acceleration(columns, work):
    """Add the accelerometer's error by its zero offset and the vehicle's attitude."""
    first, last = columns
    x = work.filters
    for c in range(first, last):
        work.gradient[TILT, c] = 1.0
        work.gradient[PADDLE, c] = 0.0
        work.innovation[0, c] -= x[TILT, c]
        work.variance[0, c] += work.rounding[ACCELERATION_CHANNEL, c]


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
def update(columns, sample, walk, constants, work):
    """Take all surge filters through one sample, with the shaft speeds of `RPM_NOW` and others."""
    available = work.available[0]
    evidence = work.evidence
    broadcast(sample.deflection, columns, work.deflection)
    for channel in (SPEED_CHANNEL, ACCELERATION_CHANNEL):
        broadcast(sample.reading[channel], columns, work.readings[channel])
        broadcast(sample.rounding[channel], columns, work.rounding[channel])
    set_parameters(columns, SEVERITY, work)
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
    work.variance[0, columns[0] : columns[1]] += work.water[columns[0] : columns[1]]
    predict_speed(columns, SEVERITY, work)
    work.gradient[TILT : PADDLE + 1, columns[0] : columns[1]] = 0.0
    predict_covariance(columns, work)
    condition_on_availability(
        work.parameters, columns, SPEED, sample, SPEED_CHANNEL, available, evidence
    )
    hold_at_rest(columns, sample, available, work)
    expect_speed(columns, SEVERITY, work)
    add_to_speed(columns, work)
    condition(columns, expected_measurement(work), constants.tails, work)
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
    set_parameters(columns, SEVERITY, work)
    compute_thrust(columns, 0.0, work)
    expect_acceleration(columns, SEVERITY, work)
    add_to_acceleration(columns, work)
    condition(columns, expected_measurement(work), constants.tails, work)
