"""Predictions of a log by the plant's physics, sample by sample, and their residuals.

Compiled loops around the scalar functions of `auv_fault_env.physics`. Both residuals have unit
variance where model and noise are right, so that a least-squares fit weights them correctly: the
speed's by a Kalman filter with the disturbance as a state, the shaft's by removing from the current
its correlation with voltage and rpm.
"""

import math

from auv_fault_env.compiling import kernel, scalar
from auv_fault_env.parameters import SAMPLE_TIME
from auv_fault_env.physics import (
    RPM,
    armature_current,
    clipped,
    disturbance_memory,
    motor,
    shaft_speed_after,
    surge_acceleration,
)
from diagnosers.bank.motor import STANDING
from diagnosers.kalman import START_SPEED_STD

STEP = 1e-4  # of the forward differences, in m/s, m/s^2 and V
OUTLIER = 6.0  # standard deviations to which an innovation is clipped
SETTLING = 10  # samples in which a shaft reaches the speed of its first voltage


@scalar
def mean_acceleration(speed, before, now, drag, disturbance, side, opening):
    """Mean acceleration over a sample at constant speed, shafts `before`, `now`, (2,) [rad/s]."""
    first = surge_acceleration(speed, before[0], before[1], drag, disturbance, side, side)
    last = surge_acceleration(speed, now[0], now[1], drag, disturbance, side, side)
    return opening * first + (1.0 - opening) * last


@scalar
def predicted_speed(speed, before, now, drag, disturbance, side, opening):
    """Surge speed one sample later, by the midpoint rule."""
    middle = speed + 0.5 * SAMPLE_TIME * mean_acceleration(
        speed, before, now, drag, disturbance, side, opening
    )
    return speed + SAMPLE_TIME * mean_acceleration(
        middle, before, now, drag, disturbance, side, opening
    )


@kernel
def speed_innovations(
    starts,
    reading,
    shaft_speeds,
    deflection,
    shaft,
    constants,
    opening,
    noise,
    innovation,
    std,
    predicted,
):
    """Fill innovation, its standard deviation and the predicted speed, (n_samples,) each [m/s].

    An extended Kalman filter of speed and disturbance; the hull is that of the constants.

    Parameters
    ----------
    starts, deflection
        (n_samples,) whether a segment begins; squared and summed deflections [rad^2].
    reading
        (n_samples,) speed [m/s]; NaN without a reading: then the filter only predicts.
    shaft_speeds
        (n_samples, 2) [rad/s].
    shaft
        Both shafts; only their beta matters.
    opening
        Share of a sample's first thrust in its mean: `diagnosers.kalman.opening_share`.
    noise
        Standard deviation of a reading [m/s].
    """
    side = motor(shaft, constants, 0.0)
    memory, kick = disturbance_memory(constants)
    speed = 0.0
    disturbance = 0.0
    variance = 0.0
    covariance = 0.0
    disturbance_variance = 0.0
    for k in range(reading.size):
        if starts[k]:
            speed = 0.0
            disturbance = 0.0
            variance = START_SPEED_STD**2
            covariance = 0.0
            disturbance_variance = constants.disturbance_std**2
        else:
            drag = constants.alpha + constants.gamma * deflection[k]
            before = shaft_speeds[k - 1]
            now = shaft_speeds[k]
            disturbance = memory * disturbance
            covariance = memory * covariance
            disturbance_variance = memory * memory * disturbance_variance + kick * kick
            ahead = predicted_speed(speed, before, now, drag, disturbance, side, opening)
            by_speed = (
                predicted_speed(speed + STEP, before, now, drag, disturbance, side, opening) - ahead
            ) / STEP
            by_disturbance = (
                predicted_speed(speed, before, now, drag, disturbance + STEP, side, opening) - ahead
            ) / STEP
            variance = (
                by_speed * (by_speed * variance + 2.0 * by_disturbance * covariance)
                + by_disturbance * by_disturbance * disturbance_variance
            )
            covariance = by_speed * covariance + by_disturbance * disturbance_variance
            speed = ahead
        predicted[k] = speed
        innovation[k] = reading[k] - speed
        total = variance + noise * noise
        std[k] = math.sqrt(total)
        if not math.isnan(innovation[k]):
            bounded = clipped(innovation[k], -OUTLIER * std[k], OUTLIER * std[k])
            speed += variance / total * bounded
            disturbance += covariance / total * bounded
            disturbance_variance -= covariance * covariance / total
            variance = variance * noise * noise / total
            covariance = covariance * noise * noise / total


@scalar
def whitened(inputs, ahead, by_voltage, shaft, noise):
    """Independent residuals of rpm and of current, of unit variance; zero for a missing channel.

    The voltage's error is in both predictions, the rpm counter's in that of the current.
    """
    voltage = inputs[0]
    current = inputs[1]
    rpm = inputs[2]
    conductance = 1.0 / shaft.resistance
    slope = shaft.torque_constant / (shaft.resistance * RPM)
    first = rpm - RPM * ahead
    if math.isnan(rpm):
        residual = current - armature_current(shaft, ahead, voltage)
        return 0.0, residual / math.hypot(noise[1], (conductance - slope * by_voltage) * noise[0])
    if math.isnan(voltage):
        by_current = by_voltage / conductance
        by_rpm = 1.0 - by_voltage * slope / conductance
        return first / math.hypot(by_current * noise[1], by_rpm * noise[2]), 0.0
    first_variance = noise[2] ** 2 + (by_voltage * noise[0]) ** 2
    covariance = by_voltage * conductance * noise[0] ** 2 + slope * noise[2] ** 2
    second = (
        current - armature_current(shaft, rpm / RPM, voltage) - covariance / first_variance * first
    )
    variance = (
        noise[1] ** 2
        + (conductance * noise[0]) ** 2
        + (slope * noise[2]) ** 2
        - covariance**2 / first_variance
    )
    return first / math.sqrt(first_variance), second / math.sqrt(variance)


@kernel
def shaft_residuals(starts, inputs, is_read, speed, shaft, constants, noise, residual, predicted):
    """Fill residuals of rpm and current, of unit variance, and predictions, (n_samples, 2) each.

    The voltage sets the shaft speed, and both set the current. Errors in the voltage count as
    errors of an input: otherwise they would bias the torque constant upwards. Residuals are zero
    without a reading, where the shaft hardly turns, and at the start of a segment.

    Parameters
    ----------
    starts, is_read, speed
        (n_samples,) whether a segment begins; whether all inputs were read; surge speed [m/s].
    inputs
        (n_samples, 3): voltage, current and rpm, interpolated between readings; NaN for a missing
        channel. A missing voltage is computed from current and rpm, a missing rpm from the voltage.
    noise
        (3,) standard deviations of the inputs.
    """
    shaft_speed = 0.0
    for k in range(is_read.size):
        voltage = inputs[k, 0]
        current = inputs[k, 1]
        rpm = inputs[k, 2]
        if math.isnan(voltage):
            voltage = shaft.resistance * current + shaft.torque_constant * rpm / RPM
        side = motor(shaft, constants, voltage)
        near = motor(shaft, constants, voltage + STEP)
        if starts[k]:
            shaft_speed = 0.0
            for _ in range(SETTLING):
                shaft_speed = shaft_speed_after(shaft_speed, side, speed[k], 0.0, SAMPLE_TIME)
        ahead = shaft_speed_after(shaft_speed, side, speed[k], 0.0, SAMPLE_TIME)
        by_voltage = (
            RPM * (shaft_speed_after(shaft_speed, near, speed[k], 0.0, SAMPLE_TIME) - ahead) / STEP
        )
        predicted[k, 0] = RPM * ahead
        predicted[k, 1] = armature_current(shaft, ahead, voltage)
        residual[k, 0] = residual[k, 1] = 0.0
        is_turning = (RPM * ahead if math.isnan(rpm) else rpm) > STANDING
        if is_read[k] and is_turning and not starts[k]:
            residual[k, 0], residual[k, 1] = whitened(inputs[k], ahead, by_voltage, shaft, noise)
        shaft_speed = rpm / RPM if is_read[k] and not math.isnan(rpm) else ahead
