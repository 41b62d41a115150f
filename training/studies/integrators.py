"""Error and cost of integration schemes for the plant.

``python -m training.studies.integrators`` prints a table. The error is the largest at the sample
times over trajectories under hard voltage steps, healthy and faulty, relative to max(|x|, 0.05 m/s,
1 rad/s), against DOP853 with a relative tolerance of 1e-11. The cost is that of one lane and sample
in a batch of 512 lanes on one thread. `physics.SUBSTEPS` and the grading of `physics.SUBSTEP` rest
on this table.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from scipy.integrate import solve_ivp
from tqdm import tqdm

from auv_fault_env import physics
from auv_fault_env.compiling import OPTIONS, scalar
from auv_fault_env.errors import whole_number
from auv_fault_env.faults import CATALOGUE, fault_effect
from auv_fault_env.parameters import PARAMETERS, PRESETS, SAMPLE_TIME, SIDES, Vehicle, nominal
from auv_fault_env.physics import Motion, Motor, Shaft, plant_constants
from training.studies.run import command_line

PLANT_FAULTS = [
    name for name, fault in CATALOGUE.items() if not fault.component.startswith("sensor")
]
# m/s and rad/s; errors are relative to at least this
FLOOR = np.array([0.05, 1.0, 1.0])
LANES = 512
GRADINGS = (1.0, 1.5, 1.75, 2.0)
COARSE_SUBSTEPS = (5, 10, 20, 40)
# ranges of the random voltage segments [V]: full, zero, nearly zero, any
VOLTAGE_RANGES = ((24.0, 24.0), (0.0, 0.0), (0.0, 0.4), (0.0, 24.0))


@dataclass(frozen=True)
class Integrators:
    """Print error and cost of the integration schemes for the plant."""

    seed: int = 0
    """Seed of voltages, disturbances and vehicles."""
    repeats: int = 5
    """Timings per scheme, of which the median counts."""
    samples: int = 150
    """Samples of 0.1 s per trajectory."""
    vehicles: int = 64
    """Trajectories: healthy, every plant fault at severity 1, then random faults together."""


class Problem(NamedTuple):
    """Trajectories to integrate.

    Attributes
    ----------
    motors
        Coefficients of both motors, (n_samples, 2, 5, n_lanes).
    drag, disturbance
        (n_samples, n_lanes).
    """

    motors: np.ndarray
    drag: np.ndarray
    disturbance: np.ndarray


class Scheme(NamedTuple):
    """An integration scheme.

    Attributes
    ----------
    name
        Name in the table.
    step
        Compiled function that advances a motion by one substep.
    lengths
        Lengths of the substeps of one sample [s].
    grading
        Grading in the table.
    """

    name: str
    step: Callable
    lengths: np.ndarray
    grading: str = ""


def substep_lengths(substeps: int, grading: float = 1.0) -> np.ndarray:
    """Substeps of one sample [s]: equal for grading 1, growing for a larger one."""
    return SAMPLE_TIME * np.diff((np.arange(substeps + 1) / substeps) ** grading)


def faulty_parameters(healthy: dict[str, float], severities: dict[str, float]) -> dict[str, float]:
    """The parameters under plant faults of given severities."""
    parameters = dict(healthy)
    for name, severity in severities.items():
        fault = CATALOGUE[name]
        for key in fault.scale | fault.offset:
            scale = fault.scale.get(key, 1.0)
            factor, shift = fault_effect(severity, scale, fault.offset.get(key, 0.0))
            parameters[key] = parameters[key] * factor + shift
    return parameters


def random_parameters(vehicle: Vehicle, random: np.random.Generator) -> dict[str, float]:
    """Parameters in the healthy band, with up to four faults of random severity."""
    names = random.choice(PLANT_FAULTS, random.integers(0, 5), replace=False)
    healthy = {
        key: value * (1 + PARAMETERS[key].band * random.uniform(-1, 1))
        for key, value in nominal(vehicle).items()
    }
    return faulty_parameters(healthy, {str(name): random.uniform() for name in names})


def vehicles_and_parameters(
    n: int, random: np.random.Generator
) -> Iterator[tuple[Vehicle, dict[str, float]]]:
    """Both presets in turn: healthy, with every plant fault at severity 1, then at random."""
    presets = list(PRESETS.values())
    cases = [{}, *({name: 1.0} for name in PLANT_FAULTS)]
    for k in range(n):
        vehicle = presets[k % 2]
        case = k // 2
        if case < len(cases):
            yield vehicle, faulty_parameters(nominal(vehicle), cases[case])
        else:
            yield vehicle, random_parameters(vehicle, random)


def random_voltages(n_samples: int, random: np.random.Generator) -> np.ndarray:
    """Segments of constant voltage, (n_samples,): the shaft starts, races and nearly stops."""
    segments = []
    for _ in range(n_samples):
        length = random.integers(1, 10)
        limits = VOLTAGE_RANGES[random.choice(4)]
        segments.append(np.full(length, random.uniform(*limits)))
    return np.concatenate(segments)[:n_samples]


def random_problem(arguments: Integrators) -> Problem:
    """Random trajectories."""
    random = np.random.default_rng(arguments.seed)
    n_samples = arguments.samples
    n_lanes = arguments.vehicles
    motors = np.empty((n_samples, 2, 5, n_lanes))
    drag = np.empty((n_samples, n_lanes))
    for lane, (vehicle, values) in enumerate(vehicles_and_parameters(n_lanes, random)):
        constants = plant_constants(vehicle)
        squared_deflection = random.uniform(0.0, 0.32, n_samples)
        drag[:, lane] = values["alpha"] + values["gamma"] * squared_deflection
        for side, name in enumerate(SIDES):
            shaft = Shaft(*(values[f"{name}_{parameter}"] for parameter in Shaft._fields))
            voltages = random_voltages(n_samples, random)
            motors[:, side, :, lane] = [physics.motor(shaft, constants, v) for v in voltages]
    return Problem(motors, drag, 0.002 * random.standard_normal((n_samples, n_lanes)))


@njit(**OPTIONS)
def derivative(_time, state, drag, disturbance, port, starboard):
    """`physics.rates` on arrays, for scipy."""
    motion = Motion(state[0], state[1], state[2], 0.0, 0.0)
    slope = physics.rates(motion, drag, disturbance, port, starboard)
    return np.array([slope.speed, slope.port_shaft_speed, slope.starboard_shaft_speed])


def exact_trajectory(problem: Problem, lane: int) -> np.ndarray:
    """Speed and both shaft speeds of one lane at the sample times, (n_samples, 3), by DOP853."""
    state = np.zeros(3)
    states = []
    for motors, drag, disturbance in zip(*problem, strict=True):
        sides = [Motor(*side) for side in motors[:, :, lane].tolist()]
        solution = solve_ivp(
            derivative,
            (0.0, SAMPLE_TIME),
            state,
            "DOP853",
            args=(drag[lane], disturbance[lane], *sides),
            rtol=1e-11,
            atol=1e-12,
        )
        state = solution.y[:, -1]
        states.append(state)
    return np.array(states)


@scalar
def moved(motion, slope, time):
    """The motion after `time` with constant slope; the shafts do not reverse."""
    return Motion(
        motion.speed + time * slope.speed,
        max(motion.port_shaft_speed + time * slope.port_shaft_speed, 0.0),
        max(motion.starboard_shaft_speed + time * slope.starboard_shaft_speed, 0.0),
        motion.port_angle + time * slope.port_angle,
        motion.starboard_angle + time * slope.starboard_angle,
    )


@scalar
def runge_kutta(motion, drag, disturbance, port, starboard, time):
    """The classical Runge-Kutta method of order 4."""
    a = physics.rates(motion, drag, disturbance, port, starboard)
    b = physics.rates(moved(motion, a, 0.5 * time), drag, disturbance, port, starboard)
    c = physics.rates(moved(motion, b, 0.5 * time), drag, disturbance, port, starboard)
    d = physics.rates(moved(motion, c, time), drag, disturbance, port, starboard)
    motion = moved(moved(motion, a, time / 6.0), b, time / 3.0)
    return moved(moved(motion, c, time / 3.0), d, time / 6.0)


@scalar
def frozen_speed(motion, drag, disturbance, port, starboard, time):
    """Closed-form shafts at the predicted mean surge speed; Simpson's rule for speed and angles."""
    u = motion.speed
    port_0 = motion.port_shaft_speed
    starboard_0 = motion.starboard_shaft_speed
    first = physics.surge_acceleration(u, port_0, starboard_0, drag, disturbance, port, starboard)
    mean = u + 0.5 * time * first
    half = 0.5 * time
    port_1 = physics.shaft_speed_after(port_0, port, mean, 0.0, half)
    port_2 = physics.shaft_speed_after(port_0, port, mean, 0.0, time)
    starboard_1 = physics.shaft_speed_after(starboard_0, starboard, mean, 0.0, half)
    starboard_2 = physics.shaft_speed_after(starboard_0, starboard, mean, 0.0, time)
    middle = physics.surge_acceleration(
        mean, port_1, starboard_1, drag, disturbance, port, starboard
    )
    last = physics.surge_acceleration(
        u + time * middle, port_2, starboard_2, drag, disturbance, port, starboard
    )
    sixth = time / 6.0
    return Motion(
        u + sixth * (first + 4.0 * middle + last),
        port_2,
        starboard_2,
        motion.port_angle + sixth * (port_0 + 4.0 * port_1 + port_2),
        motion.starboard_angle + sixth * (starboard_0 + 4.0 * starboard_1 + starboard_2),
    )


def compiled(step: Callable) -> Callable:
    """A loop over samples, substeps and lanes as in the fleet; it fills (n_samples, 3, n_lanes)."""

    @njit(**OPTIONS)
    def run(problem, lengths, state, out):
        for sample in range(out.shape[0]):
            motors = problem.motors[sample]
            drag = problem.drag[sample]
            disturbance = problem.disturbance[sample]
            for length in lengths:
                for k in range(state.shape[1]):
                    port = Motor(
                        motors[0, 0, k],
                        motors[0, 1, k],
                        motors[0, 2, k],
                        motors[0, 3, k],
                        motors[0, 4, k],
                    )
                    starboard = Motor(
                        motors[1, 0, k],
                        motors[1, 1, k],
                        motors[1, 2, k],
                        motors[1, 3, k],
                        motors[1, 4, k],
                    )
                    motion = Motion(state[0, k], state[1, k], state[2, k], state[3, k], state[4, k])
                    motion = step(motion, drag[k], disturbance[k], port, starboard, length)
                    state[0, k] = motion.speed
                    state[1, k] = motion.port_shaft_speed
                    state[2, k] = motion.starboard_shaft_speed
                    state[3, k] = motion.port_angle
                    state[4, k] = motion.starboard_angle
            out[sample] = state[:3]

    return run


def current_scheme() -> Scheme:
    """The scheme of the plant."""
    return Scheme("in use", physics.substep, np.array(physics.SUBSTEP))


def alternative_schemes() -> list[Scheme]:
    """All other schemes of the table."""
    runge_kutta_schemes = [Scheme("RK4", runge_kutta, substep_lengths(n)) for n in COARSE_SUBSTEPS]
    frozen_speed_schemes = [
        Scheme("frozen speed", frozen_speed, substep_lengths(n)) for n in COARSE_SUBSTEPS
    ]
    closed_form_schemes = [
        Scheme("closed form", physics.substep, substep_lengths(n, grading), f"{grading}")
        for n in range(2, 13)
        for grading in GRADINGS
    ]
    return [*runge_kutta_schemes, *frozen_speed_schemes, *closed_form_schemes]


def tile_lanes(problem: Problem) -> Problem:
    """The problem repeated to fill `LANES` lanes."""
    times = -(-LANES // problem.drag.shape[1])
    tiled = (np.tile(values, times)[..., :LANES] for values in problem)
    return Problem(*map(np.ascontiguousarray, tiled))


def cost(run: Callable, problem: Problem, lengths: np.ndarray) -> float:
    """Time of one run per lane and sample [s]."""
    n_samples, n_lanes = problem.drag.shape
    state = np.zeros((5, n_lanes))
    out = np.empty((n_samples, 3, n_lanes))
    start = perf_counter()
    run(problem, lengths, state, out)
    return (perf_counter() - start) / (n_samples * n_lanes)


def largest_errors(
    run: Callable, problem: Problem, lengths: np.ndarray, exact: np.ndarray
) -> np.ndarray:
    """Largest relative errors of speed and shaft speed, (2,)."""
    out = np.empty(exact.shape)
    run(problem, lengths, np.zeros((5, exact.shape[2])), out)
    scale = np.maximum(np.abs(exact), FLOOR[:, None])
    errors = np.max(np.abs(out - exact) / scale, axis=(0, 2))
    return np.array([errors[0], max(errors[1:])])


def table(arguments: Integrators) -> list[dict[str, Any]]:
    """One row per scheme, the current one first.

    Every repeat times all schemes in turn, so that other load affects all alike.

    Returns
    -------
    rows
        name, substeps, grading, speed, shaft (largest errors), nanoseconds (cost), ratio: of the
        costs to that of the current scheme, the median of the ratios within each repeat.
    """
    problem = random_problem(arguments)
    schemes = [current_scheme(), *alternative_schemes()]
    lanes = tqdm(range(arguments.vehicles), "reference", leave=False)
    exact = np.stack([exact_trajectory(problem, lane) for lane in lanes], axis=2)
    runs = {step: compiled(step) for step in (runge_kutta, frozen_speed, physics.substep)}
    errors = [largest_errors(runs[one.step], problem, one.lengths, exact) for one in schemes]
    wide = tile_lanes(problem)
    repeats = tqdm(range(arguments.repeats), "repeats", leave=False)
    costs = np.array(
        [[cost(runs[one.step], wide, one.lengths) for one in schemes] for _ in repeats]
    )
    median_costs = np.median(costs, axis=0)
    ratios = np.median(costs / costs[:, :1], axis=0)
    return [
        {
            "name": scheme.name,
            "substeps": len(scheme.lengths),
            "grading": scheme.grading,
            "speed": errors[k][0],
            "shaft": errors[k][1],
            "nanoseconds": 1e9 * median_costs[k],
            "ratio": ratios[k],
        }
        for k, scheme in enumerate(schemes)
    ]


def main(arguments: Integrators) -> None:
    """Print the table."""
    whole_number("repeats", arguments.repeats)
    whole_number("samples", arguments.samples)
    whole_number("vehicles", arguments.vehicles)
    print("scheme        substeps  grading    speed    shaft       ns  ratio")
    line = "{name:14}{substeps:8}{grading:>9}{speed:9.1e}{shaft:9.1e}{nanoseconds:9.1f}{ratio:7.2f}"
    for row in table(arguments):
        print(line.format(**row))


if __name__ == "__main__":
    command_line(main)
