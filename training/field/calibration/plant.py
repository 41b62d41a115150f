"""What compiled code gets of a vehicle file's vehicle, and how far its parameters may go."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from auv_fault_env.parameters import Vehicle
from training.field.calibration.robust_fit import LEAST_BLOCKS, NO_FIT, Fit
from training.field.calibration.samples import BLOCK
from training.field.vehicle_file import QUANTITIES

LEAST_FACTOR = 1e-3  # on a parameter, so that it keeps its sign


class Part(NamedTuple):
    """The fit of surge or motors: `unit` is the physical value of each parameter by that of the fit.

    why: by parameter that keeps the file's value, the reason and the manoeuvre that would help.
    """

    fit: Fit
    unit: Mapping[str, float]
    why: Mapping[str, tuple[str, str]]


def factors(vehicle: Vehicle, name: str) -> tuple[float, float]:
    """Least and largest factor on a parameter that keep it within its physical limits."""
    value = getattr(vehicle, name)
    spec = QUANTITIES[name]
    low, high = sorted((spec["low"] / value, spec["high"] / value)) if value else (0.0, 2.0)
    return min(max(low, LEAST_FACTOR), 0.999), max(high, 1.001)


def doubt(share: float) -> str:
    """Why a parameter is not identified, given its relative standard deviation."""
    if np.isnan(share):
        return f"the readings are of less than {LEAST_BLOCKS * BLOCK:g} s"
    return (
        f"its standard deviation would be {100 * share:.0f} %"
        if share < 10.0
        else "the readings hardly show it"
    )


def nothing(names: tuple[str, ...], why: str, remedy: str) -> Part:
    """A part of which nothing could be fitted."""
    return Part(NO_FIT, {}, dict.fromkeys(names, (why, remedy)))
