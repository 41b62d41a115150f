"""The motor filters of the bank: deviations of four parameters, severity, from current and rpm.

From the voltage reading, `physics.shaft_speed_after` predicts the rpm reading, and Ohm's law the
current. The voltage's noise enters both, so the measurements are first decorrelated.
"""

import numpy as np

from auv_fault_env import physics
from auv_fault_env.compiling import fused, inlined, scalar
from auv_fault_env.parameters import SAMPLE_TIME
from auv_fault_env.physics import RPM
from diagnosers.bank.algebra import N_STATES, SEVERITY, Measurement, condition
from diagnosers.bank.pack import broadcast
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
# rows of `work.innovation`, `work.variance` and `work.by_voltage`
FIRST, SECOND = range(2)  # rpm, then current
STEP = 1e-4  # of the forward differences
# rpm; below, the shaft may stand, and where it starts to turn no linear model holds
STANDING = 10.0
STANDING_STD = 15.0  # rpm, of the prediction there
UNKNOWN_STD = 1e4  # rpm, of the prediction before the first voltage reading


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
    for i in range(SEVERITY):
        row = DEVIATIONS[i]
        for c in range(first, last):
            relative = 1.0 + x[i, c]
            work.parameters[row, c] = work.healthy[row, c] * relative
    for r in range(N_MOTOR_ROWS):
        healthy = work.parameters[r] if r in DEVIATIONS else work.healthy[r]
        apply_severity(r, healthy, columns, work)


@scalar
def predict_readings(parameters, c, voltage_shift, water, work):
    """Shaft speed [rad/s], and the readings of rpm and current, at a shift of the true voltage.

    Current and shaft speed imply a missing voltage; the prediction replaces a missing shaft speed.
    """
    has_voltage = work.available[OF_VOLTAGE, c] > 0.0
    has_rpm = work.available[OF_RPM, c] > 0.0
    resistance = parameters[RESISTANCE, c]
    torque_constant = parameters[TORQUE_CONSTANT, c]
    coulomb_friction = parameters[COULOMB_FRICTION, c]
    viscous_friction = parameters[VISCOUS_FRICTION, c]
    shaft = physics.Shaft(
        0.0,
        parameters[C1, c],
        parameters[C2, c],
        resistance,
        torque_constant,
        coulomb_friction,
        viscous_friction,
        parameters[INERTIA, c],
    )
    measured = max(truth_of(parameters, SPEED, c, work.readings[OF_RPM, c]), 0.0) / RPM
    measured_voltage = truth_of(parameters, VOLTAGE, c, work.readings[OF_VOLTAGE, c])
    measured_current = truth_of(parameters, CURRENT, c, work.readings[OF_CURRENT, c])
    implied_voltage = fused(resistance, measured_current, torque_constant * measured)
    voltage = voltage_shift + (measured_voltage if has_voltage else implied_voltage)
    before = work.shaft_speed_before[c]
    side = physics.motor(shaft, water, voltage)
    predicted = physics.shaft_speed_after(before, side, work.surge_speed[c], 0.0, SAMPLE_TIME)
    current = physics.armature_current(shaft, measured if has_rpm else predicted, voltage)
    rpm_reading = reading_of(parameters, SPEED, c, RPM * predicted)
    return predicted, rpm_reading, reading_of(parameters, CURRENT, c, current)


@inlined
def predict(parameters, columns, voltage_shift, water, work, out):
    """`predict_readings` of every filter into out (3, n_columns)."""
    first, last = columns
    for c in range(first, last):
        prediction = predict_readings(parameters, c, voltage_shift, water, work)
        out[SHAFT_SPEED, c], out[RPM_READING, c], out[CURRENT_READING, c] = prediction


@inlined
def differences(columns, work, by_rpm, by_current):
    """Fill the forward differences (n_columns,) of the predicted readings of rpm and current."""
    first, last = columns
    perturbed = work.perturbed
    predicted = work.predicted
    for c in range(first, last):
        by_rpm[c] = (perturbed[RPM_READING, c] - predicted[RPM_READING, c]) / STEP
        by_current[c] = (perturbed[CURRENT_READING, c] - predicted[CURRENT_READING, c]) / STEP


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
    """Fill the predicted readings, and their gradients by the states and by the voltage."""
    first, last = columns
    x = work.filters
    parameters = work.parameters
    unperturbed = work.unperturbed
    perturbed = work.perturbed
    predict(parameters, columns, 0.0, water, work, work.predicted)
    predict(parameters, columns, STEP, water, work, perturbed)
    differences(columns, work, work.by_voltage[FIRST], work.by_voltage[SECOND])
    for i in range(SEVERITY):
        row = DEVIATIONS[i]
        for c in range(first, last):
            unperturbed[c] = parameters[row, c]
            parameters[row, c] *= 1.0 + STEP / (1.0 + x[i, c])
        predict(parameters, columns, 0.0, water, work, perturbed)
        differences(columns, work, work.gradient[i], work.current_gradient[i])
        for c in range(first, last):
            parameters[row, c] = unperturbed[c]
    perturb_severity(columns, work)
    predict(work.perturbed_parameters, columns, 0.0, water, work, perturbed)
    differences(columns, work, work.gradient[SEVERITY], work.current_gradient[SEVERITY])


@inlined
def decorrelate(columns, work):
    """Fill innovations and variances; subtract from the current what the rpm reading explains."""
    first, last = columns
    parameters = work.parameters
    available = work.available
    innovation = work.innovation
    variance = work.variance
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
        variance[FIRST, c] = rpm_variance + work.rpm_variance[c]
        shared = fused(rpm_by_voltage, current_by_voltage, current_by_rpm * rpm_std)
        ratio = available[OF_RPM, c] * shared / variance[FIRST, c]
        current_std = parameters[CURRENT + NOISE, c]
        own = fused(current_std, current_std, current_by_voltage**2)
        variance[SECOND, c] = own + current_by_rpm**2 - ratio * shared
        innovation[FIRST, c] = readings[OF_RPM, c] - predicted[RPM_READING, c]
        misfit = readings[OF_CURRENT, c] - predicted[CURRENT_READING, c]
        innovation[SECOND, c] = misfit - ratio * innovation[FIRST, c]
        work.ratio[c] = ratio
        available[OF_CURRENT, c] *= available[OF_VOLTAGE, c]
    for i in range(N_STATES):
        for c in range(first, last):
            work.current_gradient[i, c] -= work.ratio[c] * work.gradient[i, c]


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
def estimate_shaft_speed(columns, work):
    """Fill the shaft speed [rad/s] of every filter, its slope by severity and its noise [rpm]."""
    first, last = columns
    parameters = work.parameters
    by_severity = work.by_severity
    for r in SHAFT_SPEED_ROWS:
        apply_severity(r, work.healthy[r], columns, work)
    for c in range(first, last):
        available = work.available[OF_RPM, c]
        gain = max(parameters[SPEED + GAIN, c], MIN_GAIN)
        measured = truth_of(parameters, SPEED, c, work.readings[OF_RPM, c]) / RPM
        work.shaft_speed[c] = measured if available > 0.0 else work.predicted[SHAFT_SPEED, c]
        bias_slope = by_severity[SPEED + BIAS, c] / RPM
        slope = bias_slope + by_severity[SPEED + GAIN, c] * measured
        work.shaft_speed_slope[c] = -available * slope / gain
        predicted_std = abs(work.by_voltage[FIRST, c]) * parameters[VOLTAGE + NOISE, c]
        std = parameters[SPEED + NOISE, c] if available > 0.0 else predicted_std
        work.shaft_speed_noise[c] = std / gain


@inlined
def gather_readings(columns, sample, channel, work):
    """Fill readings, availability and the variance that the predicted rpm has beside the noise."""
    first, last = columns
    n_lanes = np.uint64(sample.deflection.size)
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
    for lane in range(n_lanes):
        replaced = sample.replaced[channel, lane]
        variance = 0.0
        if sample.silent[channel, lane] and not replaced:
            variance = UNKNOWN_STD**2
        elif sample.reading[channel + OF_RPM, lane] < STANDING:
            variance = STANDING_STD**2
        for c in range(first + lane, last, n_lanes):
            work.rpm_variance[c] = variance
            # the last voltage may be stale: current and shaft speed imply a better one
            is_implied = work.available[OF_CURRENT, c] * work.available[OF_RPM, c] > 0.0
            if replaced and not is_implied:
                work.available[OF_VOLTAGE, c] = 1.0


@inlined
def update(columns, sample, channel, water, work):
    """Take the filters of a motor, whose first reading is `channel`, through one sample."""
    set_parameters(columns, work)
    gather_readings(columns, sample, channel, work)
    linearise(columns, water, work)
    decorrelate(columns, work)
    innovation = work.innovation
    variance = work.variance
    available = work.available
    gradient = work.current_gradient
    rpm = Measurement(work.gradient, innovation[FIRST], variance[FIRST], available[OF_RPM])
    current = Measurement(gradient, innovation[SECOND], variance[SECOND], available[OF_CURRENT])
    shift_innovation(columns, 1.0, work)
    condition(columns, rpm, work)
    shift_innovation(columns, -1.0, work)
    condition(columns, current, work)
    estimate_shaft_speed(columns, work)
