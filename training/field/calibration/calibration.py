"""Calibration: a vehicle file made to fit healthy logs, with what is and what is not known of every parameter."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS
from auv_fault_env.parameters import SIDES, Vehicle
from diagnosers.kalman import NOISE_FLOOR
from training.field.calibration import motor_fit, surge_fit
from training.field.calibration.healthy_band import healthy_band
from training.field.calibration.motor_noise import motor_noise
from training.field.calibration.plant import Part
from training.field.calibration.samples import Samples, noise_levels, samples_of
from training.field.logs.log import Log
from training.field.vehicle_file import BAND, NOISE, QUANTITIES, VehicleFile

NAMES = (*reversed(surge_fit.PARAMETERS), *reversed(motor_fit.PARAMETERS), *surge_fit.DISTURBANCE)
TWINS = {"propeller_torque": ("c1", "c2")}  # parameters of the file that go by one of the fit


class Estimate(NamedTuple):
    """What is known of one parameter, in its unit: `propeller_torque` is a factor on C1 and C2.

    low and high bound the 95 % interval, which holds for the other held parameters as the file has
    them. band: relative half-width of the healthy band. why, remedy: of a parameter that keeps the
    file's value; empty for one that was fitted.
    """

    name: str
    unit: str
    before: float
    value: float
    std: float
    low: float
    high: float
    band: float
    why: str = ""
    remedy: str = ""


@dataclass(frozen=True)
class Calibration:
    """A calibrated vehicle.

    Attributes
    ----------
    vehicle
        The vehicle file with the fitted parameters, the healthy band, and the sensors' noise.
    before
        The vehicle file as it was.
    motor, surge
        The fits.
    """

    vehicle: VehicleFile
    before: VehicleFile
    motor: Part
    surge: Part

    def estimate(self, name: str) -> Estimate:
        """What is known of a parameter of `NAMES`."""
        fit = self.part(name).fit
        unit = QUANTITIES[name]["unit"] if name in QUANTITIES else "1"
        before, value = (getattr(file.vehicle, name, 1.0) for file in (self.before, self.vehicle))
        value = fit.values[name] if name in TWINS and name in fit.names else value
        band = self.vehicle.band.get(TWINS.get(name, (name,))[0], 0.0)
        if name not in fit.names:
            return Estimate(
                name,
                unit,
                before,
                value,
                *3 * [math.nan],
                band,
                *self.part(name).why.get(name, ("", "")),
            )
        place = fit.names.index(name)
        point = fit.estimate[place]
        std = fit.std[place]
        ends = np.array([point - fit.quantile * std, point + fit.quantile * std])
        if name in surge_fit.DISTURBANCE:
            return Estimate(name, unit, before, value, value * std, *np.exp(ends).tolist(), band)
        scale = self.part(name).unit[name]
        return Estimate(
            name, unit, before, value, abs(scale) * std, *sorted((scale * ends).tolist()), band
        )

    def part(self, name: str) -> Part:
        """The fit that a parameter belongs to."""
        return self.motor if name in motor_fit.PARAMETERS else self.surge


def calibrated(logs: Sequence[Log], vehicle: VehicleFile) -> Calibration:
    """Fit the vehicle file to healthy logs.

    What the logs do not identify keeps the file's value. The motors come first, so that their
    voltages can stand in for shaft speeds that are not logged.

    Misleads: what was wrong during all of the logs is healthy from now on. Wrong constants that are
    not fitted (rotor inertia, propeller diameter, a speed sensor's scale) go into those that are.
    """
    return fitted(samples_of(logs), vehicle)


def fitted(samples: Samples, vehicle: VehicleFile) -> Calibration:
    """As `calibrated`, for samples."""
    noise = {
        name: max(std, NOISE_FLOOR * NOISE[name]) for name, std in (NOISE | vehicle.noise).items()
    }
    noise |= {
        name: min(std, CHANNELS[name].high - CHANNELS[name].low)
        for name, std in noise_levels(samples).items()
    }
    nominal = vehicle.vehicle
    motor = motor_fit.motor_fit(samples, nominal, noise)
    noise |= _motor_noise(samples, nominal, noise, motor)
    motor = motor_fit.motor_fit(samples, nominal, noise)
    spins = shaft_speeds(samples, nominal, motor)
    nominal = replace(nominal, **motor_fit.physical(nominal, motor.fit.values))
    surge = surge_fit.surge_fit(samples, nominal, noise["speed"], spins)
    nominal = replace(nominal, **surge_fit.physical(nominal, surge.fit.values))
    usual = BAND | vehicle.band
    band = usual | _bands(motor, usual) | _bands(surge, usual)
    return Calibration(
        replace(vehicle, vehicle=nominal, band=band, noise=noise), vehicle, motor, surge
    )


def shaft_speeds(samples: Samples, vehicle: Vehicle, motor: Part) -> list[np.ndarray]:
    """Shaft speeds as read; else as the voltages make them, and what they are if the motors' fit is off; else none."""
    if samples.measured_spins is not None:
        return [samples.measured_spins]
    variance, axes = np.linalg.eigh(motor.fit.covariance)
    off = [
        dict(zip(motor.fit.names, step, strict=True))
        for step in (np.sqrt(np.maximum(variance, 0.0)) * axes).T
    ]
    points = [
        motor.fit.values,
        *({name: motor.fit.values[name] + step[name] for name in step} for step in off),
    ]
    spins = [motor_fit.simulated_shafts(samples, vehicle, values) for values in points]
    return [] if spins[0] is None else spins


def _motor_noise(
    samples: Samples, vehicle: Vehicle, noise: Mapping[str, float], motor: Part
) -> dict[str, float]:
    levels = {}
    for side in SIDES if motor.fit.names else ():
        if samples.exists(f"{side}_current"):
            found = motor_noise(
                motor_fit.shaft_log(samples, side, noise), vehicle, motor.fit.values
            )
            levels |= {
                f"{side}_{kind}": min(std, noise[f"{side}_{kind}"]) for kind, std in found.items()
            }
    return levels


def _bands(part: Part, usual: Mapping[str, float]) -> dict[str, float]:
    fit = part.fit
    bands = {}
    for k, name in enumerate(fit.names):
        for twin in filter(usual.__contains__, TWINS.get(name, (name,))):
            scale = fit.estimate[k]
            own = fit.own[:, k] / scale, fit.own_variance[:, k] / scale**2
            bands[twin] = healthy_band(*own, float(fit.std[k] / abs(scale)), usual[twin])
    return bands


def side_differences(calibration: Calibration) -> dict[str, tuple[float, float]]:
    """By motor parameter: port minus starboard, relative, and its standard deviation; empty with one shaft."""
    fit = calibration.motor.fit
    sides = fit.units % len(SIDES)
    if np.unique(sides).size < len(SIDES):
        return {}
    return {
        name: _difference(fit.own[:, k], fit.own_variance[:, k], sides)
        for k, name in enumerate(fit.names)
    }


def _difference(own: np.ndarray, variance: np.ndarray, sides: np.ndarray) -> tuple[float, float]:
    weight = [np.where(sides == side, 1.0 / variance, 0.0) for side in range(len(SIDES))]
    port, starboard = (np.sum(one * own) / one.sum() for one in weight)
    scale = (port + starboard) / 2
    return float((port - starboard) / scale), float(
        sum(1.0 / one.sum() for one in weight) ** 0.5 / abs(scale)
    )
