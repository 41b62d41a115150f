"""The kernel of the Gaussian bank: hypotheses and their filters on every lane, and the belief."""

import math
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import READINGS
from auv_fault_env.compiling import kernel, part, scalar
from auv_fault_env.light import light, lightened
from auv_fault_env.parameters import SAMPLE_TIME
from auv_fault_env.physics import RPM
from diagnosers.bank import algebra, motor, surge
from diagnosers.bank.algebra import SEVERITY
from diagnosers.bank.hypotheses import PORT, STARBOARD, SURGE
from diagnosers.bank.logarithms import exponential, log_sum, share_of_second
from diagnosers.bank.pack import column_shift, columns_of, filters_of, gather, scatter
from diagnosers.bank.sensors import fill_sample, keep_readings
from diagnosers.diagnoser import IMPOSSIBLE

CONSTANT_HAZARD_TIME = 60.0  # s; then the hazard falls as 1/age: an old vehicle is likely sound
SPEED_CHANNEL = READINGS.index("speed")
# first, by subsystem: voltage, then current and rpm
MOTOR_CHANNEL = (
    0,
    READINGS.index("port_voltage"),
    READINGS.index("starboard_voltage"),
)
# rows of `BankState.severity` and of `BankState.prior`
MEAN, VARIANCE, LEAST = range(3)


@light
class BankState(NamedTuple):
    """State of a bank, lane first; NaN where nothing has been read."""

    log_posterior: np.ndarray  # (n_lanes, n_hypotheses)
    severity: np.ndarray  # (n_lanes, 2, n_hypotheses), mean and variance
    filters: np.ndarray  # (n_lanes, N_MOMENTS, n_filters), means and packed covariances
    shaft_speed: np.ndarray  # (n_lanes, n_filters), of the motor filters [rad/s]
    readings: np.ndarray  # (n_lanes, N_READINGS), the last ones
    healthy: np.ndarray  # (n_lanes, n_parameters), the vehicle without its fault
    prior: np.ndarray  # (n_lanes, 3, n_grades), mean, variance and least value of the severity
    age: np.ndarray  # (n_lanes,), samples so far


@part
def switch_severities(switch_probability, old, new, table, walk):
    """Mix the severities of the hypotheses of one lane with the prior, and let them walk.

    switch_probability (n_hypotheses,): that a hypothesis began at this sample; 0 for normal.
    """
    switch_probability[0] = 0.0
    new.severity[:, 0] = 0.0
    for h in range(1, switch_probability.size):
        grade = table.grade[h]
        probability = switch_probability[h]
        prior_variance = old.prior[VARIANCE, grade]
        mean = old.severity[MEAN, h]
        distance = old.prior[MEAN, grade] - mean
        new.severity[MEAN, h] = mean + probability * distance
        variance = algebra.mixed_covariance(
            old.severity[VARIANCE, h], prior_variance, distance * distance, probability
        )
        new.severity[VARIANCE, h] = algebra.variance_after_walk(variance, prior_variance, walk)


@part
def switch_hypotheses(old, new, table, walk, switch_probability):
    """Let hypotheses of one lane begin: posterior, severities, and the probability of this onset.

    The hazard falls with age: a constant one would, by exp(-hazard) per sample, move the posterior
    from normal to any fault too slight to be distinguished from the healthy band.
    """
    relative_age = max(1.0, old.age * SAMPLE_TIME / CONSTANT_HAZARD_TIME)
    log_normal = old.log_posterior[0]
    new.log_posterior[0] = log_normal + table.log_hazard[0] / relative_age
    log_age = math.log(relative_age)
    for h in range(1, table.log_hazard.size):
        before = old.log_posterior[h]
        log_switched = log_normal + table.log_hazard[h] - log_age
        new.log_posterior[h] = log_sum(before, log_switched)
        switch_probability[h] = share_of_second(before, log_switched)
    switch_severities(switch_probability, old, new, table, walk)


@part
def begin_filters(subsystem, old, table, work):
    """Fill the columns of a subsystem from the state, and what mixing needs."""
    n_lanes = old.age.size
    first, last = filters_of(subsystem, table)
    mean_row, variance_row = algebra.severity_rows(work)
    gather(subsystem, old, table, work)
    for lane in range(n_lanes):
        shift = column_shift(lane, subsystem, table, n_lanes)
        for f in range(first, last):
            c = f + shift
            h = table.hypothesis[f]
            grade = table.grade[h]
            work.normal[mean_row, c] = old.prior[lane, MEAN, grade]
            work.normal[variance_row, c] = old.prior[lane, VARIANCE, grade]
            work.mixing_probability[c] = work.switch_probability[lane, h]
            work.evidence[c] = 0.0
    replace_severities(subsystem, old.severity, table, work)


@part
def replace_severities(subsystem, severity, table, work):
    """Replace the severities of a subsystem's filters by those of their hypotheses.

    severity is that of `BankState`.
    """
    n_lanes = len(severity)
    first, last = filters_of(subsystem, table)
    for lane in range(n_lanes):
        shift = column_shift(lane, subsystem, table, n_lanes)
        for f in range(first, last):
            c = f + shift
            h = table.hypothesis[f]
            work.severity[MEAN, c] = severity[lane, MEAN, h]
            work.severity[VARIANCE, c] = severity[lane, VARIANCE, h]
    algebra.replace_severity(columns_of(subsystem, table, n_lanes), work)


@part
def mix_filters(subsystem, old, new, table, walk, work):
    """Fill the columns of a subsystem: filters mixed with the normal one, severities updated."""
    columns = columns_of(subsystem, table, old.age.size)
    begin_filters(subsystem, old, table, work)
    algebra.mix(columns, work)
    algebra.walk_severity(columns, walk, work)
    replace_severities(subsystem, new.severity, table, work)


@part
def update_severity(subsystem, new, table, work):
    """Set the severities of the hypotheses to those that their filters of a subsystem have now."""
    n_lanes = new.age.size
    x = work.filters
    mean_row, variance_row = algebra.severity_rows(work)
    normal, last = filters_of(subsystem, table)
    for lane in range(n_lanes):
        shift = column_shift(lane, subsystem, table, n_lanes)
        for f in range(normal + np.uint64(1), last):
            c = f + shift
            h = table.hypothesis[f]
            grade = table.grade[h]
            mean = max(x[mean_row, c], new.prior[lane, LEAST, grade])
            new.severity[lane, MEAN, h] = min(mean, 1.0)
            new.severity[lane, VARIANCE, h] = x[variance_row, c]


@part
def begin_shaft_speeds(subsystem, old, sample, table, work):
    """Fill the shaft speeds before the sample; the normal filter's replaces a silent reading."""
    n_lanes = old.age.size
    rpm_channel = MOTOR_CHANNEL[subsystem] + motor.OF_RPM
    normal, last = filters_of(subsystem, table)
    for lane in range(n_lanes):
        of_normal = old.shaft_speed[lane, normal] * RPM
        if sample.silent[rpm_channel, lane] and not math.isnan(of_normal):
            sample.reading[rpm_channel, lane] = of_normal
        shift = column_shift(lane, subsystem, table, n_lanes)
        for f in range(normal, last):
            before = old.shaft_speed[lane, f]
            if math.isnan(before):
                before = sample.reading[rpm_channel, lane] / RPM
            c = f + shift
            work.shaft_speed_before[c] = max(before, 0.0)


@part
def update_motor(subsystem, old, new, sample, table, constants, work):
    """Take all filters of one motor through a sample."""
    n_lanes = old.age.size
    first, last = filters_of(subsystem, table)
    columns = columns_of(subsystem, table, n_lanes)
    mix_filters(subsystem, old, new, table, constants.walk, work)
    begin_shaft_speeds(subsystem, old, sample, table, work)
    for lane in range(n_lanes):
        shift = column_shift(lane, subsystem, table, n_lanes)
        for f in range(first, last):
            c = f + shift
            if table.estimates_speed[f] or sample.silent[SPEED_CHANNEL, lane]:
                surge_filter = table.filter[SURGE, table.hypothesis[f]]
                work.surge_speed[c] = old.filters[lane, surge.U, surge_filter]
            else:
                work.surge_speed[c] = sample.reading[SPEED_CHANNEL, lane]
    motor.update(columns, sample, MOTOR_CHANNEL[subsystem], constants.water, work)
    algebra.clip_deviations(columns, range(SEVERITY), work)
    update_severity(subsystem, new, table, work)


@part
def gather_shaft(shaft, subsystem, old, table, work):
    """Fill a motor's shaft speeds for each surge filter, (4, n_columns), see `surge.RPM_NOW`."""
    n_lanes = old.age.size
    first, last = filters_of(SURGE, table)
    for lane in range(n_lanes):
        shift = column_shift(lane, SURGE, table, n_lanes)
        motor_shift = column_shift(lane, subsystem, table, n_lanes)
        for f in range(first, last):
            c = f + shift
            motor_filter = table.filter[subsystem, table.hypothesis[f]]
            motor_column = motor_filter + motor_shift
            before = old.shaft_speed[lane, motor_filter]
            now = work.shaft_speed[motor_column] * RPM
            shaft[surge.RPM_NOW, c] = now
            shaft[surge.RPM_BEFORE, c] = now if math.isnan(before) else before * RPM
            shaft[surge.RPM_SLOPE, c] = work.shaft_speed_slope[motor_column] * RPM
            shaft[surge.RPM_STD, c] = work.shaft_speed_noise[motor_column]


@part
def update_surge(old, new, sample, table, constants, work):
    """Take all surge filters through a sample."""
    columns = columns_of(SURGE, table, old.age.size)
    mix_filters(SURGE, old, new, table, constants.walk, work)
    gather_shaft(work.port, PORT, old, table, work)
    gather_shaft(work.starboard, STARBOARD, old, table, work)
    surge.update(columns, sample, constants, work)
    algebra.clip_deviations(columns, surge.DEVIATIONS, work)
    update_severity(SURGE, new, table, work)


@part
def update_posterior(lane, log_posterior, n_lanes, table, evidence, share):
    """Bayes' rule over the hypotheses of one lane of a pack, normalised.

    share (n_hypotheses,) is memory.
    """
    surge_shift = column_shift(lane, SURGE, table, n_lanes)
    port_shift = column_shift(lane, PORT, table, n_lanes)
    starboard_shift = column_shift(lane, STARBOARD, table, n_lanes)
    highest = -np.inf
    total = 0.0
    for h in range(log_posterior.size):
        log_likelihood = evidence[table.filter[SURGE, h] + surge_shift]
        log_likelihood += evidence[table.filter[PORT, h] + port_shift]
        log_likelihood += evidence[table.filter[STARBOARD, h] + starboard_shift]
        log_posterior[h] += log_likelihood
        highest = max(highest, log_posterior[h])
    for h in range(log_posterior.size):
        share[h] = exponential(log_posterior[h] - highest)
    for h in range(log_posterior.size):
        total += share[h]
    log_total = highest + math.log(total)
    for h in range(log_posterior.size):
        log_posterior[h] -= log_total


@part
def fill_belief(log_posterior, severity, class_index, share, total, log_probability, mean, std):
    """Fill a lane's belief: sums over the hypotheses of a class, and moments of its severity.

    share (n_hypotheses,) and total (n_classes,) are memory.
    """
    highest = log_probability
    highest[:] = IMPOSSIBLE
    total[:] = 0.0
    mean[:] = 0.0
    std[:] = 0.0
    for h in range(log_posterior.size):
        highest[class_index[h]] = max(highest[class_index[h]], log_posterior[h])
    for h in range(log_posterior.size):
        share[h] = exponential(log_posterior[h] - highest[class_index[h]])
    for h in range(log_posterior.size):
        k = class_index[h]
        s = severity[MEAN, h]
        total[k] += share[h]
        mean[k] += share[h] * s
        std[k] += share[h] * (s * s + severity[VARIANCE, h])
    for k in range(mean.size):
        if total[k] > 0.0:
            log_probability[k] += math.log(total[k])
            mean[k] = min(mean[k] / total[k], 1.0)
            variance = std[k] / total[k] - mean[k] * mean[k]
            std[k] = math.sqrt(max(variance, 0.0))


@part
def update_belief(lane, belief_lane, new, table, belief, work):
    """Update the posterior of a lane of a pack, and fill the belief of that lane."""
    log_posterior = new.log_posterior[lane]
    share = work.share
    update_posterior(lane, log_posterior, new.age.size, table, work.evidence, share)
    fill_belief(
        log_posterior,
        new.severity[lane],
        table.class_index,
        share,
        work.total,
        belief.log_probability[belief_lane],
        belief.severity_mean[belief_lane],
        belief.severity_std[belief_lane],
    )


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
            state.healthy[lanes],
            state.prior[lanes],
            state.age[lanes],
        )
    )


@part
def begin_sample(observation, old, new, sample, table, constants, work):
    """Fill the sample and the last readings, and let hypotheses switch, on the lanes of a pack."""
    fill_sample(observation, old.readings, constants.sensors, sample)
    keep_readings(sample, new.readings)
    for lane in range(len(observation)):
        old_lane = lanes_of(old, lane)
        new_lane = lanes_of(new, lane)
        switch_hypotheses(old_lane, new_lane, table, constants.walk, work.switch_probability[lane])


@kernel(notice="the Gaussian bank: about 15 s")
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
        for lane in range(n_lanes):
            update_belief(lane, begin + lane, after, table, belief, work)
