"""The motor filters of the bank: voltage, four deviations, offset of the current, severity.

The voltage walks at random; its reading is a measurement. From it `physics.shaft_speed_after`
predicts the shaft speed, whose reading is the second measurement, and Ohm's law the current, the
third.
"""

import math

import numpy as np

from auv_fault_env import physics
from auv_fault_env.compiling import inlined, scalar
from auv_fault_env.parameters import SAMPLE_TIME
from auv_fault_env.physics import RPM
from diagnosers.bank.algebra import Measurement
from diagnosers.bank.motor import (
    C1,
    C2,
    COULOMB_FRICTION,
    CURRENT,
    CURRENT_READING,
    DEVIATIONS,
    FIRST,
    INERTIA,
    N_MOTOR_ROWS,
    OF_CURRENT,
    OF_RPM,
    OF_VOLTAGE,
    RESISTANCE,
    RPM_READING,
    SECOND,
    SHAFT_SPEED,
    SPEED,
    STEP,
    TORQUE_CONSTANT,
    VISCOUS_FRICTION,
    VOLTAGE,
    differences,
)
from diagnosers.bank.pack import broadcast
from diagnosers.bank.sensors import (
    BIAS,
    GAIN,
    MIN_GAIN,
    N_SENSOR_ROWS,
    NOISE,
    reading_of,
    truth_of,
)
from diagnosers.robust.algebra import N_STATES, SEVERITY, condition, covariance_row
from diagnosers.robust.sensors import begin_zero, condition_on_availability, end_zero

# rows that `predict` uses
PREDICTION_ROWS = (*range(7), *(row + k for row in (CURRENT, SPEED) for k in (BIAS, GAIN)))
# rows that `estimate_shaft_speed` uses
SHAFT_SPEED_ROWS = (SPEED + BIAS, SPEED + GAIN, SPEED + NOISE)
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


@inlined
def apply_severity(r, healthy, columns, work):
    """Set parameter r from its healthy value (n_columns,) and the severity, and its derivative."""
    first, last = columns
    x = work.filters
    for c in range(first, last):
        by_severity = healthy[c] * work.slope[r, c] + work.offset[r, c]
        work.by_severity[r, c] = by_severity
        work.parameters[r, c] = healthy[c] + x[SEVERITY, c] * by_severity


@inlined
def set_parameters(columns, work):
    """Set the parameters to the filters' means, and their derivatives by severity."""
    first, last = columns
    x = work.filters
    for k in range(len(DEVIATIONS)):
        row = DEVIATIONS[k]
        for c in range(first, last):
            relative = 1.0 + x[FIRST_DEVIATION + k, c]
            work.parameters[row, c] = work.healthy[row, c] * relative
    for r in range(N_MOTOR_ROWS):
        healthy = work.parameters[r] if r in DEVIATIONS else work.healthy[r]
        apply_severity(r, healthy, columns, work)


@inlined
def condition_on_voltage(columns, sample, channel, tails, work):
    """Let the voltage walk and perhaps jump over the sample, and condition on its reading."""
    first, last = columns
    x = work.filters
    parameters = work.parameters
    by_severity = work.by_severity
    gradient = work.gradient
    variance_row = covariance_row(VOLTS, VOLTS)
    gradient[:, first:last] = 0.0
    for c in range(first, last):
        x[variance_row, c] += work.added[c]
        gain = max(parameters[VOLTAGE + GAIN, c], MIN_GAIN)
        expected = reading_of(parameters, VOLTAGE, c, x[VOLTS, c])
        work.expected[c] = expected
        innovation = work.readings[OF_VOLTAGE, c] - expected
        noise = parameters[VOLTAGE + NOISE, c] ** 2 + work.rounding[OF_VOLTAGE, c]
        expected_square = noise + gain * gain * x[variance_row, c]
        jump = max(0.0, innovation * innovation - JUMP * expected_square)
        x[variance_row, c] += work.available[OF_VOLTAGE, c] * jump / (gain * gain)
        work.expected_std[c] = math.sqrt(noise + gain * gain * x[variance_row, c])
        gradient[VOLTS, c] = gain
        of_gain = by_severity[VOLTAGE + GAIN, c] * x[VOLTS, c]
        gradient[SEVERITY, c] = of_gain + by_severity[VOLTAGE + BIAS, c]
        work.innovation[FIRST, c] = innovation
        work.variance[FIRST, c] = noise
    begin_zero(columns, sample, channel, VOLTAGE, work.available[OF_VOLTAGE], work)
    measurement = Measurement(
        gradient, work.innovation[FIRST], work.variance[FIRST], work.available[OF_VOLTAGE]
    )
    condition(columns, measurement, tails, work)
    end_zero(columns, sample, channel, work)


@inlined
def imply_voltage(columns, sample, channel, maximum_voltage, work):
    """Set a voltage that does not arrive to what current and shaft speed imply, about.

    It may have jumped by any amount. Both readings then condition it like others.
    """
    first, last = columns
    n_lanes = np.uint64(sample.deflection.size)
    x = work.filters
    parameters = work.parameters
    for lane in range(n_lanes):
        is_read = not sample.silent[channel + OF_VOLTAGE, lane]
        if is_read or sample.resting[channel, lane]:
            continue
        for c in range(first + lane, last, n_lanes):
            if work.available[OF_CURRENT, c] * work.available[OF_RPM, c] > 0.0:
                current = truth_of(parameters, CURRENT, c, work.readings[OF_CURRENT, c])
                shaft_speed = truth_of(parameters, SPEED, c, work.readings[OF_RPM, c]) / RPM
                by_current = parameters[RESISTANCE, c] * (current - x[ZERO, c])
                x[VOLTS, c] = by_current + parameters[TORQUE_CONSTANT, c] * shaft_speed
                for i in range(N_STATES):
                    x[covariance_row(VOLTS, i), c] = 0.0
                x[covariance_row(VOLTS, VOLTS), c] = (UNREAD_WALK * maximum_voltage) ** 2


@scalar
def predict_readings(parameters, c, voltage, water, work):
    """Shaft speed [rad/s], and the readings of rpm and current, at a true voltage [V]."""
    shaft = physics.Shaft(
        0.0,
        parameters[C1, c],
        parameters[C2, c],
        parameters[RESISTANCE, c],
        parameters[TORQUE_CONSTANT, c],
        parameters[COULOMB_FRICTION, c],
        parameters[VISCOUS_FRICTION, c],
        parameters[INERTIA, c],
    )
    before = work.shaft_speed_before[c]
    side = physics.motor(shaft, water, voltage)
    predicted = physics.shaft_speed_after(before, side, work.surge_speed[c], 0.0, SAMPLE_TIME)
    current = physics.armature_current(shaft, predicted, voltage)
    rpm_reading = reading_of(parameters, SPEED, c, RPM * predicted)
    return predicted, rpm_reading, reading_of(parameters, CURRENT, c, current)


@inlined
def predict(parameters, columns, voltage_shift, water, work, out):
    """`predict_readings` of every filter into out (3, n_columns), at a shift of the voltage."""
    first, last = columns
    x = work.filters
    for c in range(first, last):
        voltage = x[VOLTS, c] + voltage_shift
        prediction = predict_readings(parameters, c, voltage, water, work)
        out[SHAFT_SPEED, c], out[RPM_READING, c], out[CURRENT_READING, c] = prediction


@inlined
def perturb_severity(columns, work):
    """Fill the parameters that a prediction uses at `STEP` more of the severity."""
    first, last = columns
    for r in PREDICTION_ROWS:
        for c in range(first, last):
            step = STEP * work.by_severity[r, c]
            work.perturbed_parameters[r, c] = work.parameters[r, c] + step


@inlined
def linearise(columns, water, work):
    """Fill the predicted readings of rpm and current, and their gradients by the states."""
    first, last = columns
    x = work.filters
    parameters = work.parameters
    unperturbed = work.unperturbed
    perturbed = work.perturbed
    predict(parameters, columns, 0.0, water, work, work.predicted)
    predict(parameters, columns, STEP, water, work, perturbed)
    differences(columns, work, work.gradient[VOLTS], work.current_gradient[VOLTS])
    for k in range(len(DEVIATIONS)):
        row = DEVIATIONS[k]
        state = FIRST_DEVIATION + k
        for c in range(first, last):
            unperturbed[c] = parameters[row, c]
            parameters[row, c] *= 1.0 + STEP / (1.0 + x[state, c])
        predict(parameters, columns, 0.0, water, work, perturbed)
        differences(columns, work, work.gradient[state], work.current_gradient[state])
        for c in range(first, last):
            parameters[row, c] = unperturbed[c]
    for c in range(first, last):
        work.gradient[ZERO, c] = 0.0
        work.current_gradient[ZERO, c] = 1.0
    perturb_severity(columns, work)
    predict(work.perturbed_parameters, columns, 0.0, water, work, perturbed)
    differences(columns, work, work.gradient[SEVERITY], work.current_gradient[SEVERITY])


@inlined
def compute_innovations(columns, constants, work):
    """Fill innovations and variances of rpm and current.

    The rpm reading may lag by about ``constants.lateness`` samples, and the shaft with it. Where a
    shaft may stand, no prediction is exact.
    """
    highest = STANDING * constants.water.maximum_rpm / RPM
    first, last = columns
    x = work.filters
    parameters = work.parameters
    innovation = work.innovation
    variance = work.variance
    readings = work.readings
    rounding = work.rounding
    predicted = work.predicted
    for c in range(first, last):
        before = work.shaft_speed_before[c]
        after = predicted[SHAFT_SPEED, c]
        lag = constants.lateness * (after - before)
        standing = max(1.0 - max(before, after) / highest, 0.0)
        current_by_lag = lag * parameters[TORQUE_CONSTANT, c] / parameters[RESISTANCE, c]
        rpm_variance = parameters[SPEED + NOISE, c] ** 2 + rounding[OF_RPM, c]
        rpm_variance += (standing * STANDING_STD) ** 2
        variance[FIRST, c] = rpm_variance + (RPM * lag) ** 2
        current_variance = parameters[CURRENT + NOISE, c] ** 2 + rounding[OF_CURRENT, c]
        current_variance += (standing * STANDING_CURRENT_STD) ** 2
        variance[SECOND, c] = current_variance + current_by_lag**2
        innovation[FIRST, c] = readings[OF_RPM, c] - predicted[RPM_READING, c]
        misfit = readings[OF_CURRENT, c] - predicted[CURRENT_READING, c]
        innovation[SECOND, c] = misfit - x[ZERO, c]
        work.expected[c] = readings[OF_CURRENT, c] - innovation[SECOND, c]
        work.expected_std[c] = 2.0 * math.sqrt(variance[SECOND, c])


@inlined
def shift_innovation(columns, sign, work):
    """Add ``sign * gradient @ mean`` to the current's innovation: 1 before an update, -1 after."""
    first, last = columns
    x = work.filters
    for i in range(N_STATES):
        for c in range(first, last):
            shift = sign * work.current_gradient[i, c] * x[i, c]
            work.innovation[SECOND, c] += shift


@inlined
def estimate_shaft_speed(columns, sample, channel, work):
    """Fill the shaft speed [rad/s] of every filter, its slope by severity and its noise [rpm].

    That of a motor at rest is zero.
    """
    first, last = columns
    x = work.filters
    parameters = work.parameters
    by_severity = work.by_severity
    variance_row = covariance_row(VOLTS, VOLTS)
    for r in SHAFT_SPEED_ROWS:
        apply_severity(r, work.healthy[r], columns, work)
    for c in range(first, last):
        # an outlier is no measurement of the shaft speed
        measured_share = work.available[OF_RPM, c] * work.rpm_weight[c]
        gain = max(parameters[SPEED + GAIN, c], MIN_GAIN)
        measured = truth_of(parameters, SPEED, c, work.readings[OF_RPM, c]) / RPM
        predicted = work.predicted[SHAFT_SPEED, c]
        work.shaft_speed[c] = predicted + measured_share * (measured - predicted)
        bias_slope = by_severity[SPEED + BIAS, c] / RPM
        slope = bias_slope + by_severity[SPEED + GAIN, c] * measured
        work.shaft_speed_slope[c] = -measured_share * slope / gain
        predicted_std = abs(work.gradient[VOLTS, c]) * math.sqrt(x[variance_row, c])
        std = parameters[SPEED + NOISE, c] if measured_share > 0.5 else predicted_std
        work.shaft_speed_noise[c] = std / gain
    n_lanes = np.uint64(sample.deflection.size)
    for lane in range(n_lanes):
        if sample.resting[channel, lane]:
            for c in range(first + lane, last, n_lanes):
                work.shaft_speed[c] = 0.0
                work.shaft_speed_slope[c] = 0.0
                work.shaft_speed_noise[c] = parameters[SPEED + NOISE, c]


@inlined
def gather_readings(columns, sample, channel, maximum_voltage, work):
    """Fill readings and availability, and add to the walk of voltages that are not read."""
    first, last = columns
    n_lanes = np.uint64(sample.deflection.size)
    for k in range(3):
        broadcast(sample.reading[channel + k], columns, work.readings[k])
        broadcast(sample.rounding[channel + k], columns, work.rounding[k])
        condition_on_availability(
            work.parameters,
            columns,
            VOLTAGE + N_SENSOR_ROWS * k,
            sample,
            channel + k,
            work.available[k],
            work.evidence,
        )
    for lane in range(n_lanes):
        is_held = sample.replaced[channel, lane] or sample.resting[channel, lane]
        for c in range(first + lane, last, n_lanes):
            # a voltage that is not read may change by any amount, unless the controller holds it
            if work.available[OF_VOLTAGE, c] == 0.0 and not is_held:
                work.added[c] += (UNREAD_WALK * maximum_voltage) ** 2
            noise = work.parameters[VOLTAGE + NOISE, c]
            healthy_noise = work.healthy[VOLTAGE + NOISE, c]
            work.added[c] += NOISY_WALK * (noise * noise - healthy_noise * healthy_noise)


@inlined
def keep_weight(columns, work):
    """Keep the weight of the rpm reading."""
    first, last = columns
    for c in range(first, last):
        work.rpm_weight[c] = work.weight[c]


@inlined
def keep_evidence(columns, work):
    """Keep the evidence from before a reading."""
    first, last = columns
    for c in range(first, last):
        work.added[c] = work.evidence[c]


@inlined
def restore_evidence(columns, sample, channel, fastest, work):
    """Forget the evidence of a reading that alone determines a voltage which is not read.

    Its density would prefer filters of a low gain, which spread the unknown voltage over fewer
    readings. That is the shaft speed's, and the current's where a shaft stands: where its speed was
    at most `fastest` [rad/s].
    """
    first, last = columns
    n_lanes = np.uint64(sample.deflection.size)
    for lane in range(n_lanes):
        if sample.silent[channel + OF_VOLTAGE, lane]:
            for c in range(first + lane, last, n_lanes):
                if work.shaft_speed_before[c] <= fastest:
                    work.evidence[c] = work.added[c]


@inlined
def update(columns, sample, channel, walk, constants, work):
    """Take the filters of a motor, whose first reading is `channel`, through one sample."""
    tails = constants.tails
    set_parameters(columns, work)
    broadcast(walk, columns, work.added)
    gather_readings(columns, sample, channel, constants.water.maximum_voltage, work)
    condition_on_voltage(columns, sample, channel, tails, work)
    imply_voltage(columns, sample, channel, constants.water.maximum_voltage, work)
    set_parameters(columns, work)
    linearise(columns, constants.water, work)
    compute_innovations(columns, constants, work)
    innovation = work.innovation
    variance = work.variance
    available = work.available
    gradient = work.current_gradient
    rpm = Measurement(work.gradient, innovation[FIRST], variance[FIRST], available[OF_RPM])
    current = Measurement(gradient, innovation[SECOND], variance[SECOND], available[OF_CURRENT])
    shift_innovation(columns, 1.0, work)
    keep_evidence(columns, work)
    condition(columns, rpm, tails, work)
    keep_weight(columns, work)
    restore_evidence(columns, sample, channel, math.inf, work)
    shift_innovation(columns, -1.0, work)
    current_channel = channel + OF_CURRENT
    keep_evidence(columns, work)
    begin_zero(columns, sample, current_channel, CURRENT, available[OF_CURRENT], work)
    condition(columns, current, tails, work)
    end_zero(columns, sample, current_channel, work)
    standing = STANDING * constants.water.maximum_rpm / RPM
    restore_evidence(columns, sample, channel, standing, work)
    estimate_shaft_speed(columns, sample, channel, work)
