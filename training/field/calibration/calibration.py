"""Calibration: a vehicle file fitted to healthy logs, with an interval for every parameter."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS
from auv_fault_env.parameters import SIDES, Vehicle
from diagnosers.kalman import NOISE_FLOOR
from training.field.calibration import motor_fit, surge_fit
from training.field.calibration.healthy_band import healthy_band
from training.field.calibration.model_fit import ModelFit
from training.field.calibration.motor_noise import motor_noise
from training.field.calibration.robust_fit import NO_FIT, Fit, Values
from training.field.calibration.samples import Samples, noise_levels, samples_of
from training.field.logs.log import Log
from training.field.vehicle_file import MAXIMA, NOISE, QUANTITIES, VehicleFile

NAMES = (
    *reversed(surge_fit.PARAMETERS),
    *reversed(motor_fit.PARAMETERS),
    *surge_fit.DISTURBANCE,
)
# parameters of the file that one parameter of the fit multiplies
FILE_PARAMETERS = {"propeller_torque": ("c1", "c2")}
MOST = 99.9  # percentile of a channel that counts as its largest value
BEYOND = 1.05  # of the vehicle's maximum: noise alone goes a little beyond


class ParameterFit(NamedTuple):
    """The fit of one parameter, in its unit; `propeller_torque` is a factor on C1 and C2."""

    name: str
    unit: str
    before: float  # in the vehicle file
    value: float  # in the calibrated one
    # with the fixed parameters as in the file; NaN for a parameter that was not fitted
    std: float = math.nan
    low: float = math.nan  # of the 95 % interval
    high: float = math.nan
    band: float = 0.0  # relative half-width of the healthy band
    why: str = ""  # it keeps the file's value; empty for a fitted parameter
    remedy: str = ""  # what would help


@dataclass(frozen=True)
class Calibration:
    """A calibrated vehicle."""

    vehicle: VehicleFile  # with the fitted parameters, the healthy band, and the sensors' noise
    before: VehicleFile  # as it was
    motor: ModelFit
    surge: ModelFit

    @property
    def reached(self) -> tuple[str, ...]:
        """The maxima of the vehicle that are those of the logs, by name."""
        now = self.vehicle.vehicle
        before = self.before.vehicle
        return tuple(key for key in MAXIMA.values() if getattr(now, key) != getattr(before, key))

    def model_fit(self, name: str) -> ModelFit:
        """The fit that a parameter belongs to."""
        return self.motor if name in motor_fit.PARAMETERS else self.surge

    def is_fitted(self, name: str) -> bool:
        """Whether a parameter of `NAMES` was fitted."""
        return name in self.model_fit(name).fit.names

    def parameter(self, name: str) -> ParameterFit:
        """The calibration of a parameter of `NAMES`."""
        model = self.model_fit(name)
        fit = model.fit
        value = getattr(self.vehicle.vehicle, name, 1.0)
        if name in FILE_PARAMETERS and self.is_fitted(name):
            value = fit.values[name]
        unit = QUANTITIES[name]["unit"] if name in QUANTITIES else "1"
        before = getattr(self.before.vehicle, name, 1.0)
        first_name, *_ = FILE_PARAMETERS.get(name, (name,))
        band = self.vehicle.band.get(first_name, 0.0)
        parameter = ParameterFit(name, unit, before, value, band=band)
        if not self.is_fitted(name):
            why, remedy = model.why.get(name, ("", ""))
            return parameter._replace(why=why, remedy=remedy)
        index = fit.names.index(name)
        std = fit.std[index]
        margin = fit.quantile * std
        ends = np.array([fit.estimate[index] - margin, fit.estimate[index] + margin])
        if name in surge_fit.DISTURBANCE:
            low, high = np.exp(ends).tolist()
            return parameter._replace(std=value * std, low=low, high=high)
        scale = model.scale[name]
        low, high = sorted((scale * ends).tolist())
        return parameter._replace(std=abs(scale) * std, low=low, high=high)


def calibrate(logs: Sequence[Log], vehicle: VehicleFile) -> Calibration:
    """Fit the vehicle file to healthy logs.

    Parameters that the logs do not identify keep the file's value. The motors come first, so that
    their voltages can replace shaft speeds that are not logged.

    Misleads: a fault present in all of the logs counts as healthy from now on. Wrong constants that
    are not fitted (rotor inertia, propeller diameter, a sensor's scale) distort those that are.
    """
    return calibrate_samples(samples_of(logs), vehicle)


def calibrate_samples(samples: Samples, vehicle: VehicleFile) -> Calibration:
    """As `calibrate`, for samples."""
    nominal = vehicle.vehicle
    noise = _channel_noise(samples, vehicle)
    motor = motor_fit.motor_fit(samples, nominal, noise)
    better_noise = noise | _motor_noise(samples, nominal, noise, motor)
    if better_noise != noise:
        motor = motor_fit.motor_fit(samples, nominal, better_noise)
    calibration = _with_surge(samples, vehicle, better_noise, motor)
    reached = replace(calibration.vehicle.vehicle, **larger_maxima(samples, nominal))
    return replace(calibration, vehicle=replace(calibration.vehicle, vehicle=reached))


def larger_maxima(samples: Samples, vehicle: Vehicle) -> dict[str, float]:
    """The largest speed, voltage, current and shaft speed where the logs go beyond the vehicle's.

    Of the speed it is the commanded one, or that which is read if none is logged.
    """
    has_command = samples.has("speed_command")
    largest: dict[str, float] = {}
    for channel, spec in CHANNELS.items():
        is_reading_beside_command = channel == "speed" and has_command
        if spec.unit in MAXIMA and samples.has(channel) and not is_reading_beside_command:
            key = MAXIMA[spec.unit]
            reached = float(np.nanpercentile(np.abs(samples.channel(channel)), MOST))
            largest[key] = max(reached, largest.get(key, 0.0))
    return {
        key: min(float(f"{reached:.3g}"), QUANTITIES[key]["high"])
        for key, reached in largest.items()
        if reached > BEYOND * getattr(vehicle, key)
    }


def refitted(samples: Samples, calibration: Calibration) -> Calibration:
    """A calibration to other samples of the same vehicle, with the same noise.

    It has the same parameters as long as the samples identify them.
    """
    vehicle = calibration.before
    noise = calibration.vehicle.noise
    motor = motor_fit.motor_fit(samples, vehicle.vehicle, noise, calibration.motor.fit)
    return _with_surge(samples, vehicle, noise, motor, calibration.surge.fit)


def _with_surge(
    samples: Samples, vehicle: VehicleFile, noise: Values, motor: ModelFit, like: Fit = NO_FIT
) -> Calibration:
    """The calibration with a fit of the motors, after the fit of surge."""
    nominal = vehicle.vehicle
    speeds = shaft_speeds(samples, nominal, motor)
    nominal = replace(nominal, **motor_fit.vehicle_constants(nominal, motor.fit.values))
    surge = surge_fit.surge_fit(samples, nominal, noise["speed"], speeds, like)
    nominal = replace(nominal, **surge_fit.vehicle_constants(nominal, surge.fit.values))
    file_band = dict(vehicle.band)
    band = file_band | _bands(motor, file_band) | _bands(surge, file_band)
    calibrated = replace(vehicle, vehicle=nominal, band=band, noise=noise)
    return Calibration(calibrated, vehicle, motor, surge)


def _channel_noise(samples: Samples, vehicle: VehicleFile) -> dict[str, float]:
    """Noise by reading: as in the file, or from the samples where there are enough."""
    noise = {name: max(std, NOISE_FLOOR * NOISE[name]) for name, std in vehicle.noise.items()}
    for name, std in noise_levels(samples).items():
        noise[name] = min(std, CHANNELS[name].high - CHANNELS[name].low)
    return noise


def shaft_speeds(samples: Samples, vehicle: Vehicle, motor: ModelFit) -> list[np.ndarray]:
    """Shaft speeds [rad/s], (n_samples, 2) each: as read, else from the voltages, else none.

    Speeds from the voltages are followed by those with the motors' fit a standard deviation off, in
    the direction of each axis of its covariance.
    """
    if samples.measured_shaft_speeds is not None:
        return [samples.measured_shaft_speeds]
    fit = motor.fit
    variance, axes = np.linalg.eigh(fit.covariance)
    points = [fit.values]
    for step in (np.sqrt(np.maximum(variance, 0.0)) * axes).T:
        steps = dict(zip(fit.names, step, strict=True))
        points.append({name: fit.values[name] + steps[name] for name in steps})
    speeds = [motor_fit.simulated_shaft_speeds(samples, vehicle, values) for values in points]
    return [] if speeds[0] is None else speeds


def _motor_noise(
    samples: Samples, vehicle: Vehicle, noise: Values, motor: ModelFit
) -> dict[str, float]:
    levels = {}
    for side in SIDES if motor.fit.names else ():
        if samples.has(f"{side}_current"):
            log = motor_fit.shaft_log(samples, side, noise)
            for kind, std in motor_noise(log, vehicle, motor.fit.values).items():
                levels[f"{side}_{kind}"] = min(std, noise[f"{side}_{kind}"])
    return levels


def _bands(model: ModelFit, file_band: Values) -> dict[str, float]:
    fit = model.fit
    bands = {}
    for k, name in enumerate(fit.names):
        scale = fit.estimate[k]
        for parameter in FILE_PARAMETERS.get(name, (name,)):
            if parameter in file_band:
                bands[parameter] = healthy_band(
                    estimates=fit.unit_estimates[:, k] / scale,
                    variances=fit.unit_variances[:, k] / scale**2,
                    std=float(fit.std[k] / abs(scale)),
                    file_band=file_band[parameter],
                )
    return bands


def side_differences(calibration: Calibration) -> dict[str, tuple[float, float]]:
    """Port minus starboard by motor parameter, relative, and its std; empty with one shaft."""
    fit = calibration.motor.fit
    sides = fit.units % len(SIDES)
    if np.unique(sides).size < len(SIDES):
        return {}
    return {
        name: _difference(fit.unit_estimates[:, k], fit.unit_variances[:, k], sides)
        for k, name in enumerate(fit.names)
    }


def _difference(
    estimates: np.ndarray, variances: np.ndarray, sides: np.ndarray
) -> tuple[float, float]:
    weights = [np.where(sides == side, 1.0 / variances, 0.0) for side in range(len(SIDES))]
    port, starboard = (np.sum(weight * estimates) / weight.sum() for weight in weights)
    scale = (port + starboard) / 2
    variance = sum(1.0 / weight.sum() for weight in weights)
    return float((port - starboard) / scale), float(variance**0.5 / abs(scale))
