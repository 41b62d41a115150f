"""How fast the environments are, as ratios to yardsticks measured side by side, and where the time of a step goes.

    python -m training.benchmark_speed --output runs/speed

Every repeat measures all contenders in turn, so that load on the machine hits all alike. Rates are medians over the
repeats; a ratio is the median of the ratios within each repeat. All that a user pays for is included: noise,
controllers, faults, observations, information and resets. Ours runs whole episodes, so every lane's reset has its
natural share; the others reset whenever an episode ends. Actions are drawn beforehand.

Rates of different machines do not compare, ratios do so roughly. Load from elsewhere hits the parallel batches hardest.
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
from auv_fault_env.truth import LaneTruth

OURS = "auv_fault_env/Propulsion-v0"
GEM_MISSING = 'gym-electric-motor is not installed; its rows are left out. To have them: pip install -e ".[bench]"'
NOTES = """\
A step of gym-electric-motor is 0.1 ms of one motor; ours is 0.1 s of two motors, hull, controllers and sensors.
By default its constraints end an episode of random actions after a few steps, so that resets take much of its time.
A lane-step is one step of one lane. The profiles are of one thread."""
POOL = 4  # arrays of batched actions drawn beforehand

Lap = Callable[[], int]  # runs a fixed number of lane-steps and returns it
Rates = dict[str, list[float]]  # lane-steps per second by contender, one per repeat


@dataclass(frozen=True)
class Args:
    """Measure the speed of the environments against yardsticks and profile a step.

    Attributes:
        seed: Seed of the environments and of the actions.
        repeats: Repeats of which the medians are taken.
        output: Folder to write results.json into; without it nothing is written.
    """

    seed: int = 0
    repeats: int = 5
    output: Path | None = None


@dataclass(frozen=True)
class Size:
    """How much is measured: lanes of the two batches, steps per episode, least seconds per measurement."""

    lanes: int = 4096
    many: int = 65_536
    episode: int = 600
    seconds: float = 0.3


@dataclass(frozen=True)
class Mark:
    """A contender's ratio, `over` to `under`, and the least or the largest value it should have."""

    what: str
    over: str
    under: str
    meaning: str
    least: float | None = None
    most: float | None = None
    aim: float | None = None

    @property
    def target(self) -> str:
        """The target in words; empty where the ratio is for information."""
        if self.most is not None:
            return f"<= {self.most:g}"
        aim = f" (aim {self.aim:g})" if self.aim else ""
        return f">= {self.least:g}{aim}" if self.least is not None else ""

    def met(self, ratio: float) -> bool | None:
        """Whether the ratio keeps the target; None where there is none."""
        if not self.target:
            return None
        return ratio <= self.most if self.most is not None else ratio >= self.least


CART, FASTER, COST = "CartPole-v1", "ours over it", "cost per lane-step of {lanes}"
MARKS: dict[str, Mark] = {
    "cartpole": Mark("CartPole-v1, single", "cartpole", "cartpole", CART),
    "single": Mark("Propulsion-v0, single", "single", "cartpole", CART, least=0.4),
    "gem": Mark("gym-electric-motor DC speed, single", "single", "gem", FASTER, least=15.0),
    "gem_free": Mark("  the same without constraints", "single", "gem_free", FASTER),
    "gem_euler": Mark("  the same without constraints, Euler", "single", "gem_euler", FASTER),
    "serial": Mark("Propulsion-v0, {lanes} lanes, one thread", "serial", "cartpole", CART, least=25.0, aim=60.0),
    "default": Mark("Propulsion-v0, {lanes} lanes", "default", "cartpole", CART, least=25.0, aim=60.0),
    "cartpoles": Mark("CartPole-v1 hand-vectorised, {lanes} lanes", "cartpoles", "cartpole", CART),
    "many": Mark("Propulsion-v0, {many} lanes", "default", "many", COST, most=1.2),
}


def single_lap(env: gym.Env, seed: int, steps: int) -> Lap:
    """Steps of one environment with random actions, and a reset whenever its episode ends."""
    env.action_space.seed(seed)
    actions = [env.action_space.sample() for _ in range(steps)]
    env.reset(seed=seed)

    def lap() -> int:
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
        return steps

    return lap


def batch_lap(env: gym.vector.VectorEnv, seed: int, steps: int) -> Lap:
    """Steps of a vector environment with random actions, its own resets among them."""
    env.action_space.seed(seed)
    actions = [env.action_space.sample() for _ in range(POOL)]
    env.reset(seed=seed)

    def lap() -> int:
        for step in range(steps):
            env.step(actions[step % POOL])
        return steps * env.num_envs

    return lap


def batch(name: str, n_lanes: int, **kwargs) -> gym.vector.VectorEnv:
    """The vector environment that a package registered itself."""
    return gym.make_vec(name, num_envs=n_lanes, vectorization_mode="vector_entry_point", **kwargs)


def gem_laps(seed: int) -> dict[str, Lap]:
    """gym-electric-motor's permanently excited DC motor under speed control, in three settings; nothing without it."""
    if importlib.util.find_spec("gym_electric_motor") is None:
        print(GEM_MISSING)
        return {}
    import gym_electric_motor as gem
    from gym_electric_motor.physical_systems.solvers import EulerSolver

    make = partial(gem.make, "Cont-SC-PermExDc-v0", visualization=())
    environments = {
        "gem": make(),
        "gem_free": make(constraints=()),
        "gem_euler": make(constraints=(), ode_solver=EulerSolver()),
    }
    return {name: single_lap(env, seed, 100) for name, env in environments.items()}


def contenders(seed: int, size: Size) -> dict[str, Lap]:
    """Whatever is compared, ready to run; a lap of a batch of ours is a whole episode of every lane, reset included."""
    steps = size.episode + 1
    return {
        "cartpole": single_lap(gym.make("CartPole-v1"), seed, size.episode),
        "single": single_lap(gym.make(OURS), seed, size.episode),
        **gem_laps(seed),
        "serial": batch_lap(batch(OURS, size.lanes, parallel=False), seed, steps),
        "default": batch_lap(batch(OURS, size.lanes), seed, steps),
        "cartpoles": batch_lap(batch("CartPole-v1", size.lanes), seed, size.episode // 4),
        "many": batch_lap(batch(OURS, size.many), seed, steps),
    }


def rate(lap: Lap, seconds: float) -> float:
    """Lane-steps per second over whole laps, for at least the given time."""
    steps, start = 0, time.perf_counter()
    while True:
        steps += lap()
        spent = time.perf_counter() - start
        if spent >= seconds:
            return steps / spent


def interleaved(laps: dict[str, Lap], repeats: int, seconds: float, about: str) -> Rates:
    """Rates of all laps, taken in turn in every repeat; a first round that does not count compiles and warms up."""
    rates: Rates = {name: [] for name in laps}
    with tqdm(total=(repeats + 1) * len(laps), desc=about) as progress:
        for repeat in range(repeats + 1):
            for name, lap in laps.items():
                measured = rate(lap, seconds if repeat else 0.0)
                if repeat:
                    rates[name].append(measured)
                progress.update()
    return rates


def comparison(rates: Rates, size: Size) -> list[dict]:
    """The table's rows: what, rate [lane-steps/s], ratio, meaning, target, met."""
    rows = []
    for name, mark in MARKS.items():
        if name in rates:
            pairs = zip(rates[mark.over], rates[mark.under], strict=True)
            ratio = statistics.median(over / under for over, under in pairs)
            rows.append(
                {
                    "what": mark.what.format(**asdict(size)),
                    "rate": statistics.median(rates[name]),
                    "ratio": ratio,
                    "meaning": mark.meaning.format(**asdict(size)),
                    "target": mark.target,
                    "met": mark.met(ratio),
                }
            )
    return rows


def started(n_lanes: int, seed: int) -> Fleet:
    """A fleet on one thread, in its first episode."""
    fleet = Fleet(n_lanes, parallel=False)
    fleet.reset(range(seed, seed + n_lanes))
    return fleet


def kernel_arguments(fleet: Fleet) -> tuple:
    """What `Fleet.step` hands to its kernel: the profile looks inside."""
    n = fleet.n_lanes
    actions, observations = np.tile([0.3, 0.1, 0.0], (n, 1)), np.empty((n, len(CHANNELS)), np.float32)
    return fleet._lanes, actions, fleet._limits, fleet._constants, observations, np.empty((n, 4))


def stage_arguments(fleet: Fleet) -> dict[str, tuple]:
    """Arguments of every stage of `lanes.step_block`, for the fleet's first block."""
    state, actions, limits, constants, observations, outcomes = kernel_arguments(fleet)
    block, width, scratch = state.memory[0], min(fleet.n_lanes, layout.LANES), np.zeros(layout.N_SCRATCH * layout.LANES)
    lanes.draw_normals(scratch, width, state.key, state.step)
    lanes.prepare(block, scratch, width, constants)
    return {
        "take_actions": (block, width, actions, limits),
        "control": (block, width, constants),
        "draw_normals": (scratch, width, state.key, state.step),
        "prepare": (block, scratch, width, constants),
        "move": (block, scratch, width),
        "sense_all": (block, scratch, width, state.key, state.step, limits),
        "account": (block, width, constants),
        "publish": (block, width, observations, outcomes),
    }


def compiled_lap(function, arguments: tuple, lane_steps: int, times: int) -> Lap:
    """Calls of a compiled function from a compiled loop, so that the way from Python does not count."""

    @numba.njit
    def loop(times, arguments):
        for _ in range(times):
            function(*arguments)

    def lap() -> int:
        loop(times, arguments)
        return times * lane_steps

    return lap


def kernel_laps(fleet: Fleet) -> dict[str, Lap]:
    """The stages on one block in the fast caches; all blocks from a compiled loop; all blocks called from Python."""
    n, width = fleet.n_lanes, min(fleet.n_lanes, layout.LANES)
    laps = {
        name: compiled_lap(getattr(lanes, name), arguments, width, 500)
        for name, arguments in stage_arguments(fleet).items()
    }
    arguments = kernel_arguments(fleet)
    laps["kernel"] = compiled_lap(lanes.step_serial, arguments, n, 1 + 1000 // n)
    laps["call"] = repeated_lap(partial(lanes.step_serial, *arguments), n, 1 + 1000 // n)
    return laps


def repeated_lap(function: Callable, lane_steps: int, times: int = 1) -> Lap:
    """Calls from Python, each of which stands for so many lane-steps."""

    def lap() -> int:
        for _ in range(times):
            function()
        return times * lane_steps

    return lap


def refreshes(fleet: Fleet, steps: int):
    """All that `Fleet.step` does in an episode for faults that come and go and for the mission's legs."""
    fleet._lanes.due[:] = 0
    for step in range(steps):
        fleet._lanes.step[:] = step
        if step >= fleet._lanes.due.min():
            episodes.refresh(fleet._lanes, fleet.plan, fleet._catalogue)


def costs(laps: dict[str, Lap], repeats: int, seconds: float, about: str) -> dict[str, float]:
    """Median cost of each lap [ns per lane-step]."""
    return {name: 1e9 / statistics.median(got) for name, got in interleaved(laps, repeats, seconds, about).items()}


def batch_profile(seed: int, repeats: int, size: Size) -> dict[str, float]:
    """Where the time of the batch goes on one thread [ns per lane-step]; the parts add up to the whole."""
    n, fleet = size.lanes, started(size.lanes, seed)
    laps = kernel_laps(fleet) | {
        "whole": batch_lap(batch(OURS, n, parallel=False), seed, size.episode + 1),
        "refresh": repeated_lap(partial(refreshes, fleet, size.episode), n * size.episode),
        "reset": repeated_lap(fleet.reset, n * size.episode),
    }
    cost = costs(laps, repeats, size.seconds / 3, "profile of the batch")
    stages = {name: cost[name] for name in stage_arguments(fleet)}
    return {
        **stages,
        "memory of all blocks, counters": cost["kernel"] - sum(stages.values()),
        "call from Python": cost["call"] - cost["kernel"],
        "refresh (faults, legs)": cost["refresh"],
        "reset": cost["reset"],
        "Fleet.step, PropulsionVectorEnv.step": cost["whole"] - cost["call"] - cost["refresh"] - cost["reset"],
    }


def single_profile(seed: int, repeats: int, size: Size) -> dict[str, float]:
    """Where the time of the single environment goes [ns per step]; the parts add up to the whole."""
    env, fleet, action = gym.make(OURS), started(1, seed), np.array([0.3, 0.1, 0.0], np.float32)
    kernel = kernel_laps(fleet)
    laps = {
        "kernel": kernel["kernel"],
        "call": kernel["call"],
        "whole": single_lap(env, seed, size.episode),
        "fleet": repeated_lap(partial(fleet.step, action[None].astype(float)), 1, 100),
        "truth": repeated_lap(LaneTruth(fleet).read, 1, 100),
        "env": repeated_lap(partial(env.unwrapped.step, action), 1, 100),
        "reset": repeated_lap(env.reset, size.episode),
    }
    cost = costs(laps, repeats, size.seconds / 3, "profile of the single environment")
    return {
        "kernel": cost["kernel"],
        "call from Python": cost["call"] - cost["kernel"],
        "Fleet.step": cost["fleet"] - cost["call"],
        "truth": cost["truth"],
        "PropulsionEnv.step": cost["env"] - cost["fleet"] - cost["truth"],
        "wrappers of gym.make": cost["whole"] - cost["env"] - cost["reset"],
        "reset": cost["reset"],
    }


def comparison_text(rows: list[dict]) -> str:
    """The table of rates and ratios."""
    lines = [f"{'what':<44}{'rate [1/s]':>14}{'ratio':>9}  {'to':<30}{'target':<15}met"]
    for row in rows:
        met = {True: "met", False: "missed", None: ""}[row["met"]]
        line = (
            f"{row['what']:<44}{row['rate']:>14,.0f}{row['ratio']:>9.2f}  {row['meaning']:<30}{row['target']:<15}{met}"
        )
        lines.append(line.rstrip())
    return "\n".join(lines)


def profile_text(title: str, parts: dict[str, float]) -> str:
    """A profile: ns per lane-step and share of each part."""
    whole = sum(parts.values())
    lines = [f"{name:<44}{ns:>14,.2f}{100 * ns / whole:>9.1f} %" for name, ns in {**parts, "whole": whole}.items()]
    return "\n".join([f"{title:<44}{'ns/lane-step':>14}{'share':>9}", *lines])


def machine() -> dict:
    """Processor, cores, threads and versions: what the rates depend on."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    versions = {"python": platform.python_version()}
    for name in ("auv-fault", "gymnasium", "numpy", "numba", "gym-electric-motor"):
        with contextlib.suppress(metadata.PackageNotFoundError):
            versions[name] = metadata.version(name)
    return {
        "processor": models[0] if models else platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "threads": numba.get_num_threads(),
        "system": platform.platform(),
        "versions": versions,
    }


def measure(args: Args, size: Size) -> dict:
    """Everything, as it goes into results.json: comparison, profiles, rates of every repeat, machine."""
    rates = interleaved(contenders(args.seed, size), args.repeats, size.seconds, "comparison")
    return {
        "seed": args.seed,
        "repeats": args.repeats,
        "size": asdict(size),
        "machine": machine(),
        "comparison": comparison(rates, size),
        "rates": rates,
        "batch_profile": batch_profile(args.seed, args.repeats, size),
        "single_profile": single_profile(args.seed, args.repeats, size),
    }


def report(results: dict) -> str:
    """The results in words and tables."""
    about = results["machine"]
    versions = ", ".join(f"{name} {version}" for name, version in about["versions"].items())
    return "\n\n".join(
        [
            f"{about['processor']}, {about['cores']} cores, {about['threads']} threads; {versions}",
            comparison_text(results["comparison"]),
            profile_text("batch of {lanes} lanes".format(**results["size"]), results["batch_profile"]),
            profile_text("single environment", results["single_profile"]),
            NOTES,
        ]
    )


def checked(args: Args) -> Args:
    """The arguments, if they can be kept; the output folder is made at once, not after the measurement."""
    if args.repeats < 1:
        raise refusal("repeats", args.repeats, "a whole number from 1", "five give a steady median")
    if args.seed < 0:
        raise refusal("seed", args.seed, "a whole number from 0", "give another seed")
    if args.output is not None:
        try:
            args.output.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise refusal("output", str(args.output), "a folder to write into", error.strerror) from None
    return args


def main(arguments: Sequence[str] | None = None, size: Size = Size()) -> int:  # noqa: B008 (frozen)
    """Measure, print and, where asked for, write; 0 also where a target is missed, 2 on bad input."""
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    try:
        args = checked(tyro.cli(Args, args=arguments, prog="benchmark_speed"))
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2
    results = measure(args, size)
    print(report(results))
    if args.output is not None:
        command = shlex.join(["python", "-m", "training.benchmark_speed", *arguments])
        path = args.output / "results.json"
        path.write_text(json.dumps({"command": command} | results, indent=2) + "\n", encoding="utf-8")
        print(f"\nwritten: {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
