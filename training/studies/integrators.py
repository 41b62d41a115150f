"""Error against cost of the integration schemes of the plant, as a table: ``python -m training.studies.integrators``.

The error is the worst over free-running trajectories under hard voltage jumps, healthy and faulty,
at the sample times, relative to max(|x|, 0.05 m/s, 1 rad/s), against DOP853 with relative tolerance
1e-11. The cost is that of one lane and sample in a batch of 512 lanes on one thread.
`physics.SUBSTEPS` and the grading of `physics.SUBSTEP` rest on it.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.integrate import solve_ivp
from tqdm import tqdm

from auv_fault_env import physics
from auv_fault_env.compiling import OPTIONS, scalar
from auv_fault_env.faults import CATALOGUE, fault_effect
from auv_fault_env.parameters import PARAMETERS, PRESETS, SAMPLE_TIME, SIDES, Vehicle, nominal
from auv_fault_env.physics import Motion, Motor, Shaft, plant_constants
from training.studies.run import command_line

PLANT_FAULTS = [
    name for name, fault in CATALOGUE.items() if not fault.component.startswith("sensor")
]
FLOOR = np.array([0.05, 1.0, 1.0])  # m/s, rad/s: errors are relative to no less than this
LANES = 512
GRADINGS = (1.0, 1.5, 1.75, 2.0)


@dataclass(frozen=True)
class Args:
    """Print a table of error against cost for the integration schemes of the plant."""

    seed: int = 0
    """Seed of voltages, disturbances and vehicles."""
    repeats: int = 5
    """Timings per scheme, of which the median counts."""
    samples: int = 150
    """Samples of 0.1 s per trajectory."""
    vehicles: int = 64
    """Trajectories: healthy and every plant fault at severity 1, filled up with random compound faults."""


class Problem(NamedTuple):
    """Trajectories to follow: motor coefficients (n_samples, 2, 5, n), drag and disturbance (n_samples, n)."""

    motors: np.ndarray
    drag: np.ndarray
    disturbance: np.ndarray


class Scheme(NamedTuple):
    """A way to advance one substep, and the lengths [s] of a sample's substeps."""

    name: str
    step: Callable
    lengths: np.ndarray
    grading: str = ""


def graded(substeps: int, grading: float = 1.0) -> np.ndarray:
    """Substeps of one sample [s], equal for grading 1, else the shorter the earlier."""
    return SAMPLE_TIME * np.diff((np.arange(substeps + 1) / substeps) ** grading)


def faulty_parameters(healthy: dict[str, float], severities: dict[str, float]) -> dict[str, float]:
    """The parameters under plant faults of given severities."""
    parameters = dict(healthy)
    for name, severity in severities.items():
        fault = CATALOGUE[name]
        for key in (*fault.scale, *fault.offset):
            scale = fault.scale.get(key, 1.0)
            factor, shift = fault_effect(severity, scale, fault.offset.get(key, 0.0))
            parameters[key] = parameters[key] * factor + shift
    return parameters


def random_compound(vehicle: Vehicle, rng: np.random.Generator) -> dict[str, float]:
    """A vehicle of the healthy band with up to four faults of random severity."""
    names = rng.choice(PLANT_FAULTS, rng.integers(0, 5), replace=False)
    healthy = {
        key: value * (1 + PARAMETERS[key].band * rng.uniform(-1, 1))
        for key, value in nominal(vehicle).items()
    }
    return faulty_parameters(healthy, {str(name): rng.uniform() for name in names})


def fleet_of(n: int, rng: np.random.Generator) -> Iterator[tuple[Vehicle, dict[str, float]]]:
    """n vehicles: both presets healthy and under every plant fault at severity 1, then random compounds."""
    presets = list(PRESETS.values())
    cases = [{}, *({name: 1.0} for name in PLANT_FAULTS)]
    for k in range(n):
        vehicle = presets[k % 2]
        case = k // 2
        fixed = case < len(cases)
        yield (
            vehicle,
            faulty_parameters(nominal(vehicle), cases[case])
            if fixed
            else random_compound(vehicle, rng),
        )


def voltages(n_samples: int, rng: np.random.Generator) -> np.ndarray:
    """Segments of full, hardly any and random voltage (n_samples,): the shaft starts, races and nearly stops."""
    limits = ((24.0, 24.0), (0.0, 0.0), (0.0, 0.4), (0.0, 24.0))
    segments = [
        np.full(rng.integers(1, 10), rng.uniform(*limits[rng.choice(4)])) for _ in range(n_samples)
    ]
    return np.concatenate(segments)[:n_samples]


def problem_of(args: Args) -> Problem:
    """The trajectories' coefficients, sample by sample."""
    rng = np.random.default_rng(args.seed)
    n = args.vehicles
    motors = np.empty((args.samples, 2, 5, n))
    drag = np.empty((args.samples, n))
    for k, (vehicle, values) in enumerate(fleet_of(n, rng)):
        constants = plant_constants(vehicle)
        drag[:, k] = values["alpha"] + values["gamma"] * rng.uniform(0.0, 0.32, args.samples)
        for side, name in enumerate(SIDES):
            shaft = Shaft(*(values[f"{name}_{parameter}"] for parameter in Shaft._fields))
            motors[:, side, :, k] = [
                physics.motor(shaft, constants, v) for v in voltages(args.samples, rng)
            ]
    return Problem(motors, drag, 0.002 * rng.standard_normal((args.samples, n)))


@njit(**OPTIONS)
def derivative(_time, state, drag, disturbance, port, starboard):
    """`physics.rates` on arrays, for scipy."""
    motion = Motion(state[0], state[1], state[2], 0.0, 0.0)
    got = physics.rates(motion, drag, disturbance, port, starboard)
    return np.array([got.speed, got.port_shaft_speed, got.starboard_shaft_speed])


def exact(problem: Problem, lane: int) -> np.ndarray:
    """Speed and both shaft speeds of one lane at the sample times (n_samples, 3), by DOP853, from rest."""
    state = np.zeros(3)
    states = []
    for motors, drag, disturbance in zip(
        problem.motors, problem.drag, problem.disturbance, strict=True
    ):
        sides = [Motor(*side) for side in motors[:, :, lane].tolist()]
        given = dict(args=(drag[lane], disturbance[lane], *sides), rtol=1e-11, atol=1e-12)
        state = solve_ivp(derivative, (0.0, SAMPLE_TIME), state, "DOP853", **given).y[:, -1]
        states.append(state)
    return np.array(states)


@scalar
def moved(motion, slope, time):
    """The motion after `time` at a constant slope; the shafts do not reverse."""
    return Motion(
        motion.speed + time * slope.speed,
        max(motion.port_shaft_speed + time * slope.port_shaft_speed, 0.0),
        max(motion.starboard_shaft_speed + time * slope.starboard_shaft_speed, 0.0),
        motion.port_angle + time * slope.port_angle,
        motion.starboard_angle + time * slope.starboard_angle,
    )


@scalar
def runge_kutta(motion, drag, disturbance, port, starboard, time):
    """The classical method of order 4."""
    a = physics.rates(motion, drag, disturbance, port, starboard)
    b = physics.rates(moved(motion, a, 0.5 * time), drag, disturbance, port, starboard)
    c = physics.rates(moved(motion, b, 0.5 * time), drag, disturbance, port, starboard)
    d = physics.rates(moved(motion, c, time), drag, disturbance, port, starboard)
    motion = moved(moved(motion, a, time / 6.0), b, time / 3.0)
    return moved(moved(motion, c, time / 3.0), d, time / 6.0)


@scalar
def frozen_speed(motion, drag, disturbance, port, starboard, time):
    """Closed-form shafts at a constant surge speed, its predicted mean; Simpson's rule for the speed and the angles."""
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
    """A loop over samples, substeps and lanes around one scheme, as the fleet's; fills out (n_samples, 3, n)."""

    @njit(**OPTIONS)
    def run(problem, lengths, state, out):
        for sample in range(out.shape[0]):
            motors = problem.motors[sample]
            drag = problem.drag[sample]
            push = problem.disturbance[sample]
            for length in lengths:
                for k in range(state.shape[1]):
                    port = Motor(
                        motors[0, 0, k],
                        motors[0, 1, k],
                        motors[0, 2, k],
                        motors[0, 3, k],
                        motors[0, 4, k],
                    )
                    star = Motor(
                        motors[1, 0, k],
                        motors[1, 1, k],
                        motors[1, 2, k],
                        motors[1, 3, k],
                        motors[1, 4, k],
                    )
                    motion = Motion(state[0, k], state[1, k], state[2, k], state[3, k], state[4, k])
                    motion = step(motion, drag[k], push[k], port, star, length)
                    state[0, k] = motion.speed
                    state[1, k] = motion.port_shaft_speed
                    state[2, k] = motion.starboard_shaft_speed
                    state[3, k] = motion.port_angle
                    state[4, k] = motion.starboard_angle
            out[sample] = state[:3]

    return run


def in_use() -> Scheme:
    """What the plant uses."""
    return Scheme("in use", physics.substep, np.array(physics.SUBSTEP))


def schemes() -> list[Scheme]:
    """Everything tried."""
    coarse = (5, 10, 20, 40)
    return [
        *(Scheme("RK4", runge_kutta, graded(n)) for n in coarse),
        *(Scheme("frozen speed", frozen_speed, graded(n)) for n in coarse),
        *(
            Scheme("closed form", physics.substep, graded(n, g), f"{g}")
            for n in range(2, 13)
            for g in GRADINGS
        ),
    ]


def tiled(problem: Problem) -> Problem:
    """The problem repeated to fill `LANES` lanes."""
    times = -(-LANES // problem.drag.shape[1])
    return Problem(*(np.ascontiguousarray(np.tile(part, times)[..., :LANES]) for part in problem))


def seconds(run: Callable, problem: Problem, lengths: np.ndarray) -> float:
    """Time of one run per lane and sample."""
    n_samples, n = problem.drag.shape
    state = np.zeros((5, n))
    out = np.empty((n_samples, 3, n))
    start = perf_counter()
    run(problem, lengths, state, out)
    return (perf_counter() - start) / (n_samples * n)


def worst(run: Callable, problem: Problem, lengths: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Worst error of speed and shaft speed (2,)."""
    out = np.empty(truth.shape)
    run(problem, lengths, np.zeros((5, truth.shape[2])), out)
    error = np.max(np.abs(out - truth) / np.maximum(np.abs(truth), FLOOR[:, None]), axis=(0, 2))
    return np.array([error[0], max(error[1:])])


def table(args: Args) -> list[dict]:
    """One row per scheme: name, substeps, grading, worst errors of speed and shaft speed, cost [ns], ratio of costs.

    Every repeat times all schemes in turn, so that load on the machine hits all alike. The ratio is
    that to the scheme in use, the median of the ratios within each repeat.
    """
    problem = problem_of(args)
    everything = [in_use(), *schemes()]
    truth = np.stack(
        [exact(problem, lane) for lane in tqdm(range(args.vehicles), "reference", leave=False)],
        axis=2,
    )
    runs = {step: compiled(step) for step in (runge_kutta, frozen_speed, physics.substep)}
    errors = [worst(runs[scheme.step], problem, scheme.lengths, truth) for scheme in everything]
    wide = tiled(problem)
    laps = tqdm(range(args.repeats), "repeats", leave=False)
    costs = np.array(
        [[seconds(runs[one.step], wide, one.lengths) for one in everything] for _ in laps]
    )
    columns = zip(
        errors, np.median(costs, axis=0), np.median(costs / costs[:, :1], axis=0), strict=True
    )
    return [
        dict(name=scheme.name, substeps=len(scheme.lengths), grading=scheme.grading)
        | dict(speed=error[0], shaft=error[1], nanoseconds=1e9 * cost, ratio=ratio)
        for scheme, (error, cost, ratio) in zip(everything, columns, strict=True)
    ]


def main(args: Args) -> None:
    """Print the table."""
    print("scheme        substeps  grading    speed    shaft       ns  ratio")
    line = "{name:14}{substeps:8}{grading:>9}{speed:9.1e}{shaft:9.1e}{nanoseconds:9.1f}{ratio:7.2f}"
    for row in table(args):
        print(line.format(**row))


if __name__ == "__main__":
    command_line(main)
