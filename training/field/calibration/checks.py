"""How well a calibrated vehicle predicts a mission, above all one that it was not fitted to."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from auv_fault_env.parameters import SAMPLE_RATE, SIDES
from training.field.calibration import motor_fit, surge_fit
from training.field.calibration.calibration import NAMES, Calibration, fitted
from training.field.calibration.samples import Samples
from training.field.calibration.surge_fit import DISTURBANCE
from training.field.vehicle_file import VehicleFile

VEHICLES_OWN = tuple(name for name in NAMES if name not in DISTURBANCE)
KNOWN = 2.0  # s at the beginning of a stretch, in which a simulation is told the speed
KINDS = {"speed": ("speed",), "rpm": tuple(f"{side}_rpm" for side in SIDES)}
KINDS |= {"current": tuple(f"{side}_current" for side in SIDES)}


class LeftOut(NamedTuple):
    """One mission against the fit to the others.

    error, error_without: root mean square by kind of `KINDS`, of the fit to all missions and of
    that without this one. changes: by parameter, how far it moves without the mission, relative.
    """

    mission: int
    error: dict[str, float]
    error_without: dict[str, float]
    changes: dict[str, float]


def simulated(samples: Samples, vehicle: VehicleFile) -> dict[str, np.ndarray]:
    """What the vehicle's model makes of every reading that exists, by channel, (n_samples,).

    Shaft speed and current follow from the voltage one sample ahead; the surge speed from the shaft
    speeds alone, once the first two seconds of a stretch have told where it starts.
    """
    out = {}
    sides = [
        side
        for side in SIDES
        if samples.exists(f"{side}_current") or samples.exists(f"{side}_voltage")
    ]
    for side in sides:
        _, predicted = motor_fit.shaft(
            motor_fit.shaft_log(samples, side, vehicle.noise), vehicle.vehicle, {}
        )
        out |= {f"{side}_rpm": predicted[:, 0], f"{side}_current": predicted[:, 1]}
    spins = samples.measured_spins
    spins = motor_fit.simulated_shafts(samples, vehicle.vehicle, {}) if spins is None else spins
    if spins is not None:
        told = np.where(samples.since_start < KNOWN * SAMPLE_RATE, samples.channel("speed"), np.nan)
        _, _, speed = surge_fit.innovations(
            samples, vehicle.vehicle, {}, vehicle.noise["speed"], spins, told
        )
        out = {"speed": np.where(samples.starts, np.nan, speed)} | out
    return {name: values for name, values in out.items() if samples.exists(name)}


def errors(samples: Samples, vehicle: VehicleFile) -> dict[str, np.ndarray]:
    """Reading minus `simulated`, by channel, (n_samples,); NaN where nothing was read or the simulation was told."""
    told = samples.since_start < KNOWN * SAMPLE_RATE
    return {
        name: np.where(told, np.nan, samples.channel(name) - at)
        for name, at in simulated(samples, vehicle).items()
    }


def rms(samples: Samples, vehicle: VehicleFile) -> dict[str, float]:
    """Root mean square of `errors` by kind, both sides together."""
    by_channel = errors(samples, vehicle)
    by_kind = {}
    for kind, channels in KINDS.items():
        values = np.concatenate([by_channel.get(name, np.empty(0)) for name in channels])
        values = values[np.isfinite(values)]
        if values.size:
            by_kind[kind] = float(np.sqrt(np.mean(values**2)))
    return by_kind


def leave_one_out(
    samples: Samples, calibration: Calibration, names: Sequence[str]
) -> list[LeftOut]:
    """Fit without each mission in turn, and predict it; empty with one mission. The progress bar shows `names`."""
    rows = []
    bar = tqdm(
        range(len(names)) if len(names) > 1 else (),
        desc="leaving one out",
        unit="mission",
        leave=False,
    )
    for mission in bar:
        bar.set_postfix_str(names[mission])
        alone = samples.of(samples.mission == mission)
        others = samples.of(samples.mission != mission)
        without = fitted(others, calibration.before)
        pairs = {
            name: (without.estimate(name).value, calibration.estimate(name).value)
            for name in VEHICLES_OWN
        }
        changes = {name: one / all_of - 1.0 for name, (one, all_of) in pairs.items() if all_of}
        both = rms(alone, calibration.vehicle), rms(alone, without.vehicle)
        rows.append(LeftOut(mission, *both, changes))
    return rows
