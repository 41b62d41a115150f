"""The motor filters of the bank: voltage, four deviations, offset of the current, severity.

The voltage walks at random; its reading is a measurement. From it `physics.shaft_speed_after`
predicts the shaft speed, whose reading is the second measurement, and Ohm's law the current, the
third.
"""

import math

from auv_fault_env import physics
from auv_fault_env.compiling import part, scalar
from auv_fault_env.physics import RPM
from diagnosers.bank.algebra import covariance_row
from diagnosers.bank.motor import (
    CURRENT,
    CURRENT_READING,
    OF_CURRENT,
    OF_RPM,
    OF_VOLTAGE,
    RESISTANCE,
    RPM_READING,
    SHAFT_SPEED,
    SPEED,
    TORQUE_CONSTANT,
    VOLTAGE,
    estimate_shaft_speed,
    gather_readings,
    linearise,
    predict_shaft_speed,
    set_parameters,
    shaft_of,
    shift_innovation,
    take_current,
)
from diagnosers.bank.pack import broadcast, columns_of_lane
from diagnosers.bank.sensors import BIAS, GAIN, MIN_GAIN, NOISE, reading_of, truth_of
from diagnosers.robust.algebra import N_STATES, SEVERITY, condition, keep_standardised
from diagnosers.robust.sensors import begin_zero, end_zero, keep_evidence, replace_evidence

# states: true voltage [V], relative deviations of four parameters, zero offset of the current [A]
VOLTS = 0
FIRST_DEVIATION = 1
ZERO = 5
# Share of the highest shaft speed, below which the shaft may stand. Where it starts to turn no
# linear model holds.
STANDING = 0.05
STANDING_STD = 12.0  # rpm, of the prediction for a shaft that stands
STANDING_CURRENT_STD = 0.05  # A, of the prediction for a shaft that stands
UNREAD_WALK = 0.02  # of the supply voltage per sample, of one that is not read
# of the variance by which the noise exceeds the healthy one: may change unseen in a sample
NOISY_WALK = 0.25
START_VOLTAGE_STD = 100.0  # V, before the first reading
JUMP = 9.0  # squared standard deviations, beyond which the voltage has jumped


@part
def condition_on_voltage(columns, sample, channel, tails, work):
    """Let the voltage walk and perhaps jump over the sample, and condition on its reading."""
    first, last = columns
    x = work.filters
    parameters = work.parameters
    by_severity = work.by_severity
    gradient = work.gradient
    variance_row = covariance_row(VOLTS, VOLTS, N_STATES)
    gradient[:, first:last] = 0.0
    for c in range(first, last):
        x[variance_row, c] += work.added[c]
        gain = max(parameters[VOLTAGE + GAIN, c], MIN_GAIN)
        expected = reading_of(parameters, VOLTAGE, c, x[VOLTS, c])
        work.expected[c] = expected
        innovation = work.readings[OF_VOLTAGE, c] - expected
        noise = parameters[VOLTAGE + NOISE, c] ** 2 + work.excess[OF_VOLTAGE, c]
        expected_square = noise + gain * gain * x[variance_row, c]
        jump = max(0.0, innovation * innovation - JUMP * expected_square)
        x[variance_row, c] += work.available[OF_VOLTAGE, c] * jump / (gain * gain)
        work.expected_std[c] = math.sqrt(noise + gain * gain * x[variance_row, c])
        gradient[VOLTS, c] = gain
        of_gain = by_severity[VOLTAGE + GAIN, c] * x[VOLTS, c]
        gradient[SEVERITY, c] = of_gain + by_severity[VOLTAGE + BIAS, c]
        work.innovation[c] = innovation
        work.variance[c] = noise
    begin_zero(columns, sample, channel, VOLTAGE, work.available[OF_VOLTAGE], work)
    condition(columns, work.available[OF_VOLTAGE], tails, work)
    keep_standardised(columns, OF_VOLTAGE, work)
    end_zero(columns, sample, channel, work)


@part
def imply_voltage(columns, sample, channel, maximum_voltage, work):
    """Set a voltage that does not arrive to what current and shaft speed imply, about.

    It may have jumped by any amount. Both readings then condition it like others.
    """
    n_lanes = sample.deflection.size
    x = work.filters
    parameters = work.parameters
    for lane in range(n_lanes):
        is_read = not sample.silent[channel + OF_VOLTAGE, lane]
        if is_read or sample.resting[channel, lane]:
            continue
        first, last = columns_of_lane(lane, columns, n_lanes)
        for c in range(first, last):
            if work.available[OF_CURRENT, c] * work.available[OF_RPM, c] > 0.0:
                current = truth_of(parameters, CURRENT, c, work.readings[OF_CURRENT, c])
                shaft_speed = truth_of(parameters, SPEED, c, work.readings[OF_RPM, c]) / RPM
                by_current = parameters[RESISTANCE, c] * (current - x[ZERO, c])
                x[VOLTS, c] = by_current + parameters[TORQUE_CONSTANT, c] * shaft_speed
                for i in range(N_STATES):
                    x[covariance_row(VOLTS, i, N_STATES), c] = 0.0
                x[covariance_row(VOLTS, VOLTS, N_STATES), c] = (UNREAD_WALK * maximum_voltage) ** 2


@scalar
def predict_readings(parameters, c, voltage_shift, water, work):
    """Shaft speed [rad/s], and the readings of rpm and current, at a shift of the voltage."""
    shaft = shaft_of(parameters, c)
    voltage = work.filters[VOLTS, c] + voltage_shift
    predicted = predict_shaft_speed(shaft, c, voltage, water, work)
    current = physics.armature_current(shaft, predicted, voltage)
    rpm_reading = reading_of(parameters, SPEED, c, RPM * predicted)
    return predicted, rpm_reading, reading_of(parameters, CURRENT, c, current)


@part
def compute_innovations(columns, constants, work):
    """Fill innovations and variances of rpm and current.

    The rpm reading may lag by about ``constants.lateness`` samples, and the shaft with it. Where a
    shaft may stand, no prediction is exact.
    """
    highest = STANDING * constants.bank.water.maximum_rpm / RPM
    first, last = columns
    x = work.filters
    parameters = work.parameters
    readings = work.readings
    excess = work.excess
    predicted = work.predicted
    for c in range(first, last):
        before = work.shaft_speed_before[c]
        after = predicted[SHAFT_SPEED, c]
        lag = constants.lateness * (after - before)
        standing = max(1.0 - max(before, after) / highest, 0.0)
        current_by_lag = lag * parameters[TORQUE_CONSTANT, c] / parameters[RESISTANCE, c]
        rpm_variance = parameters[SPEED + NOISE, c] ** 2 + excess[OF_RPM, c]
        rpm_variance += (standing * STANDING_STD) ** 2
        work.variance[c] = rpm_variance + (RPM * lag) ** 2
        current_variance = parameters[CURRENT + NOISE, c] ** 2 + excess[OF_CURRENT, c]
        current_variance += (standing * STANDING_CURRENT_STD) ** 2
        current_variance += current_by_lag**2
        work.current_variance[c] = current_variance
        work.innovation[c] = readings[OF_RPM, c] - predicted[RPM_READING, c]
        misfit = readings[OF_CURRENT, c] - predicted[CURRENT_READING, c]
        work.current_innovation[c] = misfit - x[ZERO, c]
        work.expected[c] = readings[OF_CURRENT, c] - work.current_innovation[c]
        work.expected_std[c] = 2.0 * math.sqrt(current_variance)
        work.rpm_by_voltage[c] = work.gradient[VOLTS, c]


@part
def follow_jump(columns, work):
    """Let the voltage have changed within the noise of its reading where the shaft speed jumped.

    A command that steps moves the shaft by many standard deviations and the voltage by few, less
    than what counts as a jump of its reading.
    """
    first, last = columns
    row = covariance_row(VOLTS, VOLTS, N_STATES)
    for c in range(first, last):
        innovation = work.innovation[c]
        by_voltage = work.gradient[VOLTS, c] ** 2
        expected_square = work.variance[c] + by_voltage * work.filters[row, c]
        jump = max(0.0, innovation * innovation - JUMP * expected_square)
        walk = work.parameters[VOLTAGE + NOISE, c] ** 2 + work.excess[OF_VOLTAGE, c]
        if jump < walk * by_voltage:
            walk = jump / by_voltage
        work.filters[row, c] += work.available[OF_RPM, c] * work.available[OF_VOLTAGE, c] * walk


@part
def widen_voltage(columns, sample, channel, maximum_voltage, work):
    """Add to the walk of voltages that are not read, or read with much noise."""
    n_lanes = sample.deflection.size
    for lane in range(n_lanes):
        is_held = sample.replaced[channel, lane] or sample.resting[channel, lane]
        first, last = columns_of_lane(lane, columns, n_lanes)
        for c in range(first, last):
            # a voltage that is not read may change by any amount, unless the controller holds it
            if work.available[OF_VOLTAGE, c] == 0.0 and not is_held:
                work.added[c] += (UNREAD_WALK * maximum_voltage) ** 2
            noise = work.parameters[VOLTAGE + NOISE, c]
            healthy_noise = work.healthy[VOLTAGE + NOISE, c]
            work.added[c] += NOISY_WALK * (noise * noise - healthy_noise * healthy_noise)


@part
def stop_shafts(columns, sample, channel, work):
    """Let the shaft speed of motors at rest be zero."""
    n_lanes = sample.deflection.size
    for lane in range(n_lanes):
        if sample.resting[channel, lane]:
            first, last = columns_of_lane(lane, columns, n_lanes)
            for c in range(first, last):
                work.shaft_speed[c] = 0.0
                work.shaft_speed_slope[c] = 0.0
                work.shaft_speed_noise[c] = work.parameters[SPEED + NOISE, c]


@part
def keep_rpm_share(columns, work):
    """Fill the share of the measured shaft speed in the estimate: an outlier measures nothing."""
    first, last = columns
    for c in range(first, last):
        work.rpm_share[c] = work.available[OF_RPM, c] * work.weight[c]


@part
def restore_evidence(columns, sample, channel, fastest, work):
    """Forget the evidence of a reading that alone determines a voltage which is not read.

    Its density would prefer filters of a low gain, which spread the unknown voltage over fewer
    readings. That is the shaft speed's, and the current's where a shaft stands: where its speed was
    at most `fastest` [rad/s].
    """
    first, last = columns
    for c in range(first, last):
        if work.shaft_speed_before[c] > fastest:
            work.evidence_before[c] = work.evidence[c]
    is_silent = sample.silent[channel + OF_VOLTAGE]
    replace_evidence(columns, is_silent, work.evidence_before, work)


@part
def update(columns, sample, channel, walk, constants, work):
    """Take the filters of a motor, whose first reading is `channel`, through one sample."""
    first, last = columns
    tails = constants.tails
    water = constants.bank.water
    by_voltage = work.gradient[VOLTS], work.current_gradient[VOLTS]
    set_parameters(columns, FIRST_DEVIATION, work)
    broadcast(walk, columns, work.added)
    gather_readings(columns, sample, channel, work)
    for k in range(3):
        broadcast(sample.excess[channel + k], columns, work.excess[k])
    widen_voltage(columns, sample, channel, water.maximum_voltage, work)
    condition_on_voltage(columns, sample, channel, tails, work)
    imply_voltage(columns, sample, channel, water.maximum_voltage, work)
    set_parameters(columns, FIRST_DEVIATION, work)
    linearise(predict_readings, columns, FIRST_DEVIATION, by_voltage, water, work)
    work.gradient[ZERO, first:last] = 0.0
    work.current_gradient[ZERO, first:last] = 1.0
    compute_innovations(columns, constants, work)
    follow_jump(columns, work)
    shift_innovation(columns, 1.0, work)
    keep_evidence(columns, work)
    condition(columns, work.available[OF_RPM], tails, work)
    keep_standardised(columns, OF_RPM, work)
    keep_rpm_share(columns, work)
    restore_evidence(columns, sample, channel, math.inf, work)
    shift_innovation(columns, -1.0, work)
    current_channel = channel + OF_CURRENT
    keep_evidence(columns, work)
    begin_zero(columns, sample, current_channel, CURRENT, work.available[OF_CURRENT], work)
    take_current(columns, work)
    condition(columns, work.available[OF_CURRENT], tails, work)
    keep_standardised(columns, OF_CURRENT, work)
    end_zero(columns, sample, current_channel, work)
    restore_evidence(columns, sample, channel, STANDING * water.maximum_rpm / RPM, work)
    for c in range(first, last):
        work.voltage_std[c] = math.sqrt(work.filters[covariance_row(VOLTS, VOLTS, N_STATES), c])
    estimate_shaft_speed(columns, work.rpm_share, work.rpm_by_voltage, work.voltage_std, work)
    stop_shafts(columns, sample, channel, work)
