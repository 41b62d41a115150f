"""How faults change the residuals of a vehicle's relations, relative to what is predicted."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from auv_fault_env.faults import CATALOGUE
from auv_fault_env.parameters import SIDES
from diagnosers.relations.model import (
    LEAST_SIZE,
    TOLERANCE,
    RelationModel,
    Standardised,
    residual_of,
)
from diagnosers.relations.windows import BALANCE, PUSH, Windows

WITHOUT_LIMIT = 100.0
LEAST_OF_PROPELLER = 0.1  # of a load, that is not the constant one of friction
WORST_DAMAGE = 0.7  # share of its torque that a damaged propeller loses; a lost one loses more
# thrust that a propeller loses by the torque that it loses, each relative
THRUST_BY_TORQUE = (0.5, 0.7, 1.0, 1.4, 2.0)
FRICTION_THRUST = 0.1  # thrust that a line on a propeller costs, by the torque that it takes
AT_LIMIT = 3.0  # standard deviations
INEXACT = 0.2  # relative error of a direction
INEXACT_RESIDUAL = 0.1  # relative error of a large residual


Change = Callable[..., np.ndarray]  # changes of all residuals from those by name


class Direction(NamedTuple):
    """Relative changes of the residuals by a fault of amplitude 1, and its possible amplitudes."""

    change: np.ndarray  # (n, n_residuals), window first
    least: float = 0.0
    most: float = WITHOUT_LIMIT
    log_prior: float | np.ndarray = 0.0  # (n,), by what is not among the residuals


def directions(model: RelationModel, windows: Windows) -> dict[str, list[Direction]]:
    """Directions by class at the operating points of the windows."""
    names = model.layout.residuals
    speed = windows.speed

    def change(**of_residuals: float | np.ndarray) -> np.ndarray:
        """Relative changes (n, n_residuals) from those by name; the others are 0."""
        changes = np.zeros((len(speed), len(names)))
        for name, values in of_residuals.items():
            if name in names:
                changes[:, names.index(name)] = np.nan_to_num(values)
        return changes

    if not model.layout.has_shaft_speed:
        return _without_shaft_speed(model, change)
    push = model.coefficients[PUSH]
    shafts = windows.shaft_speed
    # of the net force by a relative change of the speed
    by_speed = -(push[1] * sum(shafts.values()) * speed + 2 * push[2] * speed**2 + push[3] * speed)
    load_by_speed = {}
    found = {
        "increased_drag": [Direction(change(push=-1.0))],
        "decreased_drag": [Direction(change(push=1.0))],
    }
    for side, shaft in shafts.items():
        load = model.coefficients[f"{side}_load"]
        predicted = _predicted_load(model, windows, side)
        load_by_speed[f"{side}_load"] = load[3] * shaft * speed / predicted
        found |= _of_propeller(model, windows, side, change)
        found |= _of_motor(model, windows, side, change)
    found["sensor:speed"] = _both(change(push=-by_speed / _drag(model, windows), **load_by_speed))
    return found


def _drag(model: RelationModel, windows: Windows) -> np.ndarray:
    """The drag that the relation of the net force predicts, (n,)."""
    push = model.coefficients[PUSH]
    return np.maximum(push[2] * windows.speed**2 + push[3] * windows.speed, 1e-9)


def _load_of_propeller(model: RelationModel, windows: Windows, side: str) -> np.ndarray:
    """The part of a side's load that the water takes, (n,)."""
    load = model.coefficients[f"{side}_load"]
    shaft = windows.shaft_speed[side]
    return load[2] * shaft**2 - load[3] * shaft * windows.speed


def _predicted_load(model: RelationModel, windows: Windows, side: str) -> np.ndarray:
    """The load of a side without the acceleration of its shaft, (n,)."""
    load = model.coefficients[f"{side}_load"]
    shaft = windows.shaft_speed[side]
    of_propeller = _load_of_propeller(model, windows, side)
    return np.maximum(load[0] + load[1] * shaft + of_propeller, 1e-6)


def _of_propeller(
    model: RelationModel, windows: Windows, side: str, change: Change
) -> dict[str, list[Direction]]:
    """Directions of the faults that load or unload a side's shaft."""
    push = model.coefficients[PUSH]
    load = model.coefficients[f"{side}_load"]
    shaft = windows.shaft_speed[side]
    predicted = _predicted_load(model, windows, side)
    thrust = push[0] * shaft**2 - push[1] * shaft * windows.speed
    thrust = thrust / _drag(model, windows)
    without_friction = np.clip(1.0 - load[0] / predicted, LEAST_OF_PROPELLER, 1.0)
    load_name = f"{side}_load"
    lost = [change(**{load_name: -without_friction, PUSH: -q * thrust}) for q in THRUST_BY_TORQUE]
    bound = [change(**{load_name: 1.0, PUSH: -q * thrust}) for q in (0.0, FRICTION_THRUST)]
    return {
        f"seal_friction:{side}": [Direction(one) for one in bound],
        f"propeller_damage:{side}": [Direction(one, 0.0, WORST_DAMAGE) for one in lost],
        f"propeller_loss:{side}": [Direction(one, WORST_DAMAGE, 1.3) for one in lost],
    }


def _of_motor(
    model: RelationModel, windows: Windows, side: str, change: Change
) -> dict[str, list[Direction]]:
    """Directions of a hot motor and of a side's sensors."""
    push = model.coefficients[PUSH]
    load = model.coefficients[f"{side}_load"]
    shaft = windows.shaft_speed[side]
    of_propeller = _load_of_propeller(model, windows, side)
    by_shaft = load[1] * shaft + load[2] * shaft**2 + of_propeller
    thrust_by_shaft = 2.0 * push[0] * shaft**2 - push[1] * shaft * windows.speed
    thrust_by_shaft = thrust_by_shaft / _drag(model, windows)
    voltage, sign = _voltage_residual(model.layout.residuals, side)
    of_voltage = model.coefficients[f"{side}_voltage"]
    measured = np.maximum(windows.values[f"{side}_voltage"], 1e-6)
    by_current = sign * of_voltage[2] * windows.values[f"{side}_load"] / measured
    back_emf = sign * of_voltage[1] * shaft / measured
    overheating = CATALOGUE[f"motor_overheating:{side}"].scale
    of_constant = overheating[f"{side}_torque_constant"]
    of_resistance = overheating[f"{side}_resistance"]
    hot_load = 1.0 / of_constant - 1.0
    hot = (of_constant - 1.0) * back_emf + (of_resistance - 1.0) * by_current
    load_name = f"{side}_load"
    by_rpm = {
        load_name: -by_shaft / _predicted_load(model, windows, side),
        voltage: -back_emf,
        PUSH: -thrust_by_shaft,
    }
    log_prior = _log_prior_of_voltage(model, windows, side)
    return {
        f"motor_overheating:{side}": [Direction(change(**{load_name: hot_load, voltage: hot}))],
        f"sensor:{side}_current": _both(change(**{load_name: 1.0, voltage: -by_current})),
        f"sensor:{side}_voltage": [
            one._replace(log_prior=log_prior) for one in _both(change(**{voltage: 1.0}))
        ],
        f"sensor:{side}_rpm": _both(change(**by_rpm)),
    }


def _voltage_residual(names: tuple[str, ...], side: str) -> tuple[str, float]:
    """The residual that a side's voltage is in, and with which sign."""
    if BALANCE not in names:
        return f"{side}_voltage", 1.0
    return BALANCE, 1.0 if side == SIDES[0] else -1.0


def _log_prior_of_voltage(model: RelationModel, windows: Windows, side: str) -> float | np.ndarray:
    """How well the other voltage fits its own relation, if only this one is wrong, (n,)."""
    if BALANCE not in model.layout.residuals:
        return 0.0
    other = SIDES[1 - SIDES.index(side)]
    residual, predicted = residual_of(f"{other}_voltage", model.coefficients, windows)
    error = residual / np.maximum(np.abs(predicted), LEAST_SIZE)
    return -0.5 * (AT_LIMIT * error / TOLERANCE["voltage"]) ** 2


def _both(change: np.ndarray) -> list[Direction]:
    """The direction of a sensor that reads too much or too little."""
    return [Direction(change), Direction(-change)]


def _without_shaft_speed(model: RelationModel, change: Change) -> dict[str, list[Direction]]:
    """Directions where current and voltage are predicted from the speed alone.

    The voltage stands for the shaft speed n. At a given speed, thrust T takes n ~ T^0.3 and current
    ~ T; a propeller that loses thrust and torque alike turns faster at about the same torque; the
    current by friction needs little voltage; readings of the speed that are too low by a factor
    look like a drag beyond that of any hull.
    """
    found: dict[str, list[Direction]] = {}

    def all_sides(load: float, voltage: float) -> np.ndarray:
        loads = {f"{side}_load": load for side in model.layout.sides}
        voltages = {f"{side}_voltage": voltage for side in model.layout.sides}
        return change(**loads | voltages)

    found["increased_drag"] = [Direction(all_sides(1.0, 0.3), 0.0, 1.1)]
    found["decreased_drag"] = [Direction(all_sides(-1.0, -0.3), 0.0, 0.6)]
    found["sensor:speed"] = [
        Direction(all_sides(1.0, 0.28), 1.2),
        Direction(all_sides(1.0, 0.22), 3.0),
        Direction(all_sides(-1.0, -0.3), 0.0, 1.0),
    ]
    for side in model.layout.sides:

        def one_side(load: float, voltage: float, side: str = side) -> np.ndarray:
            return change(**{f"{side}_load": load, f"{side}_voltage": voltage})

        found |= {
            f"seal_friction:{side}": [Direction(one_side(1.0, 0.14))],
            f"propeller_damage:{side}": [
                Direction(one_side(load, 0.5), 0.0, 1.0) for load in (0.3, 0.6)
            ],
            f"propeller_loss:{side}": [
                Direction(one_side(load, 1.0), 0.8) for load in (-0.1, 0.3, 0.5)
            ],
        }
    return found


def log_likelihood(
    found: Mapping[str, list[Direction]], standardised: Standardised
) -> dict[str, np.ndarray]:
    """Log likelihood (n,) of every class for the residuals of the windows, up to a constant.

    The amplitude of each fault is the likeliest one. A limit counts as `AT_LIMIT` standard
    deviations.
    """
    options = [direction for of_class in found.values() for direction in of_class]
    least = np.array([direction.least for direction in options])[:, None]
    most = np.array([direction.most for direction in options])[:, None]
    scale = AT_LIMIT / standardised.limit
    measured = standardised.residual * scale
    unit = np.stack([direction.change for direction in options]) * standardised.per_size * scale
    squared = np.maximum(np.sum(unit**2, axis=-1), 1e-9)
    amplitude = np.clip(np.sum(measured * unit, axis=-1) / squared, least, most)
    explained = amplitude[:, :, None] * unit
    variance = 1.0 + (INEXACT * explained) ** 2 + (INEXACT_RESIDUAL * measured) ** 2
    likelihood = -0.5 * np.sum((measured - explained) ** 2 / variance, axis=-1)
    likelihood += np.stack(
        [np.broadcast_to(direction.log_prior, likelihood.shape[1]) for direction in options]
    )
    first = np.cumsum([0, *map(len, found.values())])[:-1]
    return dict(zip(found, np.maximum.reduceat(likelihood, first), strict=True))
