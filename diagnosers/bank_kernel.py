"""The loops of the filter bank: hypotheses and their filters on every lane, and the belief that follows."""

import math
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import COMMANDS, READINGS
from auv_fault_env.compiling import inlined, kernel, scalar
from auv_fault_env.parameters import SAMPLE_TIME
from auv_fault_env.physics import RPM
from diagnosers import bank_motor, bank_surge
from diagnosers.bank_algebra import N_STATES, SEVERITY, SPREAD, bound, inform, mix, widened
from diagnosers.bank_sensors import Seen, look
from diagnosers.hypotheses import N_ROWS, PORT, STARBOARD, SURGE

FIRST_READING, N_READINGS = len(COMMANDS), len(READINGS)  # of an observation
RUDDER, STERN_PLANE = COMMANDS.index("rudder"), COMMANDS.index("stern_plane")
RUN_IN = 60.0  # s of constant hazard; then it falls as 1/age: who has run so long is likely sound
IMPOSSIBLE = -1e30  # log probability of a class without hypotheses: finite, also as float32
MOTOR_READING = (0, READINGS.index("port_voltage"), READINGS.index("starboard_voltage"))  # first, by subsystem
motor_update, surge_update = bank_motor.update, bank_surge.update


class BankState(NamedTuple):
    """What a bank knows, lane first.

    log_weight (n_lanes, n_hypotheses): log probabilities. severity (n_lanes, 2, n_hypotheses): mean and variance.
    filters (n_lanes, 20, n_filters): means and packed covariances of five states. turning (n_lanes, n_filters): the
    shaft speed [rad/s] that each motor filter believes in. readings (n_lanes, 8): the last ones heard, NaN before.
    healthy (n_lanes, n_parameters): the vehicle without its fault. prior (n_lanes, 3, n_grades): mean, variance and
    least value of the severity by grade. age (n_lanes,): samples so far.
    """

    log_weight: np.ndarray
    severity: np.ndarray
    filters: np.ndarray
    turning: np.ndarray
    readings: np.ndarray
    healthy: np.ndarray
    prior: np.ndarray
    age: np.ndarray


class Work(NamedTuple):
    """Memory of one call: what does not outlive a lane's update; (n_filters,) where nothing is said."""

    values: np.ndarray  # (N_ROWS, n_filters)
    by_severity: np.ndarray  # (N_ROWS, n_filters)
    gradient: np.ndarray  # (5, n_filters)
    second: np.ndarray  # (5, n_filters)
    crossed: np.ndarray  # (5, n_filters)
    expected: np.ndarray  # (3, n_filters)
    trial: np.ndarray  # (3, n_filters)
    delivered: np.ndarray  # (3, n_filters)
    by_voltage: np.ndarray  # (2, n_filters)
    innovation: np.ndarray  # (2, n_filters)
    variance: np.ndarray  # (2, n_filters)
    port: np.ndarray  # (4, n_filters)
    starboard: np.ndarray  # (4, n_filters)
    prior: np.ndarray  # (2, n_filters)
    severity: np.ndarray  # (2, n_filters)
    shift: np.ndarray
    growth: np.ndarray
    evidence: np.ndarray
    start: np.ndarray
    speed: np.ndarray
    share: np.ndarray
    turning_slope: np.ndarray
    turning_noise: np.ndarray
    newcomers: np.ndarray  # (n_hypotheses,)
    base: np.ndarray  # (3, N_ROWS)


@scalar
def workspace(n_hypotheses, n):
    """Room for one lane."""
    return Work(
        np.zeros((N_ROWS, n)),
        np.zeros((N_ROWS, n)),
        np.zeros((N_STATES, n)),
        np.zeros((N_STATES, n)),
        np.zeros((N_STATES, n)),
        np.zeros((3, n)),
        np.zeros((3, n)),
        np.zeros((3, n)),
        np.zeros((2, n)),
        np.zeros((2, n)),
        np.zeros((2, n)),
        np.zeros((4, n)),
        np.zeros((4, n)),
        np.zeros((2, n)),
        np.zeros((2, n)),
        np.zeros(n),
        np.zeros(n),
        np.zeros(n),
        np.zeros(n),
        np.zeros(n),
        np.zeros(n),
        np.zeros(n),
        np.zeros(n),
        np.zeros(n_hypotheses),
        np.zeros((3, N_ROWS)),
    )


@scalar
def log_sum(one, other):
    """Logarithm of the sum of two numbers given by their logarithms."""
    high, low = max(one, other), min(one, other)
    return high + math.log1p(math.exp(low - high)) if low > -np.inf else high


@inlined
def switch(old, new, table, walk, newcomers):
    """Let normal vehicles turn faulty: weights, severities, and every hypothesis' share of newcomers.

    The hazard falls with age. A constant one would give the vehicle up in the end, by exp(-hazard) per sample, to any
    fault that is too slight to be told from the healthy band.
    """
    seasoned = max(1.0, old.age * SAMPLE_TIME / RUN_IN)
    new.log_weight[0] = old.log_weight[0] + table.log_hazard[0] / seasoned
    new.severity[:, 0] = 0.0
    newcomers[0] = 0.0
    for j in range(1, table.log_hazard.size):
        joining = old.log_weight[0] + table.log_hazard[j] - math.log(seasoned)
        new.log_weight[j] = log_sum(old.log_weight[j], joining)
        share = math.exp(joining - new.log_weight[j])
        centre, variance = old.prior[0, table.grade[j]], old.prior[1, table.grade[j]]
        away, keep = centre - old.severity[0, j], 1.0 - share
        new.severity[0, j] = old.severity[0, j] + share * away
        merged = keep * old.severity[1, j] + share * (variance + keep * away * away)
        new.severity[1, j] = widened(merged, variance, walk)
        newcomers[j] = share


@inlined
def recall(m, old, new, table, walk, work):
    """Bring the filters of subsystem m from the last sample to this one's switching and severities."""
    part, x = (table.first[m], table.first[m + 1]), new.filters
    for f in range(part[0], part[1]):
        j = table.hypothesis[f]
        grade = table.grade[j]
        work.prior[0, f], work.prior[1, f] = old.prior[0, grade], old.prior[1, grade]
        work.severity[0, f], work.severity[1, f] = old.severity[0, j], old.severity[1, j]
        work.share[f] = work.newcomers[j]
        work.evidence[f] = 0.0
    for i in range(x.shape[0]):
        for f in range(part[0], part[1]):
            x[i, f] = old.filters[i, f]
    inform(x, part, work.severity[0], work.severity[1], work.shift, work.growth)
    mix(x, part, old.filters[:, part[0]].copy(), work.share, work.prior[0], work.prior[1], walk)
    for f in range(part[0], part[1]):
        j = table.hypothesis[f]
        work.severity[0, f], work.severity[1, f] = new.severity[0, j], new.severity[1, j]
    inform(x, part, work.severity[0], work.severity[1], work.shift, work.growth)


@inlined
def learn(m, new, table, prior):
    """Tell the hypotheses what their filters of subsystem m have learnt of the severity."""
    for f in range(table.first[m] + np.uint64(1), table.first[m + 1]):
        j = table.hypothesis[f]
        new.severity[0, j] = min(max(new.filters[SEVERITY, f], prior[2, table.grade[j]]), 1.0)
        new.severity[1, j] = new.filters[SPREAD, f]


@inlined
def update_motor(m, old, new, seen, table, constants, work):
    """All filters of one motor."""
    part, at = (table.first[m], table.first[m + 1]), MOTOR_READING[m]
    recall(m, old, new, table, constants.walk, work)
    if seen.silent[at + 2] and not math.isnan(old.turning[part[0]]):
        seen.reading[at + 2] = old.turning[part[0]] * RPM  # for want of a reading, what the normal vehicle predicts
    for f in range(part[0], part[1]):
        before = old.turning[f]
        before = seen.reading[at + 2] / RPM if math.isnan(before) else before
        work.start[f] = max(before, 0.0)
        own = table.slot[SURGE, table.hypothesis[f]]
        work.speed[f] = old.filters[0, own] if table.owns_speed[f] or seen.silent[0] else seen.reading[0]
    base = work.base[m]
    motor_update(
        new.filters,
        part,
        base,
        table.slope,
        table.offset,
        seen,
        at,
        work.start,
        work.speed,
        new.turning,
        constants.water,
        work,
    )
    bound(new.filters, part, 0)
    learn(m, new, table, old.prior)


@inlined
def take_shaft(shaft, m, old, new, table, work):
    """Fill what each surge filter believes of one shaft, (4, n_filters) as in `bank_surge.NOW`."""
    for f in range(table.first[SURGE], table.first[SURGE + 1]):
        own = table.slot[m, table.hypothesis[f]]
        shaft[0, f] = new.turning[own] * RPM
        shaft[1, f] = shaft[0, f] if math.isnan(old.turning[own]) else old.turning[own] * RPM
        shaft[2, f] = work.turning_slope[own] * RPM
        shaft[3, f] = work.turning_noise[own]


@inlined
def update_surge(old, new, seen, table, constants, work):
    """All surge filters."""
    part, base = (table.first[SURGE], table.first[SURGE + 1]), work.base[SURGE]
    recall(SURGE, old, new, table, constants.walk, work)
    for m, shaft in ((PORT, work.port), (STARBOARD, work.starboard)):
        take_shaft(shaft, m, old, new, table, work)
    surge_update(new.filters, part, base, table.slope, table.offset, seen, work.port, work.starboard, constants, work)
    bound(new.filters, part, 2)  # behind speed and disturbance
    learn(SURGE, new, table, old.prior)


@inlined
def weigh(log_weight, slot, evidence):
    """Bayes' rule over the hypotheses, normalised."""
    top, total = -np.inf, 0.0
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
        share, s = math.exp(log_weight[j] - log_probability[diagnosis[j]]), severity[0, j]
        mean[diagnosis[j]] += share * s
        std[diagnosis[j]] += share * (s * s + severity[1, j])
    for c in range(mean.size):
        mean[c] = min(mean[c], 1.0)
        std[c] = math.sqrt(max(std[c] - mean[c] * mean[c], 0.0))


@scalar
def lane_of(state, lane):
    """One lane of a state, as views."""
    return BankState(
        state.log_weight[lane],
        state.severity[lane],
        state.filters[lane],
        state.turning[lane],
        state.readings[lane],
        state.healthy[lane],
        state.prior[lane],
        state.age[lane],
    )


@kernel
def step_lanes(first, last, old, new, observation, table, constants, belief):
    """One sample of the lanes from `first` to before `last`: fill `new` and `belief` from `old` and the observation."""
    work = workspace(old.log_weight.shape[1], old.filters.shape[2])
    reading, log_spacing = np.zeros(N_READINGS), np.zeros(N_READINGS)
    repeated, zero = np.zeros(N_READINGS, np.bool_), np.zeros(N_READINGS, np.bool_)
    silent, held = np.zeros(N_READINGS, np.bool_), np.zeros(N_READINGS, np.bool_)
    for lane in range(first, last):
        rudder, plane = observation[lane, RUDDER], observation[lane, STERN_PLANE]
        seen = Seen(reading, repeated, zero, silent, held, log_spacing, rudder * rudder + plane * plane)
        before, after = lane_of(old, lane), lane_of(new, lane)
        look(observation[lane, FIRST_READING:], before.readings, constants.sensors, seen)
        for c in range(N_READINGS):
            after.readings[c] = reading[c] if held[c] or not silent[c] else np.nan
        after.turning[:] = 0.0
        for m in range(3):
            for r in range(N_ROWS):
                work.base[m, r] = before.healthy[table.rows[m, r]]
        switch(before, after, table, constants.walk, work.newcomers)
        for m in (PORT, STARBOARD):
            update_motor(m, before, after, seen, table, constants, work)
        update_surge(before, after, seen, table, constants, work)
        weigh(after.log_weight, table.slot, work.evidence)
        one = belief[0][lane], belief[1][lane], belief[2][lane]
        summarise(after.log_weight, after.severity, table.diagnosis, one[0], one[1], one[2])
