"""The noise of a motor's sensors, from the errors of predictions.

Voltage and shaft speed move from sample to sample because the controller answers to noise, so their
second differences overstate the noise. The error of a prediction has nothing in common with a
reading but the reading's noise.
"""

import numpy as np

from auv_fault_env.parameters import Vehicle
from training.field.calibration.motor_fit import ShaftLog, predict_shaft
from training.field.calibration.robust_fit import Values
from training.field.calibration.samples import NORMAL_MAD

VOLTAGE_STEP = 0.01  # V, for the slope of the shaft speed
TAIL = 4.0  # standard deviations, beyond which a change or an error is an outlier


def motor_noise(log: ShaftLog, vehicle: Vehicle, values: Values) -> dict[str, float]:
    """Standard deviations of the noise of voltage, current and rpm at these values of the fit.

    The voltage is an input: its noise enters the error of the predicted rpm negatively, times the
    slope of the shaft speed. Without an rpm only the current's noise is estimated, without a
    voltage none.
    """
    voltage, current, rpm = log.inputs.T
    if np.isnan(voltage).all():
        return {}
    _, predicted = predict_shaft(log, vehicle, values)
    variances = {"current": noise_covariance(current, current - predicted[:, 1], log)}
    if not np.isnan(rpm).all():
        raised_inputs = log.inputs + np.array([VOLTAGE_STEP, 0.0, 0.0])
        _, raised = predict_shaft(log._replace(inputs=raised_inputs), vehicle, values)
        change = raised[log.is_read, 0] - predicted[log.is_read, 0]
        slope = np.nanmean(change) / VOLTAGE_STEP
        rpm_error = rpm - predicted[:, 0]
        variances["rpm"] = noise_covariance(rpm, rpm_error, log)
        variances["voltage"] = -noise_covariance(voltage, rpm_error, log) / slope
    return {kind: float(np.sqrt(value)) for kind, value in variances.items() if value > 0.0}


def noise_covariance(reading: np.ndarray, error: np.ndarray, log: ShaftLog) -> float:
    """Covariance of the noise of a reading and of its prediction error, (n_samples,) each.

    The error does not depend on the reading before, so that a difference of readings removes the
    signal. Outliers and changes of speed are left out.
    """
    segment = np.cumsum(log.starts)[log.is_read]
    is_same_segment = segment[1:] == segment[:-1]
    change = np.diff(reading[log.is_read])
    error = error[log.is_read][1:]
    is_used = is_same_segment & _is_ordinary(change) & _is_ordinary(error)
    return float(np.mean(change[is_used] * error[is_used])) if is_used.any() else 0.0


def _is_ordinary(values: np.ndarray) -> np.ndarray:
    return np.abs(values) <= TAIL * NORMAL_MAD * np.median(np.abs(values))
