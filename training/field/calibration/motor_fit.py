"""The fit of the motors, both sides as one: resistance, torque constant, friction, torque."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from auv_fault_env.parameters import SIDES, Vehicle
from auv_fault_env.physics import RPM, nominal_shaft, plant_constants
from training.field.calibration.model_fit import (
    ModelFit,
    factor_limits,
    model_fit,
    no_model_fit,
)
from training.field.calibration.prediction import shaft_residuals
from training.field.calibration.robust_fit import NO_FIT, Fit, Problem, Residuals, Values
from training.field.calibration.samples import Samples
from training.field.vehicle_file import NOISE

# In the order in which they are fixed if not all are identified: the data sheet states the first
# ones best.
PARAMETERS = (
    "viscous_friction",
    "torque_constant",
    "resistance",
    "propeller_torque",
    "coulomb_friction",
)
PHYSICAL = ("torque_constant", "resistance", "coulomb_friction")  # fitted as factors
INPUTS = ("voltage", "current", "rpm")
# of these inputs' noise against that of the current, relative
NOISE_UNCERTAINTY = {"voltage": 0.1, "rpm": 0.2}
STEPS = "runs at widely different shaft speeds, the slowest included, and starts from rest"
REMEDIES = dict.fromkeys(PARAMETERS, STEPS) | {
    "resistance": "hard accelerations, which draw large currents"
}


class ShaftLog(NamedTuple):
    """The log of one shaft, as the arguments of `shaft_residuals` describe it."""

    starts: np.ndarray
    inputs: np.ndarray
    is_read: np.ndarray
    speed: np.ndarray
    noise: np.ndarray


def motor_fit(samples: Samples, vehicle: Vehicle, noise: Values, like: Fit = NO_FIT) -> ModelFit:
    """Fit what the readings identify of the motors, first as a fit to other samples.

    `noise` is by reading, as in a vehicle file.
    """
    sides = [side for side in SIDES if samples.has(f"{side}_current")]
    if not sides:
        return no_model_fit(PARAMETERS, "there is no current reading", "log the motors' currents")
    sides = [side for side in sides if samples.has(f"{side}_voltage") or samples.has(f"{side}_rpm")]
    if not sides:
        why = "there is neither a shaft speed nor a voltage"
        return no_model_fit(PARAMETERS, why, "log one of them")
    if not samples.has("speed") and not samples.has("speed_command"):
        why = "there is no speed, which the propeller's torque depends on"
        return no_model_fit(PARAMETERS, why, "log the speed")
    problem = motor_problem(samples, vehicle, noise, sides)
    return model_fit(problem, parameter_scales(vehicle), REMEDIES, like)


def motor_problem(
    samples: Samples, vehicle: Vehicle, noise: Values, sides: Sequence[str]
) -> Problem:
    """Whitened residuals of rpm and current of all sides, by factors on `PARAMETERS`."""
    logs = {side: shaft_log(samples, side, noise) for side in sides}
    chosen = {}  # indices of the residuals of rpm and current, of all samples one after the other
    for side, log in logs.items():
        has_residual = [samples.has(f"{side}_rpm"), samples.has(f"{side}_voltage")]
        chosen[side] = np.flatnonzero(np.outer(log.is_read, has_residual))

    def residuals_of(logs: Mapping[str, ShaftLog]) -> Residuals:
        def residuals(values: Values) -> np.ndarray:
            by_side = []
            for side, log in logs.items():
                residual, _ = predict_shaft(log, vehicle, values)
                by_side.append(residual.take(chosen[side]))
            return np.concatenate(by_side)

        return residuals

    def of_residuals(by_side: Mapping[str, np.ndarray]) -> np.ndarray:
        """Numbers of samples, by side, as numbers of residuals."""
        return np.concatenate([by_side[side][chosen[side] // 2] for side in logs])

    start = dict.fromkeys(PARAMETERS, 1.0)
    start["viscous_friction"] = vehicle.viscous_friction / electric_damping(vehicle)
    bounds = {name: factor_limits(vehicle, name) for name in PHYSICAL}
    bounds["viscous_friction"] = (-100.0, 100.0)
    bounds["propeller_torque"] = factor_limits(vehicle, "c1")
    variants = []
    for kind, share in NOISE_UNCERTAINTY.items():
        factors = np.array([1.0 + share * (kind == name) for name in INPUTS])
        noisier = {side: log._replace(noise=log.noise * factors) for side, log in logs.items()}
        variants.append(residuals_of(noisier))
    return Problem(
        residuals=residuals_of(logs),
        start=start,
        bounds=bounds,
        order=PARAMETERS,
        nuisance=(),
        block=of_residuals(dict.fromkeys(sides, samples.block)),
        unit=of_residuals({side: 2 * samples.mission + SIDES.index(side) for side in sides}),
        variants=variants,
    )


def electric_damping(vehicle: Vehicle) -> float:
    """The motor's damping K^2/R [N m s/rad], scale of the viscous friction, which may be zero."""
    return vehicle.torque_constant**2 / vehicle.resistance


def parameter_scales(vehicle: Vehicle) -> dict[str, float]:
    """Physical value of each parameter by its value in the fit; 1 for the propeller's torque."""
    scales = {name: getattr(vehicle, name) for name in PHYSICAL}
    scales["viscous_friction"] = electric_damping(vehicle)
    scales["propeller_torque"] = 1.0
    return scales


def vehicle_constants(vehicle: Vehicle, values: Values) -> dict[str, float]:
    """Constants of the vehicle at these values of the fit."""
    scales = parameter_scales(vehicle)
    torque = values.get("propeller_torque", 1.0)
    constants = {
        name: scales[name] * value for name, value in values.items() if name != "propeller_torque"
    }
    return constants | {"c1": vehicle.c1 * torque, "c2": vehicle.c2 * torque}


def shaft_log(samples: Samples, side: str, noise: Values) -> ShaftLog:
    """One shaft's log, read where all of its channels were and the surge speed is known."""
    speed = samples.smoothed_speed
    names = [f"{side}_{kind}" for kind in INPUTS]
    inputs = np.column_stack([samples.interpolated_channel(name) for name in names])
    needed = [speed, *(samples.channel(name) for name in names if samples.has(name))]
    is_read = np.isfinite(needed).all(axis=0) & ~samples.starts
    std = np.array([noise[name] for name in names])
    return ShaftLog(samples.starts, inputs, is_read, np.ascontiguousarray(speed), std)


def predict_shaft(log: ShaftLog, vehicle: Vehicle, values: Values) -> tuple[np.ndarray, np.ndarray]:
    """Residuals and predictions of `shaft_residuals`, (n_samples, 2) each, at values of the fit."""
    residual = np.empty((len(log.is_read), 2))
    predicted = np.empty((len(log.is_read), 2))
    shaft = nominal_shaft(vehicle)._replace(**vehicle_constants(vehicle, values))
    constants = plant_constants(vehicle)
    inputs = log.starts, log.inputs, log.is_read, log.speed
    shaft_residuals(*inputs, shaft, constants, log.noise, residual, predicted)
    return residual, predicted


def simulated_shaft_speeds(samples: Samples, vehicle: Vehicle, values: Values) -> np.ndarray | None:
    """Shaft speeds [rad/s], (n_samples, 2), from the voltages; None without any."""
    speeds = []
    for side in SIDES:
        if samples.has(f"{side}_voltage"):
            _, predicted = predict_shaft(shaft_log(samples, side, NOISE), vehicle, values)
            speeds.append(predicted[:, 0] / RPM)
    return np.column_stack([speeds[0], speeds[-1]]) if speeds else None
