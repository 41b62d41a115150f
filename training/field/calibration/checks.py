"""How well a calibrated vehicle predicts missions, above all one that it was not fitted to."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from auv_fault_env.parameters import SAMPLE_RATE, SIDES
from training.field.calibration import motor_fit, surge_fit
from training.field.calibration.calibration import (
    NAMES,
    Calibration,
    refitted,
)
from training.field.calibration.samples import Samples
from training.field.vehicle_file import VehicleFile

VEHICLE_PARAMETERS = tuple(name for name in NAMES if name not in surge_fit.DISTURBANCE)
# s at the beginning of a segment, in which the simulation receives the measured speed
START_TIME = 2.0
KINDS = {
    "speed": ("speed",),
    "rpm": tuple(f"{side}_rpm" for side in SIDES),
    "current": tuple(f"{side}_current" for side in SIDES),
}


class LeftOut(NamedTuple):
    """One mission against the fit to the others."""

    mission: int  # index of its log
    error: dict[str, float]  # root mean square by kind of `KINDS`, of the fit to all missions
    error_without: dict[str, float]  # the same of the fit without this mission
    changes: dict[str, float]  # by parameter, its change without the mission, relative


def simulated_readings(samples: Samples, vehicle: VehicleFile) -> dict[str, np.ndarray]:
    """Every logged reading as the vehicle's model predicts it, by channel, (n_samples,).

    Shaft speed and current follow from the voltage one sample ahead; the surge speed from the shaft
    speeds alone, after the first `START_TIME` of a segment.
    """
    nominal = vehicle.vehicle
    readings = {}
    speeds = samples.measured_shaft_speeds
    if speeds is None:
        speeds = motor_fit.simulated_shaft_speeds(samples, nominal, {})
    if speeds is not None:
        speed = samples.channel("speed")
        known_speed = np.where(_is_start(samples), speed, np.nan)
        noise = vehicle.noise["speed"]
        _, _, predicted_speed = surge_fit.innovations(
            samples, nominal, {}, noise, speeds, known_speed
        )
        readings["speed"] = np.where(samples.starts, np.nan, predicted_speed)
    for side in SIDES:
        if samples.has(f"{side}_current") or samples.has(f"{side}_voltage"):
            log = motor_fit.shaft_log(samples, side, vehicle.noise)
            _, predicted = motor_fit.predict_shaft(log, nominal, {})
            readings[f"{side}_rpm"] = predicted[:, 0]
            readings[f"{side}_current"] = predicted[:, 1]
    return {name: values for name, values in readings.items() if samples.has(name)}


def _is_start(samples: Samples) -> np.ndarray:
    return samples.since_start < START_TIME * SAMPLE_RATE


def prediction_errors(samples: Samples, vehicle: VehicleFile) -> dict[str, np.ndarray]:
    """Reading minus `simulated_readings`, by channel, (n_samples,); NaN up to `START_TIME`."""
    is_start = _is_start(samples)
    return {
        name: np.where(is_start, np.nan, samples.channel(name) - predicted)
        for name, predicted in simulated_readings(samples, vehicle).items()
    }


def rms_errors(samples: Samples, vehicle: VehicleFile) -> dict[str, float]:
    """Root mean square of `prediction_errors` by kind, both sides together."""
    by_channel = prediction_errors(samples, vehicle)
    by_kind = {}
    for kind, channels in KINDS.items():
        errors = np.concatenate([by_channel.get(name, np.empty(0)) for name in channels])
        errors = errors[np.isfinite(errors)]
        if errors.size:
            by_kind[kind] = float(np.sqrt(np.mean(errors**2)))
    return by_kind


def leave_one_out(
    samples: Samples, calibration: Calibration, names: Sequence[str]
) -> list[LeftOut]:
    """Predict each mission from a fit to the others; empty with one. The bar shows the names."""
    missions = range(len(names)) if len(names) > 1 else ()
    rows = []
    bar = tqdm(missions, desc="leaving one out", unit="mission", leave=False)
    for mission in bar:
        bar.set_postfix_str(names[mission])
        is_mission = samples.mission == mission
        without = refitted(samples.where(~is_mission), calibration)
        changes = {}
        for name in VEHICLE_PARAMETERS:
            common = calibration.parameter(name).value
            if common:
                changes[name] = without.parameter(name).value / common - 1.0
        left_out = samples.where(is_mission)
        error = rms_errors(left_out, calibration.vehicle)
        error_without = rms_errors(left_out, without.vehicle)
        rows.append(LeftOut(mission, error, error_without, changes))
    return rows
