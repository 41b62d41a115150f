"""The fit of the motors: resistance, torque constant, friction and propeller torque, both sides as one."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from auv_fault_env.parameters import SIDES, Vehicle
from auv_fault_env.physics import RPM, nominal_shaft, plant_constants
from training.field.calibration.plant import Part, doubt, factors, nothing
from training.field.calibration.prediction import shaft_residuals
from training.field.calibration.robust_fit import Problem, identified
from training.field.calibration.samples import Samples
from training.field.vehicle_file import NOISE

# In the order in which they are held if not all are identified: the data sheet knows the first ones
# best.
PARAMETERS = (
    "viscous_friction",
    "torque_constant",
    "resistance",
    "propeller_torque",
    "coulomb_friction",
)
INPUTS = ("voltage", "current", "rpm")
# of these inputs' noise against that of the current, relative
NOISE_DOUBT = {"voltage": 0.1, "rpm": 0.2}
STEPS = "runs at widely different shaft speeds, the slowest included, and starts from rest"
REMEDIES = dict.fromkeys(PARAMETERS, STEPS) | {
    "resistance": "hard accelerations, which draw large currents"
}


def motor_fit(samples: Samples, vehicle: Vehicle, noise: Mapping[str, float]) -> Part:
    """Fit what of the motors the readings identify; `noise` by reading, as in a vehicle file."""
    sides = [side for side in SIDES if samples.exists(f"{side}_current")]
    if not sides:
        return nothing(PARAMETERS, "there is no current reading", "log the motors' currents")
    sides = [
        side for side in sides if samples.exists(f"{side}_voltage") or samples.exists(f"{side}_rpm")
    ]
    if not sides:
        return nothing(
            PARAMETERS, "there is neither a shaft speed nor a voltage", "log one of them"
        )
    if not samples.exists("speed") and not samples.exists("speed_command"):
        return nothing(
            PARAMETERS,
            "there is no speed, which the propeller's torque depends on",
            "log the speed",
        )
    fit = identified(motor_problem(samples, vehicle, noise, sides))
    why = {name: (doubt(share), REMEDIES[name]) for name, share in fit.held.items()}
    return Part(fit, units(vehicle), why)


def motor_problem(
    samples: Samples, vehicle: Vehicle, noise: Mapping[str, float], sides: Sequence[str]
) -> Problem:
    """Whitened residuals of rpm and current as a function of factors on `PARAMETERS`, all sides' in one vector."""
    seen = {side: shaft_log(samples, side, noise) for side in sides}
    kinds = {
        side: [samples.exists(f"{side}_rpm"), samples.exists(f"{side}_voltage")] for side in sides
    }

    def of(logs):
        def residuals(values):
            parts = {side: shaft(log, vehicle, values)[0][log.read] for side, log in logs.items()}
            return np.concatenate([part[:, kinds[side]].ravel() for side, part in parts.items()])

        return residuals

    def places(number):
        return np.concatenate(
            [np.repeat(number(side)[seen[side].read], sum(kinds[side])) for side in sides]
        )

    start = dict.fromkeys(PARAMETERS, 1.0) | {
        "viscous_friction": vehicle.viscous_friction / damping(vehicle)
    }
    bounds = {
        name: factors(vehicle, name)
        for name in ("torque_constant", "resistance", "coulomb_friction")
    }
    bounds |= {"viscous_friction": (-100.0, 100.0), "propeller_torque": factors(vehicle, "c1")}
    block = places(lambda side: samples.block)
    unit = places(lambda side: 2 * samples.mission + SIDES.index(side))
    doubts = [
        np.array([1.0 + share * (kind == one) for one in INPUTS])
        for kind, share in NOISE_DOUBT.items()
    ]
    variants = [
        of({side: log._replace(noise=log.noise * doubt) for side, log in seen.items()})
        for doubt in doubts
    ]
    return Problem(of(seen), start, bounds, PARAMETERS, (), block, unit, variants)


def damping(vehicle: Vehicle) -> float:
    """The motor's own damping K^2/R [N m s/rad], in which the fit measures viscous friction: it may start from zero."""
    return vehicle.torque_constant**2 / vehicle.resistance


def units(vehicle: Vehicle) -> dict[str, float]:
    """Physical value of each parameter by that of the fit; the propeller's torque stays a factor, on C1 and C2."""
    known = {
        name: getattr(vehicle, name)
        for name in ("torque_constant", "resistance", "coulomb_friction")
    }
    return known | {"viscous_friction": damping(vehicle), "propeller_torque": 1.0}


def physical(vehicle: Vehicle, values: Mapping[str, float]) -> dict[str, float]:
    """Constants of the vehicle at these values of the fit."""
    unit = units(vehicle)
    torque = values.get("propeller_torque", 1.0)
    constants = {
        name: unit[name] * value for name, value in values.items() if name != "propeller_torque"
    }
    return constants | {"c1": vehicle.c1 * torque, "c2": vehicle.c2 * torque}


class ShaftLog(NamedTuple):
    """What `shaft_residuals` gets of one shaft's log; see there."""

    starts: np.ndarray
    inputs: np.ndarray
    read: np.ndarray
    speed: np.ndarray
    noise: np.ndarray


def shaft_log(samples: Samples, side: str, noise: Mapping[str, float]) -> ShaftLog:
    """One shaft's log; read where all of its channels were, and the surge speed is known."""
    speed = samples.smooth_speed
    inputs = np.column_stack([samples.channel(f"{side}_{kind}", held=True) for kind in INPUTS])
    names = [f"{side}_{kind}" for kind in INPUTS if samples.exists(f"{side}_{kind}")]
    read = np.isfinite([speed, *map(samples.channel, names)]).all(axis=0) & ~samples.starts
    std = np.array([noise[f"{side}_{kind}"] for kind in INPUTS])
    return ShaftLog(samples.starts, inputs, read, np.ascontiguousarray(speed), std)


def shaft(
    log: ShaftLog, vehicle: Vehicle, values: Mapping[str, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Residuals and predictions of `shaft_residuals`, (n_samples, 2) each, at these values of the fit."""
    out = np.empty((len(log.read), 2)), np.empty((len(log.read), 2))
    plant = nominal_shaft(vehicle)._replace(**physical(vehicle, values)), plant_constants(vehicle)
    shaft_residuals(log.starts, log.inputs, log.read, log.speed, *plant, log.noise, *out)
    return out


def simulated_shafts(
    samples: Samples, vehicle: Vehicle, values: Mapping[str, float]
) -> np.ndarray | None:
    """Shaft speeds [rad/s] that the voltages make at these values of the fit, (n_samples, 2); None without voltages."""
    sides = [side for side in SIDES if samples.exists(f"{side}_voltage")]
    spins = [
        shaft(shaft_log(samples, side, NOISE), vehicle, values)[1][:, 0] / RPM for side in sides
    ]
    return np.column_stack([spins[0], spins[-1]]) if spins else None
