"""The kernel of the filter bank: hypotheses and their filters on every lane, and the belief."""

import math
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import READINGS
from auv_fault_env.compiling import kernel, part, scalar
from auv_fault_env.light import light, lightened
from auv_fault_env.physics import RPM
from diagnosers.bank.algebra import clip_deviations, covariance_row, mix, walk_severity
from diagnosers.bank.hypotheses import PORT, STARBOARD, SURGE
from diagnosers.bank.kernel import (
    MOTOR_CHANNEL,
    SPEED_CHANNEL,
    begin_filters,
    begin_shaft_speeds,
    gather_shaft,
    replace_severities,
    switch_severities,
    update_belief,
    update_severity,
)
from diagnosers.bank.logarithms import exponential, log_sum, share_of_second
from diagnosers.bank.pack import column_shift, columns_of, columns_of_lane, filters_of, scatter
from diagnosers.bank.sensors import N_READINGS, NOISE_STD, keep_readings
from diagnosers.bank.surge import DEVIATIONS
from diagnosers.kalman import START_SPEED_STD
from diagnosers.robust import algebra, motor, surge
from diagnosers.robust.alignment import align, compare_latencies, judge_latencies
from diagnosers.robust.sensors import fill_sample

# below these a counter may read exactly zero: rpm of a shaft, m/s of a paddle wheel
STANDING_RPM = 30.0
NOISE_OF_ZERO = 4.0  # standard deviations of noise, within which a counter reads zero
ACCELERATION_CHANNEL = READINGS.index("acceleration")
MOTOR_DEVIATIONS = tuple(range(motor.FIRST_DEVIATION, motor.ZERO))
WALK_OF_VOLTAGE = (0, 1, 2)  # columns of `BankState.walk` by subsystem
LARGEST_STEP = 4.0
N_MOTOR_READINGS = 3
N_SURGE_READINGS = 2  # speed and acceleration, the first channels
FIRST_NOISE_SAMPLES = 20.0  # that the assumed noise counts as, when that of a sensor is estimated
SETTLING_SAMPLES = 20  # before these readings are evidence: one wrong one may have set the states


@light
class BankState(NamedTuple):
    """State of a bank, lane first; NaN where nothing has been read."""

    log_posterior: np.ndarray  # (n_lanes, n_hypotheses)
    severity: np.ndarray  # (n_lanes, 2, n_hypotheses), mean and variance
    filters: np.ndarray  # (n_lanes, N_MOMENTS, n_filters), means and packed covariances
    shaft_speed: np.ndarray  # (n_lanes, n_filters), of the motor filters [rad/s]
    readings: np.ndarray  # (n_lanes, N_READINGS), the last ones
    spacing: np.ndarray  # (n_lanes, N_READINGS), least difference of two successive ones
    healthy: np.ndarray  # (n_lanes, n_parameters), the vehicle without its fault
    # (n_lanes, 3, n_grades + 1), mean, variance and least value of the severity; the last is none
    prior: np.ndarray
    walk: np.ndarray  # (n_lanes, 3), variance per sample of tilt and both voltages
    # (n_lanes, N_READINGS), variance of the noise by that of a healthy sensor, at least 1
    noise_ratio: np.ndarray
    innovation: np.ndarray  # (n_lanes, N_READINGS), the last, standardised; NaN if there was none
    # (n_lanes, 2, N_EARLIER, N_LATENCIES), readings of voltage and current by side, the last first
    earlier: np.ndarray
    latency: np.ndarray  # (n_lanes, 2), samples by which a shaft speed is read late
    misfit: np.ndarray  # (n_lanes, 2, N_LATENCIES), forgetting sums of squares, by latency [rpm^2]
    age: np.ndarray  # (n_lanes,), samples so far


@part
def switch_hypotheses(old, new, table, walk, switch_probability, return_probability):
    """Let hypotheses of one lane begin and end: posterior, severities, and probabilities of both.

    switch_probability: that a hypothesis, if true now, began at this sample. return_probability:
    that a vehicle, if normal now, had the hypothesis before.
    """
    n_hypotheses = table.log_hazard.size
    log_normal = old.log_posterior[0]
    return_probability[0] = exponential(log_normal + table.log_hazard[0])
    for h in range(1, n_hypotheses):
        return_probability[h] = exponential(old.log_posterior[h] + table.log_end[h])
    total = 0.0
    for h in range(n_hypotheses):
        total += return_probability[h]
    for h in range(n_hypotheses):
        return_probability[h] /= total
    new.log_posterior[0] = math.log(total)
    for h in range(1, n_hypotheses):
        log_stayed = old.log_posterior[h] + table.log_stay[h]
        log_switched = log_normal + table.log_hazard[h]
        new.log_posterior[h] = log_sum(log_stayed, log_switched)
        switch_probability[h] = share_of_second(log_stayed, log_switched)
    switch_severities(switch_probability, old, new, table, walk)
    forget_evidence(new.log_posterior, table)


@part
def forget_evidence(log_posterior, table):
    """Let the odds of each hypothesis to normal fall towards those without any evidence.

    They fall by a share of their logarithm per sample, as in dynamic model averaging (Raftery,
    Karny & Ettler 2010, doi:10.1198/TECH.2009.08104): evidence counts for a while, and what little
    an imperfect model prefers one of two hypotheses by never accumulates.
    """
    log_normal = log_posterior[0]
    for h in range(1, log_posterior.size):
        excess = log_posterior[h] - log_normal - table.log_odds[h]
        log_posterior[h] -= table.forgetting * max(excess, 0.0)


@part
def mix_filters(subsystem, old, new, table, constants, work):
    """Fill the columns of a subsystem: filters mixed with the normal one, and it with them."""
    n_lanes = old.age.size
    columns = columns_of(subsystem, table, n_lanes)
    healthy_variance = constants.healthy_variance[subsystem]
    begin_filters(subsystem, old, table, work)
    for lane in range(n_lanes):
        returned = 1.0 - work.return_probability[lane, 0]
        if returned > algebra.MIN_MIXING:
            mix_back(subsystem, lane, n_lanes, table, work)
    mix(columns, work)
    walk_severity(columns, constants.bank.walk, work)
    algebra.walk_deviations(columns, healthy_variance, constants.memory, work)
    replace_severities(subsystem, new.severity, table, work)


@part
def mix_back(subsystem, lane, n_lanes, table, work):
    """Mix into the normal filter of a lane those of the hypotheses that end, with their weights.

    Hypotheses that share the normal filter in this subsystem leave it as it is, and so do those of
    unknown changes, whose deviations are no healthy ones.
    """
    first, last = filters_of(subsystem, table)
    probability = work.return_probability[lane]
    shared = 1.0
    shift = column_shift(lane, subsystem, table, n_lanes)
    for f in range(first + np.uint64(1), last):
        if table.spread[f] == 0.0:
            shared -= probability[table.hypothesis[f]]
    total = max(shared, 0.0)
    for f in range(first + np.uint64(1), last):
        of_filter = probability[table.hypothesis[f]]
        if of_filter > algebra.MIN_MIXING and table.spread[f] == 0.0:
            total += of_filter
            algebra.merge(f + shift, first + shift, of_filter / total, work)


@part
def adapt_walk(subsystem, state, channel, column, old, new, sample, table, constants, work):
    """Move the variance of a walking state's steps to the squared steps in a filter.

    That is the most probable one of a motor, and the normal one of surge. In a consistent filter
    both have the same mean. A jump counts as one of `LARGEST_STEP` standard deviations. Nothing is
    seen while the reading `channel` rests or is silent.
    """
    n_lanes = old.age.size
    share, least, most = constants.walk_limits[column]
    for lane in range(n_lanes):
        variance = old.walk[lane, column]
        if not (sample.resting[channel, lane] or sample.silent[channel, lane]):
            hypothesis = 0 if subsystem == SURGE else old.log_posterior[lane].argmax()
            best = table.filter[subsystem, hypothesis]
            before = old.filters[lane, state, best]
            c = best + column_shift(lane, subsystem, table, n_lanes)
            step = work.filters[state, c] - before
            square = min(step * step, LARGEST_STEP**2 * variance)
            variance += share * (square - variance)
        new.walk[lane, column] = min(max(variance, least), most)


@part
def adapt_noise(subsystem, first_channel, n_readings, old, new, table, constants, work):
    """Move the variance of a subsystem's noise to what the innovations of the best filter show.

    That is half of the squared difference of successive innovations: what changes slowly, such as
    an error of the model, is no noise. An outlier counts as by its weight in the update.
    """
    n_lanes = old.age.size
    freedom = constants.tails.freedom
    for lane in range(n_lanes):
        best = table.filter[subsystem, old.log_posterior[lane].argmax()]
        c = best + column_shift(lane, subsystem, table, n_lanes)
        share = max(constants.noise_adaptation, 1.0 / (FIRST_NOISE_SAMPLES + old.age[lane]))
        for k in range(n_readings):
            channel = first_channel + k
            innovation = work.innovations[k, c]
            difference = innovation - old.innovation[lane, channel]
            square = 0.5 * difference * difference
            change = 0.0
            if not math.isnan(difference):
                change = share * ((freedom + 1.0) * square / (freedom + square) - 1.0)
            ratio = old.noise_ratio[lane, channel] * (1.0 + change)
            new.noise_ratio[lane, channel] = min(max(ratio, 1.0), constants.largest_noise_ratio)
            new.innovation[lane, channel] = innovation


@part
def update_motor(subsystem, old, new, sample, table, constants, work):
    """Take all filters of one motor through a sample."""
    n_lanes = old.age.size
    channel = MOTOR_CHANNEL[subsystem]
    first, last = filters_of(subsystem, table)
    columns = columns_of(subsystem, table, n_lanes)
    mix_filters(subsystem, old, new, table, constants, work)
    begin_shaft_speeds(subsystem, old, sample, table, work)
    for lane in range(n_lanes):
        shift = column_shift(lane, subsystem, table, n_lanes)
        for f in range(first, last):
            c = f + shift
            surge_filter = table.filter[SURGE, table.hypothesis[f]]
            work.surge_speed[c] = old.filters[lane, surge.U, surge_filter]
            # the filters do not know the speed yet
            if old.age[lane] == 0.0 and not sample.silent[SPEED_CHANNEL, lane]:
                work.surge_speed[c] = sample.reading[SPEED_CHANNEL, lane]
    for lane in range(n_lanes):
        best = table.filter[subsystem, old.log_posterior[lane].argmax()]
        work.best_column[lane] = best + column_shift(lane, subsystem, table, n_lanes)
    column_of_walk = WALK_OF_VOLTAGE[subsystem]
    motor.update(columns, sample, channel, old.walk[:, column_of_walk], constants, work)
    adapt_walk(
        subsystem,
        motor.VOLTS,
        channel,
        column_of_walk,
        old,
        new,
        sample,
        table,
        constants,
        work,
    )
    water = constants.bank.water
    compare_latencies(subsystem, old, new, sample, work.best_column, water, work)
    judge_latencies(columns, subsystem, new, work)
    adapt_noise(subsystem, channel, N_MOTOR_READINGS, old, new, table, constants, work)
    clip_deviations(columns, MOTOR_DEVIATIONS, work)
    update_severity(subsystem, new, table, work)


@part
def forget_speed(columns, sample, work):
    """Let the speed of idle lanes be unknown: what comes next may be another part of a log."""
    n_lanes = sample.idle.size
    row = covariance_row(surge.U, surge.U, algebra.N_STATES)
    for lane in range(n_lanes):
        if sample.idle[lane]:
            first, last = columns_of_lane(lane, columns, n_lanes)
            for c in range(first, last):
                work.filters[row, c] = max(work.filters[row, c], START_SPEED_STD**2)


@part
def update_surge(old, new, sample, table, constants, work):
    """Take all surge filters through a sample."""
    columns = columns_of(SURGE, table, old.age.size)
    mix_filters(SURGE, old, new, table, constants, work)
    forget_speed(columns, sample, work)
    gather_shaft(work.port, PORT, old, table, work)
    gather_shaft(work.starboard, STARBOARD, old, table, work)
    surge.update(columns, sample, old.walk, constants, work)
    adapt_walk(
        SURGE,
        surge.TILT,
        ACCELERATION_CHANNEL,
        surge.WALK_OF_TILT,
        old,
        new,
        sample,
        table,
        constants,
        work,
    )
    adapt_noise(SURGE, 0, N_SURGE_READINGS, old, new, table, constants, work)
    clip_deviations(columns, DEVIATIONS, work)
    update_severity(SURGE, new, table, work)


@scalar
def lanes_of(state, lanes):
    """Some lanes of a state (a slice), or one of them (its index), as views."""
    return lightened(  # type: ignore[call-arg]
        BankState(
            state.log_posterior[lanes],
            state.severity[lanes],
            state.filters[lanes],
            state.shaft_speed[lanes],
            state.readings[lanes],
            state.spacing[lanes],
            state.healthy[lanes],
            state.prior[lanes],
            state.walk[lanes],
            state.noise_ratio[lanes],
            state.innovation[lanes],
            state.earlier[lanes],
            state.latency[lanes],
            state.misfit[lanes],
            state.age[lanes],
        )
    )


@part
def mark_resting(old, sample, table, constants):
    """Mark the readings of motors that stand, and of a vehicle that may: no evidence.

    Neither are readings that are all exactly zero, whatever the vehicle did before.
    """
    surge_filter = filters_of(SURGE, table)[0]
    for lane in range(old.age.size):
        idle = sample.zero[:, lane].all()
        for subsystem in (PORT, STARBOARD):
            channel = MOTOR_CHANNEL[subsystem]
            shaft_speed = old.shaft_speed[lane, filters_of(subsystem, table)[0]]
            stands = motor_stands(lane, channel, shaft_speed, sample, constants)
            for k in range(3):
                sample.resting[channel + k, lane] = stands or idle
        speed = old.filters[lane, surge.U, surge_filter]
        slow = speed < surge.STANDING
        stands = sample.zero[SPEED_CHANNEL, lane] and slow
        sample.resting[SPEED_CHANNEL, lane] = slow or idle
        zero = sample.zero[ACCELERATION_CHANNEL, lane]
        sample.resting[ACCELERATION_CHANNEL, lane] = (stands and zero) or idle
        sample.idle[lane] = idle


@scalar
def motor_stands(lane, channel, shaft_speed, sample, constants):
    """Whether a motor, whose first reading is `channel`, stands.

    Its counter reads zero but for noise, its shaft was slow before (`shaft_speed` [rad/s], NaN
    before the first sample), and its voltage, if read, is too low to turn it.
    """
    rpm_channel = channel + motor.OF_RPM
    silent = sample.silent[rpm_channel, lane] and not sample.replaced[rpm_channel, lane]
    largest = NOISE_OF_ZERO * constants.bank.sensors[rpm_channel, NOISE_STD]
    reads_zero = not silent and abs(sample.reading[rpm_channel, lane]) <= largest
    turned = shaft_speed * RPM > STANDING_RPM
    voltage = 0.0 if sample.silent[channel, lane] else abs(sample.reading[channel, lane])
    is_driven = voltage > motor.STANDING * constants.bank.water.maximum_voltage
    return reads_zero and not turned and not is_driven


@part
def begin_sample(observation, old, new, sample, table, constants, work):
    """Fill the sample and the last readings, and let hypotheses switch, on the lanes of a pack."""
    for lane in range(len(observation)):
        for channel in range(N_READINGS):
            new.spacing[lane, channel] = old.spacing[lane, channel]
    sensors = constants.bank.sensors
    align(observation, old, new, work.aligned)
    fill_sample(work.aligned, old.readings, new.spacing, old.noise_ratio, sensors, sample)
    keep_readings(sample, new.readings)
    mark_resting(old, sample, table, constants)
    for lane in range(len(observation)):
        if sample.idle[lane]:
            new.age[lane] = 0.0
        switch_hypotheses(
            lanes_of(old, lane),
            lanes_of(new, lane),
            table,
            constants.bank.walk,
            work.switch_probability[lane],
            work.return_probability[lane],
        )


@part
def settle(subsystem, new, table, work):
    """Let a subsystem's first samples be no evidence."""
    n_lanes = new.age.size
    columns = columns_of(subsystem, table, n_lanes)
    for lane in range(n_lanes):
        if new.age[lane] <= SETTLING_SAMPLES:
            first, last = columns_of_lane(lane, columns, n_lanes)
            for c in range(first, last):
                work.evidence[c] = 0.0


@part
def temper(log_probability, temperature, class_temperature):
    """Bring the odds of a fault, and of each fault to the others, closer to 1; 1 changes nothing.

    Each is raised to the power of 1 / temperature, that of a fault or that of its class, so that
    neither the likeliest fault changes nor whether a fault is likelier than none.
    """
    log_fault = -np.inf
    log_faults = -np.inf
    for k in range(1, log_probability.size):
        log_fault = log_sum(log_fault, log_probability[k])
        log_faults = log_sum(log_faults, log_probability[k] / class_temperature)
    log_odds = (log_fault - log_probability[0]) / temperature
    log_probability[0] = -log_sum(0.0, log_odds)
    for k in range(1, log_probability.size):
        log_share = log_probability[k] / class_temperature - log_faults
        log_probability[k] = log_share + log_odds + log_probability[0]


@kernel(notice="the filter bank: about 20 s")
def step_lanes(first, last, old, new, observation, table, constants, belief, work, sample):
    """Take the lanes from `first` to before `last` through a sample: fill `new` and `belief`.

    `sample` and `work` are memory for one pack of lanes; the last pack may overlap the one before.
    """
    n_lanes = sample.deflection.size
    for start in range(first, last, n_lanes):
        begin = min(start, last - n_lanes)
        lanes = slice(begin, begin + n_lanes)
        before = lanes_of(old, lanes)
        after = lanes_of(new, lanes)
        begin_sample(observation[lanes], before, after, sample, table, constants, work)
        for subsystem in (PORT, STARBOARD):
            update_motor(subsystem, before, after, sample, table, constants, work)
        update_surge(before, after, sample, table, constants, work)
        for subsystem in (SURGE, PORT, STARBOARD):
            scatter(subsystem, after, table, work)
            settle(subsystem, after, table, work)
        for lane in range(n_lanes):
            update_belief(lane, begin + lane, after, table, belief, work)
            temper(
                belief.log_probability[begin + lane],
                constants.temperature,
                constants.class_temperature,
            )
