"""The fit of the surge equation: drag, thrust and rudder drag, with the disturbance of the log.

Prediction errors of the speed, one sample ahead, come from a Kalman filter with the disturbance as
an Ornstein-Uhlenbeck process; its strength and correlation time are fitted as well. A free
simulation would take for drag or thrust what a speed controller answers to the disturbance; this
fit does not (Ljung, "System Identification", 2nd ed. 1999, ch. 13).
"""

import math
from collections.abc import Sequence

import numpy as np

from auv_fault_env.parameters import Vehicle
from auv_fault_env.physics import nominal_shaft, plant_constants
from diagnosers.kalman import opening_share
from training.field.calibration.model_fit import (
    ModelFit,
    factor_limits,
    model_fit,
    no_model_fit,
)
from training.field.calibration.prediction import speed_innovations
from training.field.calibration.robust_fit import NO_FIT, Fit, Problem, Residuals, Values
from training.field.calibration.samples import Samples

# in the order in which they are fixed if not all are identified
PARAMETERS = ("gamma", "alpha", "beta")
# with the limits between which it is sought; fitted as logarithms
DISTURBANCE = {"disturbance_std": (1e-5, 1.0), "disturbance_time": (0.5, 100.0)}
SPEED_STEPS = "speed steps of a factor of two and back, 10 to 20 s each"
REMEDIES = {
    "gamma": "a run at constant command, rudder or planes to 10 to 20 degrees and back, repeated",
    "alpha": f"{SPEED_STEPS}: at constant speed only beta/alpha shows",
    "beta": SPEED_STEPS,
}


def surge_fit(
    samples: Samples,
    vehicle: Vehicle,
    noise: float,
    shaft_speeds: Sequence[np.ndarray],
    like: Fit = NO_FIT,
) -> ModelFit:
    """Fit what the readings identify of the hull and the thrust, first as a fit to other samples.

    `noise` is the standard deviation of a speed reading [m/s]. Shaft speeds [rad/s] are
    (n_samples, 2) each: the best estimate first, then some that are each a standard deviation off.
    """
    if not samples.has("speed"):
        why = "there is no speed reading"
        return no_model_fit(PARAMETERS, why, "log the speed through the water")
    if not shaft_speeds:
        why = "there is neither a shaft speed nor a voltage"
        return no_model_fit(PARAMETERS, why, "log one of them")
    problem = surge_problem(samples, vehicle, noise, shaft_speeds)
    scales = {name: getattr(vehicle, name) for name in PARAMETERS}
    fit = model_fit(problem, scales, REMEDIES, like)
    if samples.deflection.any():
        return fit
    unmoved = "rudder and planes do not move", REMEDIES["gamma"]
    return fit._replace(why={**fit.why, "gamma": unmoved})


def surge_problem(
    samples: Samples,
    vehicle: Vehicle,
    noise: float,
    shaft_speeds: Sequence[np.ndarray],
) -> Problem:
    """Whitened prediction errors of the speed as a function of factors on `PARAMETERS`.

    All are multiplied by one more factor, which makes the sum of their squares the likelihood of
    the disturbance: the geometric mean of the predictions' standard deviations, by that of the
    noise.
    """
    reading = samples.channel("speed")
    is_known = np.isfinite(reading) & np.isfinite(shaft_speeds[0]).all(axis=1)
    is_used = is_known & ~samples.starts

    def residuals_at(speeds: np.ndarray) -> Residuals:
        def residuals(values: Values) -> np.ndarray:
            innovation, std, _ = innovations(samples, vehicle, values, noise, speeds, reading)
            mean_std = np.exp(np.log(std[is_used] / noise).mean())
            return innovation[is_used] / std[is_used] * mean_std

        return residuals

    fitted = [name for name in PARAMETERS if getattr(vehicle, name)]
    if not samples.deflection.any():
        fitted = [name for name in fitted if name != "gamma"]
    start = dict.fromkeys(PARAMETERS, 1.0)
    bounds = {name: factor_limits(vehicle, name) for name in PARAMETERS}
    for name, (low, high) in DISTURBANCE.items():
        start[name] = math.log(min(max(getattr(vehicle, name), low), high))
        bounds[name] = (math.log(low) - 1e-3, math.log(high) + 1e-3)
    residuals, *variants = map(residuals_at, shaft_speeds)
    return Problem(
        residuals=residuals,
        start=start,
        bounds=bounds,
        order=fitted,
        nuisance=tuple(DISTURBANCE),
        block=samples.block[is_used],
        unit=samples.mission[is_used],
        variants=variants,
    )


def vehicle_constants(vehicle: Vehicle, values: Values) -> dict[str, float]:
    """Constants of the vehicle at these values of the fit."""
    constants = {
        name: getattr(vehicle, name) * values[name] for name in values if name in PARAMETERS
    }
    disturbance = {name: math.exp(values[name]) for name in DISTURBANCE if name in values}
    return constants | disturbance


def innovations(
    samples: Samples,
    vehicle: Vehicle,
    values: Values,
    noise: float,
    shaft_speeds: np.ndarray,
    reading: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Innovation, its standard deviation and predicted speed [m/s], (n_samples,) each."""
    changes = vehicle_constants(vehicle, values)
    shaft = nominal_shaft(vehicle)._replace(beta=changes.pop("beta", vehicle.beta) / 2)
    constants = plant_constants(vehicle)._replace(**changes)
    innovation = np.empty(reading.size)
    std = np.empty(reading.size)
    predicted = np.empty(reading.size)
    speed_innovations(
        samples.starts,
        np.ascontiguousarray(reading),
        np.ascontiguousarray(shaft_speeds),
        samples.deflection,
        shaft,
        constants,
        opening_share(vehicle),
        noise,
        innovation,
        std,
        predicted,
    )
    return innovation, std, predicted
