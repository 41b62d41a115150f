"""The motor filters of the bank: deviations of four parameters, severity, from current and rpm.

From the voltage reading, `physics.shaft_speed_after` predicts the rpm reading, and Ohm's law the
current. The voltage's noise enters both, so the measurements are first decorrelated.
"""

from auv_fault_env import physics
from auv_fault_env.compiling import fused, part, scalar
from auv_fault_env.parameters import SAMPLE_TIME
from auv_fault_env.physics import RPM
from diagnosers.bank.algebra import condition, severity_rows
from diagnosers.bank.pack import broadcast, columns_of_lane
from diagnosers.bank.sensors import (
    BIAS,
    GAIN,
    MIN_GAIN,
    N_SENSOR_ROWS,
    NOISE,
    condition_on_availability,
    reading_of,
    truth_of,
)

# rows of the parameters, in the order of `hypotheses.OWN_PARAMETERS`; of a sensor the first one
C1, C2, RESISTANCE, TORQUE_CONSTANT, COULOMB_FRICTION, VISCOUS_FRICTION, INERTIA = range(7)
VOLTAGE = 7
CURRENT = 12
SPEED = 17
N_MOTOR_ROWS = 22
# rows that `predict` uses
PREDICTION_ROWS = (
    *range(7),
    *(row + k for row in (VOLTAGE, CURRENT, SPEED) for k in (BIAS, GAIN)),
)
# rows that `estimate_shaft_speed` uses
SHAFT_SPEED_ROWS = (VOLTAGE + NOISE, SPEED + BIAS, SPEED + GAIN, SPEED + NOISE)
# parameters whose healthy deviation is a state
DEVIATIONS = (TORQUE_CONSTANT, RESISTANCE, COULOMB_FRICTION, C1)
# the three readings of a motor, in the order of `work.readings` and `work.available`
OF_VOLTAGE, OF_CURRENT, OF_RPM = range(3)
# rows of `work.predicted`: shaft speed [rad/s], readings of rpm and of current
SHAFT_SPEED, RPM_READING, CURRENT_READING = range(3)
# rows of `work.by_voltage`
FIRST, SECOND = range(2)  # rpm, then current
STEP = 1e-4  # of the forward differences
# rpm; below, the shaft may stand, and where it starts to turn no linear model holds
STANDING = 10.0
STANDING_STD = 15.0  # rpm, of the prediction there
UNKNOWN_STD = 1e4  # rpm, of the prediction before the first voltage reading


@scalar
def apply_severity(r, healthy, c, work):
    """Set parameter r from its healthy value and the severity, and its derivative."""
    severity, _ = severity_rows(work)
    by_severity = healthy * work.slope[r, c] + work.offset[r, c]
    work.by_severity[r, c] = by_severity
    work.parameters[r, c] = healthy + work.filters[severity, c] * by_severity


@part
def set_parameters(columns, first_deviation, work):
    """Set the parameters to the filters' means, and their derivatives by severity.

    Here and below, the states of `DEVIATIONS` begin with `first_deviation`.
    """
    first, last = columns
    x = work.filters
    for r in range(N_MOTOR_ROWS):
        for c in range(first, last):
            apply_severity(r, work.healthy[r, c], c, work)
    for k in range(len(DEVIATIONS)):
        row = DEVIATIONS[k]
        for c in range(first, last):
            relative = 1.0 + x[first_deviation + k, c]
            apply_severity(row, work.healthy[row, c] * relative, c, work)


@scalar
def shaft_of(parameters, c):
    """The shaft of a filter."""
    return physics.Shaft(
        0.0,
        parameters[C1, c],
        parameters[C2, c],
        parameters[RESISTANCE, c],
        parameters[TORQUE_CONSTANT, c],
        parameters[COULOMB_FRICTION, c],
        parameters[VISCOUS_FRICTION, c],
        parameters[INERTIA, c],
    )


@scalar
def predict_shaft_speed(shaft, c, voltage, water, work):
    """Shaft speed [rad/s] at a true voltage [V]."""
    side = physics.motor(shaft, water, voltage)
    before = work.shaft_speed_before[c]
    return physics.shaft_speed_after(before, side, work.surge_speed[c], 0.0, SAMPLE_TIME)


@scalar
def predict_readings(parameters, c, voltage_shift, water, work):
    """Shaft speed [rad/s], and the readings of rpm and current, at a shift of the true voltage.

    Current and shaft speed imply a missing voltage; the prediction replaces a missing shaft speed.
    """
    has_voltage = work.available[OF_VOLTAGE, c] > 0.0
    has_rpm = work.available[OF_RPM, c] > 0.0
    shaft = shaft_of(parameters, c)
    measured = max(truth_of(parameters, SPEED, c, work.readings[OF_RPM, c]), 0.0) / RPM
    measured_voltage = truth_of(parameters, VOLTAGE, c, work.readings[OF_VOLTAGE, c])
    measured_current = truth_of(parameters, CURRENT, c, work.readings[OF_CURRENT, c])
    by_speed = shaft.torque_constant * measured
    implied_voltage = fused(shaft.resistance, measured_current, by_speed)
    voltage = voltage_shift + (measured_voltage if has_voltage else implied_voltage)
    predicted = predict_shaft_speed(shaft, c, voltage, water, work)
    current = physics.armature_current(shaft, measured if has_rpm else predicted, voltage)
    rpm_reading = reading_of(parameters, SPEED, c, RPM * predicted)
    return predicted, rpm_reading, reading_of(parameters, CURRENT, c, current)


@scalar
def predict(model, parameters, columns, voltage_shift, water, work, out):
    """Fill out (3, n_columns) with what the model, such as `predict_readings`, predicts."""
    first, last = columns
    for c in range(first, last):
        prediction = model(parameters, c, voltage_shift, water, work)
        out[SHAFT_SPEED, c], out[RPM_READING, c], out[CURRENT_READING, c] = prediction


@part
def differences(columns, work, by_rpm, by_current):
    """Fill the forward differences (n_columns,) of the predicted readings of rpm and current."""
    first, last = columns
    perturbed = work.perturbed
    predicted = work.predicted
    for c in range(first, last):
        by_rpm[c] = (perturbed[RPM_READING, c] - predicted[RPM_READING, c]) / STEP
        by_current[c] = (perturbed[CURRENT_READING, c] - predicted[CURRENT_READING, c]) / STEP


@part
def perturb_severity(columns, work):
    """Fill the parameters that a prediction uses at `STEP` more of the severity."""
    first, last = columns
    for r in PREDICTION_ROWS:
        for c in range(first, last):
            step = STEP * work.by_severity[r, c]
            work.perturbed_parameters[r, c] = work.parameters[r, c] + step


@scalar
def linearise(model, columns, first_deviation, by_voltage, water, work):
    """Fill the predicted readings, and their gradients by deviations, severity and voltage.

    by_voltage: the rows for the last of these, of rpm and of current.
    """
    first, last = columns
    x = work.filters
    parameters = work.parameters
    unperturbed = work.unperturbed
    perturbed = work.perturbed
    severity, _ = severity_rows(work)
    predict(model, parameters, columns, 0.0, water, work, work.predicted)
    predict(model, parameters, columns, STEP, water, work, perturbed)
    differences(columns, work, by_voltage[FIRST], by_voltage[SECOND])
    for k in range(len(DEVIATIONS)):
        row = DEVIATIONS[k]
        state = first_deviation + k
        for c in range(first, last):
            unperturbed[c] = parameters[row, c]
            parameters[row, c] *= 1.0 + STEP / (1.0 + x[state, c])
        predict(model, parameters, columns, 0.0, water, work, perturbed)
        differences(columns, work, work.gradient[state], work.current_gradient[state])
        for c in range(first, last):
            parameters[row, c] = unperturbed[c]
    perturb_severity(columns, work)
    predict(model, work.perturbed_parameters, columns, 0.0, water, work, perturbed)
    differences(columns, work, work.gradient[severity], work.current_gradient[severity])


@part
def decorrelate(columns, work):
    """Fill innovations and variances; subtract from the current what the rpm reading explains."""
    first, last = columns
    parameters = work.parameters
    available = work.available
    readings = work.readings
    predicted = work.predicted
    for c in range(first, last):
        resistance = parameters[RESISTANCE, c]
        current_gain = max(parameters[CURRENT + GAIN, c], MIN_GAIN)
        implied_std = resistance * parameters[CURRENT + NOISE, c] / current_gain
        voltage_gain = max(parameters[VOLTAGE + GAIN, c], MIN_GAIN)
        measured_std = parameters[VOLTAGE + NOISE, c] / voltage_gain
        voltage_std = measured_std if available[OF_VOLTAGE, c] > 0.0 else implied_std
        rpm_std = parameters[SPEED + NOISE, c]
        gained = parameters[CURRENT + GAIN, c] * parameters[TORQUE_CONSTANT, c]
        current_by_rpm = gained / (resistance * RPM)
        rpm_error = rpm_std * available[OF_RPM, c]
        current_by_rpm *= rpm_error / max(parameters[SPEED + GAIN, c], MIN_GAIN)
        rpm_by_voltage = work.by_voltage[FIRST, c] * voltage_std
        current_by_voltage = work.by_voltage[SECOND, c] * voltage_std
        rpm_variance = rpm_std * rpm_std + rpm_by_voltage * rpm_by_voltage
        variance = rpm_variance + work.rpm_variance[c]
        work.variance[c] = variance
        shared = fused(rpm_by_voltage, current_by_voltage, current_by_rpm * rpm_std)
        ratio = available[OF_RPM, c] * shared / variance
        current_std = parameters[CURRENT + NOISE, c]
        own = fused(current_std, current_std, current_by_voltage**2)
        work.current_variance[c] = own + current_by_rpm**2 - ratio * shared
        innovation = readings[OF_RPM, c] - predicted[RPM_READING, c]
        work.innovation[c] = innovation
        misfit = readings[OF_CURRENT, c] - predicted[CURRENT_READING, c]
        work.current_innovation[c] = misfit - ratio * innovation
        work.ratio[c] = ratio
        available[OF_CURRENT, c] *= available[OF_VOLTAGE, c]
    for c in range(first, last):
        for i in range(len(work.states)):
            work.current_gradient[i, c] -= work.ratio[c] * work.gradient[i, c]


@part
def shift_innovation(columns, sign, work):
    """Add ``sign * gradient @ mean`` to the current's innovation: 1 before an update, -1 after."""
    first, last = columns
    x = work.filters
    for c in range(first, last):
        for i in range(len(work.states)):
            shift = sign * work.current_gradient[i, c] * x[i, c]
            work.current_innovation[c] += shift


@part
def estimate_shaft_speed(columns, measured_share, by_voltage, voltage_std, work):
    """Fill the shaft speed [rad/s] of every filter, its slope by severity and its noise [rpm].

    Of the measured shaft speed it has a share, else it is the predicted one, whose noise follows
    from the voltage's; (n_columns,) all.
    """
    first, last = columns
    parameters = work.parameters
    by_severity = work.by_severity
    for r in SHAFT_SPEED_ROWS:
        for c in range(first, last):
            apply_severity(r, work.healthy[r, c], c, work)
    for c in range(first, last):
        share = measured_share[c]
        gain = max(parameters[SPEED + GAIN, c], MIN_GAIN)
        measured = truth_of(parameters, SPEED, c, work.readings[OF_RPM, c]) / RPM
        predicted = work.predicted[SHAFT_SPEED, c]
        work.shaft_speed[c] = predicted + share * (measured - predicted)
        bias_slope = by_severity[SPEED + BIAS, c] / RPM
        slope = bias_slope + by_severity[SPEED + GAIN, c] * measured
        work.shaft_speed_slope[c] = -share * slope / gain
        predicted_std = abs(by_voltage[c]) * voltage_std[c]
        std = parameters[SPEED + NOISE, c] if share > 0.5 else predicted_std
        work.shaft_speed_noise[c] = std / gain


@part
def gather_readings(columns, sample, channel, work):
    """Fill readings and availability."""
    for k in range(3):
        broadcast(sample.reading[channel + k], columns, work.readings[k])
        condition_on_availability(
            work.parameters,
            columns,
            VOLTAGE + N_SENSOR_ROWS * k,
            sample,
            channel + k,
            work.available[k],
            work.evidence,
        )


@part
def replace_voltage(columns, sample, channel, work):
    """Take the last voltage reading for a silent one; fill the variance of rpm beside the noise."""
    n_lanes = sample.deflection.size
    for lane in range(n_lanes):
        replaced = sample.replaced[channel, lane]
        variance = 0.0
        if sample.silent[channel, lane] and not replaced:
            variance = UNKNOWN_STD**2
        elif sample.reading[channel + OF_RPM, lane] < STANDING:
            variance = STANDING_STD**2
        first, last = columns_of_lane(lane, columns, n_lanes)
        for c in range(first, last):
            work.rpm_variance[c] = variance
            # the last voltage may be stale: current and shaft speed imply a better one
            is_implied = work.available[OF_CURRENT, c] * work.available[OF_RPM, c] > 0.0
            if replaced and not is_implied:
                work.available[OF_VOLTAGE, c] = 1.0


@part
def take_current(columns, work):
    """Let the current be the measurement."""
    first, last = columns
    for c in range(first, last):
        work.innovation[c] = work.current_innovation[c]
        work.variance[c] = work.current_variance[c]
        for i in range(len(work.states)):
            work.gradient[i, c] = work.current_gradient[i, c]


@part
def update(columns, sample, channel, water, work):
    """Take the filters of a motor, whose first reading is `channel`, through one sample."""
    by_voltage = work.by_voltage
    set_parameters(columns, 0, work)
    gather_readings(columns, sample, channel, work)
    replace_voltage(columns, sample, channel, work)
    linearise(predict_readings, columns, 0, by_voltage, water, work)
    decorrelate(columns, work)
    rpm_available = work.available[OF_RPM]
    shift_innovation(columns, 1.0, work)
    condition(columns, rpm_available, work)
    shift_innovation(columns, -1.0, work)
    take_current(columns, work)
    condition(columns, work.available[OF_CURRENT], work)
    voltage_std = work.parameters[VOLTAGE + NOISE]
    estimate_shaft_speed(columns, rpm_available, by_voltage[FIRST], voltage_std, work)
