"""Runs whose speed can be measured, and their rates, for the speed study."""

import time
from collections.abc import Callable, Mapping
from functools import partial

import gymnasium as gym
import numba
from tqdm import tqdm

# runs a fixed number of lane-steps and returns it
Run = Callable[[], int]
# lane-steps per second of each run, one value for each repeat
Rates = dict[str, list[float]]
# arrays of random actions that the runs of batches repeat
N_BATCH_ACTIONS = 4


def prepare(env: gym.Env | gym.vector.VectorEnv, seed: int, n_actions: int) -> list:
    """Reset an environment, and sample random actions for it."""
    env.action_space.seed(seed)
    env.reset(seed=seed)
    return [env.action_space.sample() for _ in range(n_actions)]


def single_run(env: gym.Env, seed: int, steps: int) -> Run:
    """Steps of a single environment with random actions, and a reset after every episode."""
    actions = prepare(env, seed, steps)

    def run() -> int:
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
        return len(actions)

    return run


def batch_run(
    name: str, n_lanes: int, seed: int, steps: int, form: str = "vector_entry_point", **options
) -> Run:
    """Steps of a vectorised environment with random actions, its own resets among them.

    `form` is the `vectorization_mode` of `gymnasium.make_vec`; by default it is hand-vectorised.
    """
    env = gym.make_vec(name, num_envs=n_lanes, vectorization_mode=form, **options)
    actions = prepare(env, seed, N_BATCH_ACTIONS)

    def run() -> int:
        for step in range(steps):
            env.step(actions[step % N_BATCH_ACTIONS])
        return steps * n_lanes

    return run


def call_run(function: Callable[[], object], lane_steps: int, calls: int = 1) -> Run:
    """Calls from Python, each of `lane_steps` lane-steps."""

    def run() -> int:
        for _ in range(calls):
            function()
        return calls * lane_steps

    return run


def compiled_run(function: Callable, arguments: tuple, lane_steps: int, calls: int) -> Run:
    """Calls from a compiled loop, without the cost of calls from Python."""

    @numba.njit
    def loop(calls, arguments):
        for _ in range(calls):
            function(*arguments)

    return call_run(partial(loop, calls, arguments), calls * lane_steps)


def rate(run: Run, seconds: float) -> float:
    """Lane-steps per second over whole runs, for at least the given time and at least one run."""
    steps = 0
    start = time.perf_counter()
    while (elapsed := time.perf_counter() - start) < seconds or not steps:
        steps += run()
    return steps / elapsed


def rates_in_turn(runs: Mapping[str, Run], repeats: int, seconds: float, about: str) -> Rates:
    """Rates of all runs, measured in turn in every repeat so that other load affects all alike.

    A first round, which does not count, compiles and warms up. `seconds` is the least time of one
    measurement, `about` the label of the progress bar.
    """
    rates: Rates = {name: [] for name in runs}
    warm_up = [(name, 0.0) for name in runs]
    measurements = [(name, seconds) for _ in range(repeats) for name in runs]
    for name, least_seconds in tqdm([*warm_up, *measurements], desc=about):
        rates[name].append(rate(runs[name], least_seconds))
    return {name: measured[1:] for name, measured in rates.items()}
