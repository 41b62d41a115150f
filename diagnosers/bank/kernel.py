"""The loops of the filter bank: hypotheses and their filters on every lane, and the belief that follows."""

import math
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import READINGS
from auv_fault_env.compiling import inlined, kernel, scalar
from auv_fault_env.parameters import SAMPLE_TIME
from auv_fault_env.physics import RPM
from diagnosers.bank import motor, surge
from diagnosers.bank.algebra import N_PACKED, SEVERITY, SPREAD, bound, entry, inform, mix, widened
from diagnosers.bank.hypotheses import N_ROWS, PORT, STARBOARD, SURGE
from diagnosers.bank.pack import columns_of, spread
from diagnosers.bank.sensors import N_READINGS, look

RUN_IN = 60.0  # s of constant hazard; then it falls as 1/age: who has run so long is likely sound
IMPOSSIBLE = -1e30  # log probability of a class without hypotheses: finite, also as float32
# first, by subsystem
MOTOR_READING = (0, READINGS.index("port_voltage"), READINGS.index("starboard_voltage"))
motor_update = motor.update
surge_update = surge.update


class BankState(NamedTuple):
    """What a bank knows, lane first.

    log_weight (n_lanes, n_hypotheses): log probabilities. severity (n_lanes, 2, n_hypotheses): mean
    and variance. filters (n_lanes, 20, n_filters): means and packed covariances of five states.
    turning (n_lanes, n_filters): the shaft speed [rad/s] that each motor filter believes in.
    readings (n_lanes, 8): the last ones heard, NaN before. healthy (n_lanes, n_parameters): the
    vehicle without its fault. prior (n_lanes, 3, n_grades): mean, variance and least value of the
    severity by grade. age (n_lanes,): samples so far.
    """

    log_weight: np.ndarray
    severity: np.ndarray
    filters: np.ndarray
    turning: np.ndarray
    readings: np.ndarray
    healthy: np.ndarray
    prior: np.ndarray
    age: np.ndarray


@scalar
def log_sum(one, other):
    """Logarithm of the sum of two numbers given by their logarithms."""
    high = max(one, other)
    low = min(one, other)
    return high + math.log1p(math.exp(low - high)) if low > -np.inf else high


@inlined
def switch(old, new, table, walk, newcomers):
    """Let normal vehicles turn faulty: weights, severities, and every hypothesis' share of newcomers.

    The hazard falls with age. A constant one would give the vehicle up in the end, by exp(-hazard)
    per sample, to any fault that is too slight to be told from the healthy band.
    """
    seasoned = max(1.0, old.age * SAMPLE_TIME / RUN_IN)
    new.log_weight[0] = old.log_weight[0] + table.log_hazard[0] / seasoned
    new.severity[:, 0] = 0.0
    newcomers[0] = 0.0
    for j in range(1, table.log_hazard.size):
        joining = old.log_weight[0] + table.log_hazard[j] - math.log(seasoned)
        new.log_weight[j] = log_sum(old.log_weight[j], joining)
        share = math.exp(joining - new.log_weight[j])
        centre = old.prior[0, table.grade[j]]
        variance = old.prior[1, table.grade[j]]
        away = centre - old.severity[0, j]
        keep = 1.0 - share
        new.severity[0, j] = old.severity[0, j] + share * away
        merged = keep * old.severity[1, j] + share * (variance + keep * away * away)
        new.severity[1, j] = widened(merged, variance, walk)
        newcomers[j] = share


@inlined
def take(m, old, table, work):
    """Fill the columns of subsystem m from the lanes' filters and healthy vehicles."""
    n_lanes = np.uint64(old.age.size)
    first = table.first[m]
    last = table.first[m + 1]
    part = columns_of(m, table, n_lanes)
    for i in range(N_PACKED):
        for p in range(n_lanes):
            for f in range(first, last):
                work.filters[i, f * n_lanes + p] = old.filters[p, i, f]
    for i in range(SEVERITY):
        spread(old.filters[:, i, first], part, work.normal[i])
        for j in range(i + 1):
            spread(old.filters[:, entry(i, j), first], part, work.normal[entry(i, j)])
    for r in range(N_ROWS):
        spread(old.healthy[:, table.rows[m, r]], part, work.base[r])


@inlined
def give(new, work):
    """Fill the lanes' filters from all columns; `turning` is told by motors alone, and stays zero in others."""
    n_lanes = np.uint64(new.age.size)
    n_filters = np.uint64(new.turning.shape[1])
    for p in range(n_lanes):
        for f in range(n_filters):
            new.turning[p, f] = work.turning[f * n_lanes + p]
        for i in range(N_PACKED):
            for f in range(n_filters):
                new.filters[p, i, f] = work.filters[i, f * n_lanes + p]


@inlined
def recall(m, old, new, table, walk, work):
    """Bring the filters of subsystem m from the last sample to this one's switching and severities."""
    n_lanes = np.uint64(old.age.size)
    x = work.filters
    part = columns_of(m, table, n_lanes)
    take(m, old, table, work)
    for p in range(n_lanes):
        for f in range(table.first[m], table.first[m + 1]):
            column = f * n_lanes + p
            j = table.hypothesis[f]
            grade = table.grade[j]
            work.prior[0, column] = old.prior[p, 0, grade]
            work.prior[1, column] = old.prior[p, 1, grade]
            work.severity[0, column] = old.severity[p, 0, j]
            work.severity[1, column] = old.severity[p, 1, j]
            work.share[column] = work.newcomers[p, j]
            work.evidence[column] = 0.0
    inform(x, part, work.severity[0], work.severity[1], work.shift, work.growth)
    mix(x, part, work.normal, work.share, work.prior[0], work.prior[1], walk)
    for p in range(n_lanes):
        for f in range(table.first[m], table.first[m + 1]):
            column = f * n_lanes + p
            j = table.hypothesis[f]
            work.severity[0, column] = new.severity[p, 0, j]
            work.severity[1, column] = new.severity[p, 1, j]
    inform(x, part, work.severity[0], work.severity[1], work.shift, work.growth)


@inlined
def learn(m, new, table, work):
    """Tell the hypotheses what their filters of subsystem m have learnt of the severity."""
    n_lanes = np.uint64(new.age.size)
    x = work.filters
    for p in range(n_lanes):
        for f in range(table.first[m] + np.uint64(1), table.first[m + 1]):
            column = f * n_lanes + p
            j = table.hypothesis[f]
            new.severity[p, 0, j] = min(
                max(x[SEVERITY, column], new.prior[p, 2, table.grade[j]]), 1.0
            )
            new.severity[p, 1, j] = x[SPREAD, column]


@inlined
def update_motor(m, old, new, seen, table, constants, work):
    """All filters of one motor."""
    n_lanes = np.uint64(old.age.size)
    rpm = MOTOR_READING[m] + 2
    part = columns_of(m, table, n_lanes)
    recall(m, old, new, table, constants.walk, work)
    for p in range(n_lanes):
        predicted = old.turning[p, table.first[m]] * RPM  # of the normal vehicle
        if seen.silent[rpm, p] and not math.isnan(predicted):
            seen.reading[rpm, p] = predicted
        for f in range(table.first[m], table.first[m + 1]):
            column = f * n_lanes + p
            own = table.slot[SURGE, table.hypothesis[f]]
            before = old.turning[p, f]
            before = seen.reading[rpm, p] / RPM if math.isnan(before) else before
            work.start[column] = max(before, 0.0)
            deaf = table.owns_speed[f] or seen.silent[0, p]
            work.speed[column] = old.filters[p, 0, own] if deaf else seen.reading[0, p]
    motor_update(work.filters, part, seen, MOTOR_READING[m], constants.water, work)
    bound(work.filters, part, 0)
    learn(m, new, table, work)


@inlined
def take_shaft(shaft, m, old, table, work):
    """Fill what each surge filter believes of one shaft, (4, n_columns) as in `bank_surge.NOW`."""
    n_lanes = np.uint64(old.age.size)
    for p in range(n_lanes):
        for f in range(table.first[SURGE], table.first[SURGE + 1]):
            own = np.uint64(table.slot[m, table.hypothesis[f]])
            column = f * n_lanes + p
            motor = own * n_lanes + p
            before = old.turning[p, own]
            shaft[0, column] = work.turning[motor] * RPM
            shaft[1, column] = shaft[0, column] if math.isnan(before) else before * RPM
            shaft[2, column] = work.turning_slope[motor] * RPM
            shaft[3, column] = work.turning_noise[motor]


@inlined
def update_surge(old, new, seen, table, constants, work):
    """All surge filters."""
    part = columns_of(SURGE, table, old.age.size)
    recall(SURGE, old, new, table, constants.walk, work)
    for m, shaft in ((PORT, work.port), (STARBOARD, work.starboard)):
        take_shaft(shaft, m, old, table, work)
    surge_update(work.filters, part, seen, work.port, work.starboard, constants, work)
    bound(work.filters, part, 2)  # behind speed and disturbance
    learn(SURGE, new, table, work)


@inlined
def weigh(log_weight, slot, evidence):
    """Bayes' rule over the hypotheses, normalised."""
    top = -np.inf
    total = 0.0
    for j in range(log_weight.size):
        log_weight[j] += evidence[slot[0, j]] + evidence[slot[1, j]] + evidence[slot[2, j]]
        top = max(top, log_weight[j])
    for j in range(log_weight.size):
        total += math.exp(log_weight[j] - top)
    for j in range(log_weight.size):
        log_weight[j] -= top + math.log(total)


@inlined
def summarise(log_weight, severity, diagnosis, log_probability, mean, std):
    """Fill a lane's belief: sums over the hypotheses of a class, and the mixture's moments of the severity."""
    log_probability[:] = IMPOSSIBLE
    mean[:] = 0.0
    std[:] = 0.0
    for j in range(log_weight.size):
        log_probability[diagnosis[j]] = log_sum(log_probability[diagnosis[j]], log_weight[j])
    for j in range(1, log_weight.size):
        share = math.exp(log_weight[j] - log_probability[diagnosis[j]])
        s = severity[0, j]
        mean[diagnosis[j]] += share * s
        std[diagnosis[j]] += share * (s * s + severity[1, j])
    for c in range(mean.size):
        mean[c] = min(mean[c], 1.0)
        std[c] = math.sqrt(max(std[c] - mean[c] * mean[c], 0.0))


@scalar
def lanes_of(state, lanes):
    """Some lanes of a state (a slice), or one of them (its index), as views."""
    return BankState(
        state.log_weight[lanes],
        state.severity[lanes],
        state.filters[lanes],
        state.turning[lanes],
        state.readings[lanes],
        state.healthy[lanes],
        state.prior[lanes],
        state.age[lanes],
    )


@kernel
def step_lanes(first, last, old, new, observation, table, constants, belief, work, seen):
    """One sample of the lanes from `first` to before `last`: fill `new` and `belief` from `old` and the observation.

    `seen` and `work` are memory for a pack of lanes, taken at once; the last pack overlaps the one
    before if it must.
    """
    n_lanes = seen.deflection.size
    for start in range(first, last, n_lanes):
        begin = min(start, last - n_lanes)
        lanes = slice(begin, begin + n_lanes)
        before = lanes_of(old, lanes)
        after = lanes_of(new, lanes)
        look(observation[lanes], before.readings, constants.sensors, seen)
        for p in range(n_lanes):
            for c in range(N_READINGS):
                heard = seen.held[c, p] or not seen.silent[c, p]
                after.readings[p, c] = seen.reading[c, p] if heard else np.nan
            switch(
                lanes_of(before, p), lanes_of(after, p), table, constants.walk, work.newcomers[p]
            )
        for m in (PORT, STARBOARD):
            update_motor(m, before, after, seen, table, constants, work)
        update_surge(before, after, seen, table, constants, work)
        give(after, work)
        for p in range(n_lanes):
            weigh(after.log_weight[p], table.slot, work.evidence[p::n_lanes])
            one = belief[0][begin + p], belief[1][begin + p], belief[2][begin + p]
            summarise(
                after.log_weight[p], after.severity[p], table.diagnosis, one[0], one[1], one[2]
            )
