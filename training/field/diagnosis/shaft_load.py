"""The load of a shaft: its measured current beside that of a healthy motor.

The healthy current follows from voltage and surge speed; no shaft speed is needed. A fouled
propeller draws more than that, a damaged one less.
"""

import math

import numpy as np

from auv_fault_env.compiling import kernel
from auv_fault_env.parameters import SAMPLE_TIME, Vehicle
from auv_fault_env.physics import armature_current, motor, shaft_speed_after
from diagnosers.symptoms.residuals import plant_of


@kernel
def _fill_currents(voltage, speed, shaft, plant, current):
    """Fill the currents; a missing reading is the last one, zero before the first."""
    shaft_speed = 0.0
    last_voltage = 0.0
    last_speed = 0.0
    for k in range(voltage.size):
        last_voltage = last_voltage if math.isnan(voltage[k]) else voltage[k]
        last_speed = last_speed if math.isnan(speed[k]) else speed[k]
        driven = motor(shaft, plant, last_voltage)
        shaft_speed = shaft_speed_after(shaft_speed, driven, last_speed, 0.0, SAMPLE_TIME)
        current[k] = armature_current(shaft, shaft_speed, last_voltage)


def healthy_current(voltage: np.ndarray, speed: np.ndarray, vehicle: Vehicle) -> np.ndarray:
    """Current [A] of a nominal motor at every sample, (n_samples,), 0.1 s apart, from rest.

    Voltage [V] and surge speed [m/s] are (n_samples,), NaN without a reading: then the last one
    counts. Misleads in the first sample of a log that begins under way, and where the voltage moves
    between readings that are far apart.
    """
    current = np.empty(len(voltage))
    plant, shaft = plant_of(vehicle)
    voltage = np.ascontiguousarray(voltage, np.float64)
    speed = np.ascontiguousarray(speed, np.float64)
    _fill_currents(voltage, speed, shaft, plant, current)
    return current


def excess_load(measured: np.ndarray, healthy: np.ndarray) -> float | None:
    """Measured over healthy current, less one; both (n_samples,) [A], NaN for none.

    0.5 means half as much load again. None where the healthy motor would draw nothing, or nothing
    was measured.
    """
    is_available = ~np.isnan(measured)
    healthy_sum = float(healthy[is_available].sum())
    if healthy_sum <= 0.0:
        return None
    return float(measured[is_available].sum()) / healthy_sum - 1.0
