"""What a healthy motor draws at its voltage and the vehicle's speed: measured current beside it tells the shaft's load.

It needs no shaft speed, and the sign is kept: a fouled propeller draws more, a damaged one less.
"""

import math

import numpy as np

from auv_fault_env.compiling import kernel
from auv_fault_env.parameters import SAMPLE_TIME, Vehicle
from auv_fault_env.physics import armature_current, motor, shaft_speed_after
from diagnosers.symptoms.residuals import plant_of


@kernel
def _draw(voltage, speed, shaft, plant, current):
    """Fill the currents; readings that are missing are held, zero before the first."""
    turning = 0.0
    applied = 0.0
    through = 0.0
    for k in range(voltage.size):
        applied = applied if math.isnan(voltage[k]) else voltage[k]
        through = through if math.isnan(speed[k]) else speed[k]
        turning = shaft_speed_after(
            turning, motor(shaft, plant, applied), through, 0.0, SAMPLE_TIME
        )
        current[k] = armature_current(shaft, turning, applied)


def healthy_current(voltage: np.ndarray, speed: np.ndarray, vehicle: Vehicle) -> np.ndarray:
    """Current [A] of a nominal motor at every sample, (n_samples,), 0.1 s apart, from a standing shaft on.

    Voltage [V] and surge speed [m/s], (n_samples,): NaN where nothing was read, and then held.
    Misleads in the first sample of a log that begins under way, and where the voltage moves between
    readings that are far apart.
    """
    current = np.empty(len(voltage))
    plant, shaft = plant_of(vehicle)
    _draw(*(np.ascontiguousarray(x, np.float64) for x in (voltage, speed)), shaft, plant, current)
    return current


def excess_load(measured: np.ndarray, healthy: np.ndarray) -> float | None:
    """Measured over healthy current, less one: 0.5 is half as much load again; both (n_samples,) [A], NaN for none.

    None where the healthy motor would draw nothing, or nothing was measured.
    """
    heard = ~np.isnan(measured)
    drawn = float(healthy[heard].sum())
    return float(measured[heard].sum()) / drawn - 1.0 if drawn > 0.0 else None
