"""The motor filters of the reference: shaft speed, healthy deviations, start voltage, severity.

As `diagnosers.bank.motor`, with the voltage that the controller commands instead of its reading,
so that the shaft speed is a state and the noises of the three readings are independent.
"""

import math
from collections import namedtuple

from auv_fault_env import physics
from auv_fault_env.compiling import kernel, part, scalar
from auv_fault_env.light import light
from auv_fault_env.parameters import SAMPLE_TIME
from auv_fault_env.physics import RPM
from diagnosers.bank.algebra import (
    condition,
    covariance_row,
    moments_of,
    severity_rows,
)
from diagnosers.bank.motor import (
    C1,
    C2,
    COULOMB_FRICTION,
    CURRENT,
    N_MOTOR_ROWS,
    OF_CURRENT,
    OF_RPM,
    OF_VOLTAGE,
    PREDICTION_ROWS,
    RESISTANCE,
    SPEED,
    STANDING,
    STEP,
    TORQUE_CONSTANT,
    VOLTAGE,
    apply_severity,
    gather_readings,
    shaft_of,
)
from diagnosers.bank.sensors import BIAS, GAIN, NOISE
from diagnosers.bank.surge import predict_covariance

# parameters whose healthy deviation is a state, from `FIRST_DEVIATION` on
DEVIATIONS = (TORQUE_CONSTANT, RESISTANCE, COULOMB_FRICTION, C1, C2)
W = 0  # shaft speed [rad/s] at the sample's end
FIRST_DEVIATION = 1
OF_TORQUE_CONSTANT = FIRST_DEVIATION + DEVIATIONS.index(TORQUE_CONSTANT)
OF_RESISTANCE = FIRST_DEVIATION + DEVIATIONS.index(RESISTANCE)
OF_FRICTION = FIRST_DEVIATION + DEVIATIONS.index(COULOMB_FRICTION)
START_VOLTAGE = FIRST_DEVIATION + len(DEVIATIONS)  # V, minus its reading
N_STATES = START_VOLTAGE + 2  # with the severity
N_MOMENTS = moments_of(N_STATES)
# rad/s, of the shaft speed per sample, by the error of the surge speed that its prediction takes
PROCESS_STD = 0.15 / RPM
START_STDS = 3.0  # of the friction's, within which of it a torque may turn a standing shaft
N_ROWS = {
    "filters": N_MOMENTS,
    "healthy": N_MOTOR_ROWS,
    "parameters": N_MOTOR_ROWS,
    "by_severity": N_MOTOR_ROWS,
    "perturbed_parameters": N_MOTOR_ROWS,
    "gradient": N_STATES,
    "covariance": N_STATES,
    "readings": 3,
    "available": 3,
    "severity": 2,
    "predicted": 1,
}
# of a `Memory`, what is no table of rows, see `diagnosers.bank.pack.Parts`
Parts = light(namedtuple("Parts", ("states",)))


@part
def set_parameters(columns, work):
    """Set the parameters to the filters' means, and their derivatives by severity."""
    first, last = columns
    x = work.filters
    for r in range(N_MOTOR_ROWS):
        for c in range(first, last):
            apply_severity(r, work.healthy[r, c], c, work)
    for k in range(len(DEVIATIONS)):
        row = DEVIATIONS[k]
        for c in range(first, last):
            relative = 1.0 + x[FIRST_DEVIATION + k, c]
            apply_severity(row, work.healthy[row, c] * relative, c, work)


@scalar
def voltage_of(c, voltage, by_start, work):
    """The true voltage [V] by the filter's start voltage."""
    return voltage + by_start * work.filters[START_VOLTAGE, c]


@part
def predict(parameters, columns, start_shift, voltage, by_start, water, work, out):
    """Fill the shaft speed [rad/s] after a sample (n_columns,), from a shifted one before it."""
    first, last = columns
    for c in range(first, last):
        side = physics.motor(shaft_of(parameters, c), water, voltage_of(c, voltage, by_start, work))
        start = max(work.filters[W, c], 0.0) + start_shift
        out[c] = physics.shaft_speed_after(start, side, work.surge_speed[c], 0.0, SAMPLE_TIME)


@part
def difference(columns, step, work, out):
    """Fill the forward difference (n_columns,) of the predicted shaft speed."""
    first, last = columns
    for c in range(first, last):
        out[c] = (work.shaft_speed[c] - work.predicted[0, c]) / step


@scalar
def start_std(c, voltage, shaft_speed, work):
    """Std of a predicted shaft speed [rad/s] that may be zero, as friction is not known, or zero.

    There the prediction has no useful gradient.
    """
    x = work.filters
    _, severity_variance = severity_rows(work)
    n_states = len(work.states)
    friction = work.parameters[COULOMB_FRICTION, c]
    flux = work.parameters[TORQUE_CONSTANT, c]
    resistance = work.parameters[RESISTANCE, c]
    deviation_variance = x[covariance_row(OF_FRICTION, OF_FRICTION, n_states), c]
    by_deviation = friction / (1.0 + x[OF_FRICTION, c])
    by_severity = work.by_severity[COULOMB_FRICTION, c]
    variance = by_deviation * by_deviation * deviation_variance
    variance += by_severity * by_severity * x[severity_variance, c]
    std = math.sqrt(max(variance, 0.0))
    is_near = abs(flux * voltage / resistance - friction) < START_STDS * std
    return std * resistance / (flux * flux) if is_near and shaft_speed * RPM < STANDING else 0.0


@part
def advance(columns, voltage, by_start, water, work):
    """Take means and covariances over a sample, in which only the shaft speed changes."""
    first, last = columns
    x = work.filters
    parameters = work.parameters
    gradient = work.gradient
    now = work.predicted[0]
    shifted = work.shaft_speed
    severity, _ = severity_rows(work)
    predict(parameters, columns, 0.0, voltage, by_start, water, work, now)
    predict(parameters, columns, STEP, voltage, by_start, water, work, shifted)
    difference(columns, STEP, work, gradient[W])
    predict(parameters, columns, 0.0, voltage + STEP, by_start, water, work, shifted)
    difference(columns, STEP, work, gradient[START_VOLTAGE])
    for k in range(len(DEVIATIONS)):
        row = DEVIATIONS[k]
        state = FIRST_DEVIATION + k
        for c in range(first, last):
            work.unperturbed[c] = parameters[row, c]
            parameters[row, c] *= 1.0 + STEP / (1.0 + x[state, c])
        predict(parameters, columns, 0.0, voltage, by_start, water, work, shifted)
        difference(columns, STEP, work, gradient[state])
        for c in range(first, last):
            parameters[row, c] = work.unperturbed[c]
    for r in PREDICTION_ROWS:
        for c in range(first, last):
            step = STEP * work.by_severity[r, c]
            work.perturbed_parameters[r, c] = parameters[r, c] + step
    perturbed = work.perturbed_parameters
    predict(perturbed, columns, 0.0, voltage, by_start, water, work, shifted)
    difference(columns, STEP, work, gradient[severity])
    for c in range(first, last):
        gradient[START_VOLTAGE, c] *= by_start
        std = start_std(c, voltage_of(c, voltage, by_start, work), now[c], work)
        work.variance[c] = PROCESS_STD * PROCESS_STD + std * std
    predict_covariance(columns, work)
    for c in range(first, last):
        x[W, c] = now[c]


@part
def clear_gradient(columns, work):
    """Set the gradients of a measurement to zero."""
    first, last = columns
    for i in range(len(work.states)):
        for c in range(first, last):
            work.gradient[i, c] = 0.0


@part
def expect_rpm(columns, work):
    """Fill innovation, variance and gradient of the rpm reading."""
    first, last = columns
    x = work.filters
    severity, _ = severity_rows(work)
    clear_gradient(columns, work)
    for c in range(first, last):
        gain = work.parameters[SPEED + GAIN, c]
        rpm = RPM * x[W, c]
        by_gain = work.by_severity[SPEED + GAIN, c] * rpm
        work.gradient[W, c] = gain * RPM
        work.gradient[severity, c] = by_gain + work.by_severity[SPEED + BIAS, c]
        unbiased = work.readings[OF_RPM, c] - gain * rpm
        work.innovation[c] = unbiased - work.parameters[SPEED + BIAS, c]
        work.variance[c] = work.parameters[SPEED + NOISE, c] ** 2


@part
def expect_current(columns, voltage, by_start, work):
    """Fill innovation, variance and gradient of the current's reading."""
    first, last = columns
    x = work.filters
    parameters = work.parameters
    by_severity = work.by_severity
    severity, _ = severity_rows(work)
    clear_gradient(columns, work)
    for c in range(first, last):
        shaft = shaft_of(parameters, c)
        true_voltage = voltage_of(c, voltage, by_start, work)
        w = x[W, c]
        current = physics.armature_current(shaft, w, true_voltage)
        gain = parameters[CURRENT + GAIN, c]
        per_volt = gain / shaft.resistance
        by_flux = -per_volt * w
        by_resistance = -per_volt * current
        flux_slope = shaft.torque_constant / (1.0 + x[OF_TORQUE_CONSTANT, c])
        resistance_slope = shaft.resistance / (1.0 + x[OF_RESISTANCE, c])
        slope = by_flux * by_severity[TORQUE_CONSTANT, c]
        slope += by_resistance * by_severity[RESISTANCE, c]
        slope += by_severity[CURRENT + GAIN, c] * current + by_severity[CURRENT + BIAS, c]
        work.gradient[W, c] = -per_volt * shaft.torque_constant
        work.gradient[OF_TORQUE_CONSTANT, c] = by_flux * flux_slope
        work.gradient[OF_RESISTANCE, c] = by_resistance * resistance_slope
        work.gradient[START_VOLTAGE, c] = per_volt * by_start
        work.gradient[severity, c] = slope
        unbiased = work.readings[OF_CURRENT, c] - gain * current
        work.innovation[c] = unbiased - parameters[CURRENT + BIAS, c]
        work.variance[c] = parameters[CURRENT + NOISE, c] ** 2


@part
def expect_voltage(columns, voltage, by_start, work):
    """Fill innovation, variance and gradient of the voltage's reading."""
    first, last = columns
    severity, _ = severity_rows(work)
    clear_gradient(columns, work)
    for c in range(first, last):
        gain = work.parameters[VOLTAGE + GAIN, c]
        true_voltage = voltage_of(c, voltage, by_start, work)
        by_gain = work.by_severity[VOLTAGE + GAIN, c] * true_voltage
        work.gradient[START_VOLTAGE, c] = gain * by_start
        work.gradient[severity, c] = by_gain + work.by_severity[VOLTAGE + BIAS, c]
        unbiased = work.readings[OF_VOLTAGE, c] - gain * true_voltage
        work.innovation[c] = unbiased - work.parameters[VOLTAGE + BIAS, c]
        work.variance[c] = work.parameters[VOLTAGE + NOISE, c] ** 2


@kernel
def step_motor(first, last, voltage, by_start, sample, channel, water, work):
    """Take the filters of a motor, columns `first` to before `last`, through one sample.

    The motor's first reading is `channel`; the voltage [V] and its derivative as in `Voltages`.
    Fills their evidence.
    """
    columns = first, last
    set_parameters(columns, work)
    gather_readings(columns, sample, channel, work)
    advance(columns, voltage, by_start, water, work)
    expect_rpm(columns, work)
    condition(columns, work.available[OF_RPM], work)
    set_parameters(columns, work)
    expect_current(columns, voltage, by_start, work)
    condition(columns, work.available[OF_CURRENT], work)
    set_parameters(columns, work)
    expect_voltage(columns, voltage, by_start, work)
    condition(columns, work.available[OF_VOLTAGE], work)
