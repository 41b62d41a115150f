"""The fit of the surge equation: drag, thrust and rudder drag, with the disturbance that the log shows.

Prediction errors of the speed, one sample ahead, by a Kalman filter that knows the disturbance as
an Ornstein-Uhlenbeck process; its strength and correlation time are fitted as well. Unlike a free
simulation this does not take for drag or thrust what a speed controller answers to the disturbance
(Ljung, "System Identification", 2nd ed. 1999, ch. 13).
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from auv_fault_env.parameters import Vehicle
from auv_fault_env.physics import nominal_shaft, plant_constants
from diagnosers.kalman import opening_share
from training.field.calibration.plant import Part, doubt, factors, nothing
from training.field.calibration.prediction import speed_innovations
from training.field.calibration.robust_fit import Problem, identified
from training.field.calibration.samples import Samples

# in the order in which they are held if not all are identified
PARAMETERS = ("gamma", "alpha", "beta")
# and where it may be; as logarithms
DISTURBANCE = {"disturbance_std": (1e-5, 1.0), "disturbance_time": (0.5, 100.0)}
REMEDIES = {
    "gamma": "a run with rudder or planes at 10 to 20 degrees and back, several times, at a steady command",
    "alpha": "speed steps of a factor of two and back, 10 to 20 s each: at constant speed only beta/alpha shows",
    "beta": "speed steps of a factor of two and back, 10 to 20 s each",
}


def surge_fit(
    samples: Samples, vehicle: Vehicle, noise: float, spins: Sequence[np.ndarray]
) -> Part:
    """Fit what of the hull and the thrust the readings identify.

    Parameters
    ----------
    samples, vehicle
        The logs, and the vehicle to start from.
    noise
        Standard deviation of a speed reading [m/s].
    spins
        Shaft speeds [rad/s], (n_samples, 2): the best known first, then those that are each a
        standard deviation off.
    """
    if not samples.exists("speed"):
        return nothing(PARAMETERS, "there is no speed reading", "log the speed through the water")
    if not spins:
        return nothing(
            PARAMETERS, "there is neither a shaft speed nor a voltage", "log one of them"
        )
    fit = identified(surge_problem(samples, vehicle, noise, spins))
    why = {name: (doubt(share), REMEDIES[name]) for name, share in fit.held.items()}
    if not samples.deflection.any():
        why["gamma"] = ("rudder and planes do not move", REMEDIES["gamma"])
    return Part(fit, {name: getattr(vehicle, name) for name in PARAMETERS}, why)


def surge_problem(
    samples: Samples, vehicle: Vehicle, noise: float, spins: Sequence[np.ndarray]
) -> Problem:
    """Whitened prediction errors of the speed as a function of factors on `PARAMETERS`.

    All are multiplied by one more factor, which makes the sum of their squares the likelihood of
    the disturbance: the geometric mean of the predictions' standard deviations, by that of the
    noise.
    """
    reading = samples.channel("speed")
    used = np.isfinite(reading) & np.isfinite(spins[0]).all(axis=1) & ~samples.starts

    def of(turning):
        def residuals(values):
            innovation, std, _ = innovations(samples, vehicle, values, noise, turning, reading)
            return innovation[used] / std[used] * np.exp(np.log(std[used] / noise).mean())

        return residuals

    order = [
        name
        for name in PARAMETERS
        if getattr(vehicle, name) and (name != "gamma" or samples.deflection.any())
    ]
    start = dict.fromkeys(PARAMETERS, 1.0)
    start |= {
        name: math.log(min(max(getattr(vehicle, name), low), high))
        for name, (low, high) in DISTURBANCE.items()
    }
    bounds = {name: factors(vehicle, name) for name in PARAMETERS}
    bounds |= {
        name: (math.log(low) - 1e-3, math.log(high) + 1e-3)
        for name, (low, high) in DISTURBANCE.items()
    }
    best, *others = map(of, spins)
    return Problem(
        best,
        start,
        bounds,
        order,
        tuple(DISTURBANCE),
        samples.block[used],
        samples.mission[used],
        others,
    )


def physical(vehicle: Vehicle, values: Mapping[str, float]) -> dict[str, float]:
    """Constants of the vehicle at these values of the fit."""
    surge = {
        name: getattr(vehicle, name) * value for name, value in values.items() if name in PARAMETERS
    }
    return surge | {name: math.exp(values[name]) for name in DISTURBANCE if name in values}


def innovations(
    samples: Samples,
    vehicle: Vehicle,
    values: Mapping[str, float],
    noise: float,
    spins: np.ndarray,
    reading: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Innovation, its standard deviation and predicted speed of `speed_innovations`, (n_samples,) each."""
    constants = physical(vehicle, values)
    shaft = nominal_shaft(vehicle)._replace(beta=constants.pop("beta", vehicle.beta) / 2)
    plant = shaft, plant_constants(vehicle)._replace(**constants), opening_share(vehicle)
    inputs = (
        samples.starts,
        np.ascontiguousarray(reading),
        np.ascontiguousarray(spins),
        samples.deflection,
    )
    out = np.empty((3, reading.size))
    speed_innovations(*inputs, *plant, noise, *out)
    return out[0], out[1], out[2]
