"""The surge filters of the filter bank: six states and the severity.

They are speed, disturbance, deviations of drag and thrust, the error of the accelerometer by its
zero offset and the vehicle's attitude, and the slow error of the paddle wheel. Otherwise as
`diagnosers.bank.surge`.
"""

from auv_fault_env.compiling import part
from diagnosers.bank.algebra import forget_state, relax_state
from diagnosers.bank.pack import broadcast, columns_of_lane
from diagnosers.bank.sensors import condition_on_availability
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
    predict_covariance,
    predict_speed,
    set_parameters,
)
from diagnosers.robust.algebra import condition, keep_standardised
from diagnosers.robust.sensors import keep_evidence, replace_evidence

# states after those of `bank.surge`: errors of accelerometer and paddle wheel
TILT = THRUST_DEVIATION + 1
PADDLE = TILT + 1
WALK_OF_TILT = 0  # column of `BankState.walk`
# m/s, below which the paddle wheel may stand, and what it may then miss
STANDING = 0.1
STANDING_STD = 0.03


@part
def add_water(columns, work):
    """Add the variance of the speed by a change of the water's current."""
    first, last = columns
    for c in range(first, last):
        work.variance[c] += work.water[c]


@part
def add_to_speed(columns, work):
    """Add the paddle wheel's slow error, and what it misses where it may stand."""
    first, last = columns
    x = work.filters
    for c in range(first, last):
        work.gradient[TILT, c] = 0.0
        work.gradient[PADDLE, c] = 1.0
        work.innovation[c] -= x[PADDLE, c]
        standing = min(max(1.0 - x[U, c] / STANDING, 0.0), 1.0)
        excess = work.excess[SPEED_CHANNEL, c]
        work.variance[c] += (standing * STANDING_STD) ** 2 + excess


@part
def add_to_acceleration(columns, work):
    """Add the accelerometer's error by its zero offset and the vehicle's attitude."""
    first, last = columns
    x = work.filters
    for c in range(first, last):
        work.gradient[TILT, c] = 1.0
        work.gradient[PADDLE, c] = 0.0
        work.innovation[c] -= x[TILT, c]
        work.variance[c] += work.excess[ACCELERATION_CHANNEL, c]


@part
def hold_at_rest(columns, sample, available):
    """Let a paddle wheel that may stand hold the speed low."""
    n_lanes = sample.idle.size
    for lane in range(n_lanes):
        arrived = not (sample.silent[SPEED_CHANNEL, lane] or sample.idle[lane])
        if sample.resting[SPEED_CHANNEL, lane] and arrived:
            first, last = columns_of_lane(lane, columns, n_lanes)
            available[first:last] = 1.0


@part
def update(columns, sample, walk, constants, work):
    """Take all surge filters through one sample, with the shaft speeds of `RPM_NOW` and others."""
    available = work.available[0]
    evidence = work.evidence
    broadcast(sample.deflection, columns, work.deflection)
    for channel in (SPEED_CHANNEL, ACCELERATION_CHANNEL):
        broadcast(sample.reading[channel], columns, work.readings[channel])
        broadcast(sample.excess[channel], columns, work.excess[channel])
    set_parameters(columns, work)
    memory = constants.bank.disturbance_memory
    relax_state(columns, D, memory, constants.bank.disturbance_variance, work)
    broadcast(walk[:, WALK_OF_TILT], columns, work.added)
    forget_state(columns, TILT, 1.0, work.added, work)
    relax_state(columns, PADDLE, constants.paddle_memory, constants.paddle_variance, work)
    compute_thrust(columns, constants.bank.opening, work)
    compute_process_noise(columns, work)
    add_water(columns, work)
    predict_speed(columns, work)
    work.gradient[TILT : PADDLE + 1, columns[0] : columns[1]] = 0.0
    predict_covariance(columns, work)
    condition_on_availability(
        work.parameters, columns, SPEED, sample, SPEED_CHANNEL, available, evidence
    )
    hold_at_rest(columns, sample, available)
    expect_speed(columns, work)
    add_to_speed(columns, work)
    keep_evidence(columns, work)
    condition(columns, available, constants.tails, work)
    keep_standardised(columns, SPEED_CHANNEL, work)
    # that of a paddle wheel that may stand is none
    replace_evidence(columns, sample.resting[SPEED_CHANNEL], work.evidence_before, work)
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
    add_to_acceleration(columns, work)
    condition(columns, available, constants.tails, work)
    keep_standardised(columns, ACCELERATION_CHANNEL, work)
