"""How fast the environments are, as ratios to yardsticks measured side by side, and where the time of a step goes.

    python -m training.studies.speed --output runs/speed

Every repeat measures all contenders in turn, so that load on the machine hits all alike. Rates are
medians over the repeats; a ratio is the median of the ratios within each repeat. All that a user
pays for is included: noise, controllers, faults, observations, information and resets. Ours runs
whole episodes, so every lane's reset has its natural share; the others reset whenever an episode
ends. Actions are drawn beforehand. Load from elsewhere hits the parallel batches hardest: see that
the machine is idle.
"""

import contextlib
import importlib.util
import json
import os
import platform
import shlex
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from importlib import metadata
from pathlib import Path

import gymnasium as gym
import numba
import numpy as np
import tyro
from tqdm import tqdm

from auv_fault_env import Fleet, episodes, lanes, layout
from auv_fault_env.channels import CHANNELS
from auv_fault_env.errors import refusal
from auv_fault_env.physics import PlantConstants
from auv_fault_env.truth import SingleLaneTruth

OURS = "auv_fault_env/Propulsion-v0"
GEM_MISSING = 'gym-electric-motor is not installed; its rows are left out. To have them: pip install -e ".[bench]"'
NOTES = """\
A step of gym-electric-motor is 0.1 ms of one motor; ours is 0.1 s of two motors, hull, controllers and sensors.
By default its constraints end an episode of random actions after a few steps, so that resets take much of its time.
A lane-step is one step of one lane. Both profiles are of one thread; their parts add up to the whole."""
POOL = 4  # arrays of batched actions drawn beforehand

Lap = Callable[[], int]  # runs a fixed number of lane-steps and returns it
Rates = dict[str, list[float]]  # lane-steps per second by contender, one per repeat


@dataclass(frozen=True)
class Args:
    """Measure the speed of the environments against yardsticks and profile a step."""

    seed: int = 0
    """Seed of the environments and of the actions."""
    repeats: int = 5
    """Repeats of which the medians are taken."""
    output: Path | None = None
    """Folder to write results.json into; without it nothing is written."""


@dataclass(frozen=True)
class Size:
    """How much is measured: lanes of the two batches, steps per episode, least seconds per measurement."""

    lanes: int = 4096
    many: int = 65_536
    episode: int = 600
    seconds: float = 0.3


@dataclass(frozen=True)
class Mark:
    """A contender's ratio, `over` to `under`, and its bounds; without any it is for information."""

    what: str
    over: str
    under: str
    to: str
    least: float = -np.inf
    most: float = np.inf
    target: str = ""


CART = "CartPole-v1"
FASTER = "ours over it"
COST = "cost per lane-step at {lanes}"
MARKS: dict[str, Mark] = {
    "cartpole": Mark("CartPole-v1, single", "cartpole", "cartpole", CART),
    "single": Mark("Propulsion-v0, single", "single", "cartpole", CART, least=0.4, target=">= 0.4"),
    "gem": Mark(
        "gym-electric-motor DC speed, single", "single", "gem", FASTER, least=15.0, target=">= 15"
    ),
    "gem_free": Mark("  the same without constraints", "single", "gem_free", FASTER),
    "gem_euler": Mark("  the same without constraints, Euler", "single", "gem_euler", FASTER),
    "serial": Mark(
        "Propulsion-v0, {lanes} lanes, serial",
        "serial",
        "cartpole",
        CART,
        25.0,
        target=">= 25 (aim 60)",
    ),
    "parallel": Mark(
        "Propulsion-v0, {lanes} lanes", "parallel", "cartpole", CART, 25.0, target=">= 25 (aim 60)"
    ),
    "cartpoles": Mark("CartPole-v1 hand-vectorised, {lanes} lanes", "cartpoles", "cartpole", CART),
    "many": Mark(
        "Propulsion-v0, {many} lanes", "parallel", "many", COST, most=1.2, target="<= 1.2"
    ),
}


def prepared(env, seed: int, count: int) -> tuple:
    """An environment, single or vector, in its first episode, and random actions for it."""
    env.action_space.seed(seed)
    env.reset(seed=seed)
    return env, [env.action_space.sample() for _ in range(count)]


def single_steps(env: gym.Env, actions: Sequence) -> int:
    """A step per action, and a reset whenever the episode ends."""
    for action in actions:
        _, _, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            env.reset()
    return len(actions)


def batch_steps(env: gym.vector.VectorEnv, actions: Sequence, steps: int) -> int:
    """Steps of a vector environment, its own resets among them."""
    for step in range(steps):
        env.step(actions[step % POOL])
    return steps * env.num_envs


def calls(function: Callable, lane_steps: int, times: int = 1) -> int:
    """Calls from Python, each of which stands for so many lane-steps."""
    for _ in range(times):
        function()
    return times * lane_steps


def batch_lap(name: str, n_lanes: int, seed: int, steps: int, **kwargs) -> Lap:
    """Steps of a hand-vectorised environment with random actions."""
    env = gym.make_vec(name, num_envs=n_lanes, vectorization_mode="vector_entry_point", **kwargs)
    return partial(batch_steps, *prepared(env, seed, POOL), steps)


def compiled_lap(function: Callable, arguments: tuple, lane_steps: int, times: int) -> Lap:
    """Calls from a compiled loop, so that the way from Python does not count."""

    @numba.njit
    def loop(times, arguments):
        for _ in range(times):
            function(*arguments)

    return partial(calls, partial(loop, times, arguments), times * lane_steps)


def gem_laps(seed: int) -> dict[str, Lap]:
    """gym-electric-motor's permanently excited DC motor under speed control, in three settings; nothing without it."""
    if importlib.util.find_spec("gym_electric_motor") is None:
        print(GEM_MISSING)
        return {}
    import gym_electric_motor as gem
    from gym_electric_motor.physical_systems.solvers import EulerSolver

    make = partial(gem.make, "Cont-SC-PermExDc-v0", visualization=())
    euler = make(constraints=(), ode_solver=EulerSolver())
    environments = {"gem": make(), "gem_free": make(constraints=()), "gem_euler": euler}
    return {
        name: partial(single_steps, *prepared(env, seed, 100)) for name, env in environments.items()
    }


def contenders(seed: int, size: Size) -> dict[str, Lap]:
    """Whatever is compared, ready to run; a lap of a batch of ours is a whole episode of every lane, reset included."""
    steps = size.episode + 1
    return {
        "cartpole": partial(single_steps, *prepared(gym.make("CartPole-v1"), seed, size.episode)),
        "single": partial(single_steps, *prepared(gym.make(OURS), seed, size.episode)),
        **gem_laps(seed),
        "serial": batch_lap(OURS, size.lanes, seed, steps, parallel=False),
        "parallel": batch_lap(OURS, size.lanes, seed, steps),
        "cartpoles": batch_lap("CartPole-v1", size.lanes, seed, steps // 4),
        "many": batch_lap(OURS, size.many, seed, steps),
    }


def rate(lap: Lap, seconds: float) -> float:
    """Lane-steps per second over whole laps, for at least the given time."""
    steps = 0
    start = time.perf_counter()
    while (spent := time.perf_counter() - start) < seconds or not steps:
        steps += lap()
    return steps / spent


def interleaved(laps: dict[str, Lap], repeats: int, seconds: float, about: str) -> Rates:
    """Rates of all laps, taken in turn in every repeat; a first round that does not count compiles and warms up."""
    rates: Rates = {name: [] for name in laps}
    turns = [(name, seconds * (k > 0)) for k in range(repeats + 1) for name in laps]
    for name, least in tqdm(turns, desc=about):
        rates[name].append(rate(laps[name], least))
    return {name: measured[1:] for name, measured in rates.items()}


def comparison(rates: Rates, size: Size) -> list[dict]:
    """The table's rows: what, rate [lane-steps/s], ratio, what it is a ratio to, target, whether it is met."""
    rows = []
    for name, measured in rates.items():
        mark = MARKS[name]
        ratio = statistics.median(np.divide(rates[mark.over], rates[mark.under]).tolist())
        row = {
            "what": mark.what.format(**asdict(size)),
            "rate": statistics.median(measured),
            "ratio": ratio,
        }
        row |= {"to": mark.to.format(**asdict(size)), "target": mark.target}
        rows.append(row | {"met": mark.least <= ratio <= mark.most if mark.target else None})
    return rows


def kernel_laps(fleet: Fleet) -> dict[str, Lap]:
    """The kernel called from Python and from a compiled loop; its stages, on one block in the fast caches."""
    n = fleet.n_lanes
    state = fleet.state
    limits = fleet.limits
    constants = PlantConstants(*fleet.constants.tolist())
    actions = np.full((n, 3), 0.2)
    observations = np.empty((n, len(CHANNELS)), np.float32)
    outcomes = np.empty((4, n))
    block = state.memory[0]
    width = min(n, layout.LANES)
    scratch = np.zeros(layout.N_SCRATCH * layout.LANES)
    stages = {
        lanes.write_commands: (block, width, actions, limits),
        lanes.run_controllers: (block, width, constants),
        lanes.sample_normals: (scratch, width, state.key, state.step),
        lanes.prepare_step: (block, scratch, width, constants),
        lanes.advance_motion: (block, scratch, width),
        lanes.read_sensors: (block, scratch, width, state.key, state.step, limits),
        lanes.write_outcomes: (block, width, constants),
        lanes.copy_results: (block, width, 0, observations, outcomes),
    }
    whole = (0, len(state.memory), *state, actions, limits, fleet.constants, observations, outcomes)
    times = 1 + 1000 // n
    call = partial(lanes.step_blocks, *whole)
    kernel = compiled_lap(lanes.step_blocks, whole, n, times)
    laps = {"call": partial(calls, call, n, times), "kernel": kernel}
    return laps | {
        stage.__name__: compiled_lap(stage, arguments, width, 500)
        for stage, arguments in stages.items()
    }


def refreshes(fleet: Fleet, steps: int):
    """All that `Fleet.step` does in an episode for faults that come and go and for the mission's legs."""
    fleet.state.next_update[:] = 0
    for step in range(steps):
        fleet.state.step[:] = step
        if step >= fleet.state.next_update.min():
            episodes.update_due_lanes(fleet.state, fleet.plan, fleet.catalogue)


def costs(laps: dict[str, Lap], repeats: int, seconds: float, about: str) -> dict[str, float]:
    """Median cost of each lap [ns per lane-step]."""
    return {
        name: 1e9 / statistics.median(got)
        for name, got in interleaved(laps, repeats, seconds, about).items()
    }


def batch_profile(seed: int, repeats: int, size: Size) -> dict[str, float]:
    """Where the time of the batch goes on one thread [ns per lane-step]; the parts add up to the whole."""
    n = size.lanes
    fleet = Fleet(size.lanes, parallel=False)
    fleet.reset(range(seed, seed + n))
    laps = kernel_laps(fleet)
    stages = list(laps)[2:]
    laps["refresh"] = partial(calls, partial(refreshes, fleet, size.episode), n * size.episode)
    laps["reset"] = partial(calls, fleet.reset, n * size.episode)
    laps["whole"] = batch_lap(OURS, n, seed, size.episode + 1, parallel=False)
    cost = costs(laps, repeats, size.seconds / 3, "profile of the batch")
    parts = {name: cost[name] for name in stages}
    parts["memory of all blocks, counters"] = cost["kernel"] - sum(parts.values())
    parts["call from Python"] = cost["call"] - cost["kernel"]
    parts["refresh: faults, mission legs"] = cost["refresh"]
    parts["reset"] = cost["reset"]
    return parts | {"Fleet.step, PropulsionVectorEnv.step": cost["whole"] - sum(parts.values())}


def single_profile(seed: int, repeats: int, size: Size) -> dict[str, float]:
    """Where the time of the single environment goes [ns per step]; the parts add up to the whole."""
    env = gym.make(OURS)
    fleet = Fleet(1)
    action = np.array([0.3, 0.1, 0.0], np.float32)
    fleet.reset([seed])
    laps = dict(list(kernel_laps(fleet).items())[:2])
    laps["fleet"] = partial(calls, partial(fleet.step, action[None].astype(float)), 1, 100)
    laps["truth"] = partial(calls, SingleLaneTruth(fleet).read, 1, 100)
    laps["env"] = partial(calls, partial(env.unwrapped.step, action), 1, 100)
    laps["reset"] = partial(calls, env.reset, size.episode)
    laps["whole"] = partial(single_steps, *prepared(env, seed, size.episode))
    cost = costs(laps, repeats, size.seconds / 3, "profile of the single environment")
    parts = {name: cost[name] for name in ("kernel", "truth", "reset")}
    parts["call from Python"] = cost["call"] - cost["kernel"]
    parts["Fleet.step"] = cost["fleet"] - cost["call"]
    parts["PropulsionEnv.step"] = cost["env"] - cost["fleet"] - cost["truth"]
    return parts | {"wrappers of gym.make": cost["whole"] - cost["env"] - cost["reset"]}


def machine() -> dict:
    """Processor, cores, threads and versions: what the rates depend on."""
    info = Path("/proc/cpuinfo")
    versions = {"python": platform.python_version()}
    lines = info.read_text().splitlines() if info.exists() else []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    for name in ("auv-fault", "gymnasium", "numpy", "numba", "gym-electric-motor"):
        with contextlib.suppress(metadata.PackageNotFoundError):
            versions[name] = metadata.version(name)
    return {
        "processor": (models or [platform.machine()])[0],
        "cores": os.cpu_count(),
        "versions": versions,
    }


def measure(args: Args, size: Size) -> dict:
    """Everything, as it goes into results.json: machine, comparison, the rates of every repeat, profiles."""
    rates = interleaved(contenders(args.seed, size), args.repeats, size.seconds, "comparison")
    about = {"seed": args.seed, "repeats": args.repeats, "size": asdict(size), "machine": machine()}
    return about | {
        "comparison": comparison(rates, size),
        "rates": rates,
        "batch_profile": batch_profile(args.seed, args.repeats, size),
        "single_profile": single_profile(args.seed, args.repeats, size),
    }


def comparison_text(rows: list[dict]) -> str:
    """The table of rates and ratios."""
    lines = [f"{'what':<44}{'rate [1/s]':>14}{'ratio':>9}  {'to':<31}{'target':<16}met"]
    for row in rows:
        words = row | {"met": {True: "met", False: "missed", None: ""}[row["met"]]}
        lines.append(
            "{what:<44}{rate:>14,.0f}{ratio:>9.2f}  {to:<31}{target:<16}{met}".format(
                **words
            ).rstrip()
        )
    return "\n".join(lines)


def profile_text(title: str, parts: dict[str, float]) -> str:
    """A profile: ns per lane-step and share of each part."""
    whole = sum(parts.values())
    rows = {**parts, "whole": whole}.items()
    lines = [f"{name:<44}{ns:>14,.2f}{100 * ns / whole:>9.1f} %" for name, ns in rows]
    return "\n".join([f"{title:<44}{'ns/lane-step':>14}{'share':>9}", *lines])


def report(results: dict) -> str:
    """The results in words and tables."""
    about = results["machine"]
    lanes = results["size"]["lanes"]
    versions = ", ".join(f"{name} {version}" for name, version in about["versions"].items())
    title = f"{about['processor']}, {about['cores']} cores; {versions}"
    profiles = (
        (f"batch of {lanes} lanes", "batch_profile"),
        ("single environment", "single_profile"),
    )
    tables = [profile_text(name, results[key]) for name, key in profiles]
    return "\n\n".join([title, comparison_text(results["comparison"]), *tables, NOTES])


def main(arguments: Sequence[str] | None = None, size: Size | None = None) -> int:
    """Measure, print and, where asked for, write; 0 also where a target is missed, 2 on bad input."""
    given = sys.argv[1:] if arguments is None else list(arguments)
    try:
        args = tyro.cli(Args, args=given, prog="benchmark_speed")
        if args.repeats < 1:
            raise refusal(
                "repeats", args.repeats, "a whole number from 1", "five give a steady median"
            )
        if args.output is not None:
            args.output.mkdir(parents=True, exist_ok=True)  # before the measurement: it may fail
    except (ValueError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    results = {"command": shlex.join(["python", "-m", "training.studies.speed", *given])} | measure(
        args, size or Size()
    )
    print(report(results))
    if args.output is not None:
        path = args.output / "results.json"
        path.write_text(json.dumps(results, indent=1, allow_nan=False), encoding="utf-8")
        print(f"\nwritten: {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
