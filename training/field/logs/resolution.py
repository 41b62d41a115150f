"""The resolution of a log: repeated values mean a stuck sensor only where its steps are fine."""

import numpy as np

from auv_fault_env.channels import INDEX, READINGS
from training.field.logs.log import Log
from training.field.vehicle_file import VehicleFile

# standard deviations; a sensor with coarser steps repeats itself as often as a stuck one
COARSE = 0.5
# standard deviations; values further apart are levels of a command, not steps of a sensor
LARGEST_STEP = 10.0
# standard deviations; step of a constant column, at which a repetition is no evidence
CONSTANT_STEP = 2.5
# of a step; error of a reading that stays the same while the vehicle's speed is constant
ROUNDING = 0.6
GRID_TOLERANCE = 0.01  # of a step, how far values may be from a common grid


def resolutions(log: Log, vehicle: VehicleFile) -> dict[str, float]:
    """Step between neighbouring values of every reading [channel's unit]; 0 without a grid."""
    return {
        name: resolution(log.observation[:, INDEX[name]], vehicle.noise[name])
        for name in READINGS
        if name in vehicle.columns
    }


def sensor_step(step: float, noise: float) -> float:
    """The step if it can be that of a sensor, else the step of a constant column."""
    return step if step <= LARGEST_STEP * noise else CONSTANT_STEP * noise


def resolution(values: np.ndarray, noise: float) -> float:
    """Step of the grid on which the values (n,) lie, NaN for none, as `sensor_step`; else 0.

    A constant column is taken for a constant command: repetition does not show whether it is stuck.

    >>> (
    ...     resolution(np.array([0.5, 0.75, 0.5, 1.25]), noise=1.0),
    ...     resolution(np.array([0.1, 0.2371, 0.33]), noise=1.0),
    ... )
    (0.25, 0.0)
    """
    available = values[~np.isnan(values)]
    levels = np.unique(available)
    if levels.size < 2:
        return CONSTANT_STEP * noise
    step = float(np.diff(levels).min())
    counts = (levels - levels[0]) / step
    is_on_grid = np.abs(counts - np.round(counts)).max() < GRID_TOLERANCE
    is_repeated = levels.size < available.size / 2
    return sensor_step(step, noise) if is_on_grid or is_repeated else 0.0


def printed_resolution(text: str, scale: float, noise: float) -> float:
    """Step between the values that a number printed like this can take, times the column's scale.

    >>> (
    ...     printed_resolution("12.50", 1.0, noise=1.0),
    ...     printed_resolution("3", 0.1, noise=0.05),
    ... )
    (0.01, 0.1)
    """
    mantissa, _, exponent = text.strip().lower().partition("e")
    decimals = len(mantissa.partition(".")[2]) - int(exponent or 0)
    return sensor_step(abs(scale) * 10.0**-decimals, noise)
