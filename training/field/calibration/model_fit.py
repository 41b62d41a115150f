"""The fit of one model, the motors or surge, and why parameters are not identified."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from auv_fault_env.parameters import Vehicle
from training.field.calibration.robust_fit import (
    LEAST_BLOCKS,
    NO_FIT,
    Fit,
    Problem,
    Values,
    fit_identifiable,
)
from training.field.calibration.samples import BLOCK
from training.field.vehicle_file import QUANTITIES

LEAST_FACTOR = 1e-3  # on a parameter, so that its sign stays


class ModelFit(NamedTuple):
    """The fit of the motors or of surge."""

    fit: Fit  # in the parameters of the fit, which are relative
    scale: Values  # physical value of each parameter by its value in the fit
    # by parameter that keeps the file's value: the reason, and a manoeuvre that would help
    why: Mapping[str, tuple[str, str]]


def no_model_fit(names: tuple[str, ...], why: str, remedy: str) -> ModelFit:
    """A model of which no parameter could be fitted."""
    return ModelFit(NO_FIT, {}, dict.fromkeys(names, (why, remedy)))


def model_fit(
    problem: Problem, scale: Values, remedies: Mapping[str, str], like: Fit = NO_FIT
) -> ModelFit:
    """Fit what the residuals identify, first as another fit; the rest gets a reason and remedy."""
    fit = fit_identifiable(problem, like)
    reasons = {name: reason_unidentified(std) for name, std in fit.unidentified.items()}
    why = {name: (reason, remedies[name]) for name, reason in reasons.items()}
    return ModelFit(fit, scale, why)


def reason_unidentified(std: float) -> str:
    """Why a parameter is not identified, from its relative standard deviation."""
    if np.isnan(std):
        return f"the readings are of less than {LEAST_BLOCKS * BLOCK:g} s"
    if std < 10.0:
        return f"its standard deviation would be {100 * std:.0f} %"
    return "the readings hardly show it"


def factor_limits(vehicle: Vehicle, name: str) -> tuple[float, float]:
    """Least and largest factor that leave a parameter within its physical limits."""
    value = getattr(vehicle, name)
    quantity = QUANTITIES[name]
    if not value:
        return LEAST_FACTOR, 2.0
    low, high = sorted((quantity["low"] / value, quantity["high"] / value))
    return min(max(low, LEAST_FACTOR), 0.999), max(high, 1.001)
