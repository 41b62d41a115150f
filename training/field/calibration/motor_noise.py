"""The noise of a motor's sensors, told from what the controller makes the motor do.

Voltage and shaft speed move from sample to sample because the controller answers to noise, so their
own roughness tells too much. The error of a prediction does not know of that: it shares with each
reading nothing but the reading's noise.
"""

from collections.abc import Mapping

import numpy as np

from auv_fault_env.parameters import Vehicle
from training.field.calibration.motor_fit import ShaftLog, shaft
from training.field.calibration.samples import NORMAL_MAD

NUDGE = 0.01  # V, for the slope of the shaft speed
TAIL = 4.0  # standard deviations, beyond which a change or an error is out of the ordinary


def motor_noise(log: ShaftLog, vehicle: Vehicle, values: Mapping[str, float]) -> dict[str, float]:
    """Standard deviations of the noise of voltage, current and rpm at these values of the fit, where they can be told.

    The voltage is an input: its noise comes, with the slope of the shaft speed, negative into the
    error of the predicted rpm. Without an rpm only the current's is told, without a voltage none.
    """
    voltage, current, rpm = log.inputs.T
    if np.isnan(voltage).all():
        return {}
    predicted = shaft(log, vehicle, values)[1]
    nudged = shaft(log._replace(inputs=log.inputs + np.array([NUDGE, 0.0, 0.0])), vehicle, values)[
        1
    ]
    slope = np.nanmean(nudged[log.read, 0] - predicted[log.read, 0]) / NUDGE
    left = rpm - predicted[:, 0], current - predicted[:, 1]
    variances = {"current": shared(current, left[1], log)}
    if not np.isnan(rpm).all():
        variances |= {
            "rpm": shared(rpm, left[0], log),
            "voltage": -shared(voltage, left[0], log) / slope,
        }
    return {
        kind: float(np.sqrt(variance)) for kind, variance in variances.items() if variance > 0.0
    }


def shared(reading: np.ndarray, error: np.ndarray, log: ShaftLog) -> float:
    """Covariance of the noise in a reading with that in the error of its sample's prediction, (n_samples,) each.

    The error knows nothing of the reading before, so this may serve to take the signal out of the
    reading. Outliers and changes of speed are left out.
    """
    stretch = np.cumsum(log.starts)[log.read]
    change = np.diff(reading[log.read])
    error = error[log.read][1:]
    calm = (stretch[1:] == stretch[:-1]) & _usual(change) & _usual(error)
    return float(np.mean(change[calm] * error[calm])) if calm.any() else 0.0


def _usual(values: np.ndarray) -> np.ndarray:
    return np.abs(values) <= TAIL * NORMAL_MAD * np.median(np.abs(values))
