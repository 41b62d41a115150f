"""How finely a log tells its readings apart: repeated values mean a stuck sensor only where they need not occur."""

import numpy as np

from auv_fault_env.channels import CHANNELS, READINGS
from training.field.logs.log import Log
from training.field.vehicle_file import VehicleFile

# standard deviations; a sensor of coarser steps repeats itself so often that it may as well be
# stuck
COARSE = 0.5
# standard deviations; values further apart are levels of a command, not steps of a sensor
FARTHEST = 10.0
# standard deviations; step of what never changes, with which a repetition tells nothing
STAYING = 2.5
ROUNDING = 0.6  # of a step, what a reading may be off, again and again while the vehicle is steady
EVEN = 0.01  # of a step, how far values may be from a common grid


def resolutions(log: Log, vehicle: VehicleFile) -> dict[str, float]:
    """Step between neighbouring values of every reading of the vehicle [channel's unit]; 0 where there is no grid."""
    columns = {name: list(CHANNELS).index(name) for name in READINGS if name in vehicle.columns}
    return {
        name: resolution(log.observation[:, column], noise_of(name, vehicle))
        for name, column in columns.items()
    }


def noise_of(reading: str, vehicle: VehicleFile) -> float:
    """Standard deviation of a reading of this vehicle."""
    return vehicle.noise.get(reading, CHANNELS[reading].noise)


def is_coarse(step: float, noise: float) -> bool:
    """Whether a healthy sensor of such a resolution repeats itself so often that a stuck one cannot be told from it."""
    return step > COARSE * noise


def blurred(noise: float, step: float) -> float:
    """Standard deviation of a reading, its rounding included."""
    return max(noise, ROUNDING * step)


def limited(step: float, noise: float) -> float:
    """The step if it may be that of a sensor, else that of a command that stays."""
    return step if step <= FARTHEST * noise else STAYING * noise


def resolution(values: np.ndarray, noise: float) -> float:
    """Step of the grid on which the values (n,) lie, NaN for none, as `limited`; 0 without a grid.

    A constant column is taken for a command that stays: whether it is stuck, repetition does not
    tell.

    >>> (
    ...     resolution(np.array([0.5, 0.75, 0.5, 1.25]), noise=1.0),
    ...     resolution(np.array([0.1, 0.2371, 0.33]), noise=1.0),
    ... )
    (0.25, 0.0)
    """
    heard = values[~np.isnan(values)]
    levels = np.unique(heard)
    if levels.size < 2:
        return STAYING * noise
    step = float(np.diff(levels).min())
    counts = (levels - levels[0]) / step
    on_grid = np.abs(counts - np.round(counts)).max() < EVEN
    return limited(step, noise) if on_grid or levels.size < heard.size / 2 else 0.0


def printed_resolution(text: str, scale: float, noise: float) -> float:
    """Step between the values that a number printed like this can take, times the scale of its column's unit.

    >>> printed_resolution("12.50", 1.0, noise=1.0), printed_resolution("3", 0.1, noise=0.05)
    (0.01, 0.1)
    """
    mantissa, _, exponent = text.strip().lower().partition("e")
    decimals = len(mantissa.partition(".")[2]) - (int(exponent) if exponent else 0)
    return limited(abs(scale) * 10.0**-decimals, noise)
