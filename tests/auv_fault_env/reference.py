"""An independent solution of the plant's equations: written from the thesis, calls nothing of
`physics`.

Voltages, angles and disturbance are constant over each sample; scipy's DOP853 runs between events,
an event being a shaft that stops. A stopped shaft stays until the motor's torque exceeds the
Coulomb friction.
"""

from collections.abc import Callable, Mapping
from math import pi
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from auv_fault_env.faults import CATALOGUE
from auv_fault_env.parameters import PARAMETERS, SHAFT, SIDES, Vehicle

SAMPLE = 0.1  # s
FULL = 24.0  # V
# m/s, rad/s, rad: errors are relative to no less than this
FLOOR = np.array([0.05, 1.0, 1.0, 0.1, 0.1])
PLANT_FAULTS = [
    name for name, fault in CATALOGUE.items() if not fault.component.startswith("sensor")
]


class Inputs(NamedTuple):
    """What acts on the vehicle during each sample, all (n_samples,)."""

    port: np.ndarray  # V
    starboard: np.ndarray  # V
    rudder: np.ndarray  # rad
    plane: np.ndarray  # rad
    disturbance: np.ndarray  # m/s^2


def stepwise_voltage(rng: np.random.Generator, n_samples: int) -> np.ndarray:
    """A voltage sequence of segments: nothing, everything, anything, or about what breaks the shaft
    away.
    """
    levels = lambda: [0.0, FULL, rng.uniform(0, FULL), rng.uniform(0, 1.0)]  # noqa: E731
    segments = [np.full(rng.integers(1, 12), levels()[rng.integers(4)]) for _ in range(n_samples)]
    return np.concatenate(segments)[:n_samples]


def random_inputs(seed: int, n_samples: int) -> Inputs:
    """From rest to full speed, through jumps, and back to standing shafts."""
    rng = np.random.default_rng(seed)
    voltages = [stepwise_voltage(rng, n_samples) for _ in SIDES]
    for voltage in voltages:
        voltage[: n_samples // 4] = FULL
        voltage[-n_samples // 8 :] = 0.0
    angles = 0.4 * rng.uniform(-1, 1, (2, n_samples))
    return Inputs(*voltages, *angles, 0.002 * rng.standard_normal(n_samples))


def faulted(healthy: Mapping[str, float], severity: Mapping[str, float]) -> dict[str, float]:
    """The parameters under faults of given severities."""
    values = dict(healthy)
    for name, s in severity.items():
        for parameter, factor in CATALOGUE[name].scale.items():
            values[parameter] *= 1 + s * (factor - 1)
    for name, s in severity.items():
        for parameter, shift in CATALOGUE[name].offset.items():
            values[parameter] += s * shift
    return values


def within_band(healthy: Mapping[str, float], rng: np.random.Generator) -> dict[str, float]:
    """A random healthy vehicle."""
    return {
        name: value * (1 + PARAMETERS[name].band * rng.uniform(-1, 1))
        for name, value in healthy.items()
    }


def shaft(
    vehicle: Vehicle, parameters: Mapping[str, float], side: str
) -> tuple[Callable, Callable, float]:
    """Of one shaft: dw/dt of (u, w, V), whether V breaks it away, and its thrust per (rev/s)^2."""
    beta, c1, c2, resistance, flux, coulomb, viscous, inertia = (
        parameters[f"{side}_{name}"] for name in SHAFT
    )
    rho = vehicle.density
    diameter = vehicle.diameter
    wake = vehicle.wake_fraction

    def rate(u, w, voltage):
        n = w / (2 * pi)
        current = (voltage - flux * w) / resistance
        propeller = rho * diameter**5 * (c1 * n**2 - c2 * n * u * (1 - wake) / diameter)
        return (flux * current - propeller - viscous * w - coulomb) / inertia

    return rate, lambda voltage: flux * voltage / resistance > coulomb, beta * 60**2 / (2 * pi) ** 2


def stop(index: int) -> Callable:
    """The event of a shaft coming to rest."""
    event = lambda t, y: y[index]  # noqa: E731
    event.terminal = True
    event.direction = -1
    return event


def sample(
    state: np.ndarray, hull: Callable, shafts: list, voltages: tuple, rtol: float
) -> np.ndarray:
    """The state (u, two w, two angles) one sample later."""
    state = np.array(state)
    time = 0.0
    while time < SAMPLE:
        moving = [state[1 + k] > 0 or shafts[k][1](voltages[k]) for k in range(2)]

        def rates(t, y, moving=moving):
            u, *w = y[:3].tolist()
            shaft_accelerations = [
                shafts[k][0](u, w[k], voltages[k]) if moving[k] else 0.0 for k in range(2)
            ]
            return [
                hull(u) + shafts[0][2] * w[0] ** 2 + shafts[1][2] * w[1] ** 2,
                *shaft_accelerations,
                *w,
            ]

        events = [stop(1 + k) for k in range(2) if moving[k]]
        solution = solve_ivp(
            rates, (time, SAMPLE), state, "DOP853", rtol=rtol, atol=0.1 * rtol, events=events
        )
        state = solution.y[:, -1]
        time = solution.t[-1]
        for index, times in zip(np.flatnonzero(moving), solution.t_events, strict=True):
            state[1 + index] = 0.0 if len(times) else max(state[1 + index], 0.0)
    return state


def solve(
    vehicle: Vehicle, parameters: Mapping[str, float], inputs: Inputs, rtol: float = 1e-11
) -> np.ndarray:
    """Surge speed, shaft speeds and the angles turned in each sample, (n_samples, 5), from rest."""
    shafts = [shaft(vehicle, parameters, side) for side in SIDES]
    state = np.zeros(5)
    states = []
    for port, starboard, rudder, plane, disturbance in zip(
        *(row.tolist() for row in inputs), strict=True
    ):
        drag = parameters["alpha"] + parameters["gamma"] * (rudder**2 + plane**2)
        hull = lambda u, drag=drag, push=disturbance: drag * u * abs(u) + push  # noqa: E731
        state[3:] = 0.0
        state = sample(state, hull, shafts, (port, starboard), rtol)
        states.append(state.copy())
    return np.array(states)


def error(simulated: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """The worst error of each state (5,), relative to max(|x|, 0.05 m/s, 1 rad/s, 0.1 rad)."""
    return np.max(np.abs(simulated - exact) / np.maximum(np.abs(exact), FLOOR), axis=0)
