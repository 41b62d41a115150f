"""Faults on environments of others: what a residual sees of them, and what the wrapper costs.

Run ``python -m training.studies.fault_injection``. A pendulum of Gymnasium swings under a constant
torque, with noise on its three sensors. The residual is the change of the measured angle less the
measured rate; an alarm is its mean absolute value over a second above the largest of as many
healthy episodes. The pendulum and the cart pole are timed with and without the wrapper, in turn.
"""

import statistics
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import SyncVectorEnv

from auv_fault_env.errors import finite_in_range, whole_number
from auv_fault_env.wrappers import FaultInjection, FaultInjectionVector, SignalFault
from training.report.cells import percent
from training.report.sections import table_section
from training.seeds import seeds
from training.studies.run import command_line, run_study
from training.studies.speed_runs import Rates, Run, prepare, rates_in_turn, single_run

COSINE, SINE, RATE = range(3)
SAMPLE_TIME = 0.05  # s, of Pendulum-v1
N_STEPS = 199  # the time limit of Pendulum-v1 less the step that ends the episode
TORQUE = 1.0  # N m
WINDOW = 20  # samples of an alarm
ONSET = 5.0  # s
NOISES = {
    "noise of the cosine": SignalFault("noise", "observation", COSINE, 0.01),
    "noise of the sine": SignalFault("noise", "observation", SINE, 0.01),
    "noise of the rate": SignalFault("noise", "observation", RATE, 0.05),
}
FAULTS = {
    "bias of the rate, 0.5 rad/s": SignalFault("bias", "observation", RATE, 0.5),
    "rate times 0.7": SignalFault("scale", "observation", RATE, 0.7),
    "rate stuck": SignalFault("stuck", "observation", RATE, 1.0),
    "rate reads zero": SignalFault("dropout", "observation", RATE, 1.0),
    "rate 4 samples late": SignalFault("delay", "observation", RATE, 4),
    "bias of the cosine, 0.3": SignalFault("bias", "observation", COSINE, 0.3),
    "half of the torque": SignalFault("gain", "action", 0, 0.5),
}
SEVERITIES = (0.5, 1.0)
LANES = 8  # of the timed vectors
STEPS = 400  # of a timed run
TIMED = {"CartPole-v1": 2, "Pendulum-v1": 2}  # and the channel that is faulty


@dataclass(frozen=True)
class FaultInjectionStudy:
    """Inject faults into a pendulum and a cart pole."""

    output: Path = Path("runs/fault-injection")
    """Folder of the results; an earlier run there is replaced."""
    episodes: int = 100
    """Healthy episodes that set the limit, and episodes of each row."""
    repeats: int = 7
    """Measurements of each time."""
    seed: int = 0
    """Offset within the seeds of calibration and of tests."""


def main(arguments: FaultInjectionStudy) -> None:
    """Measure, and write the results."""
    finite_in_range("episodes", arguments.episodes, 1, 10_000)
    whole_number("repeats", arguments.repeats)
    run_study("fault_injection", arguments, lambda folder: study(arguments))


def study(arguments: FaultInjectionStudy) -> dict[str, Any]:
    """What is detected, and ratios of times, as plain data and as tables."""
    detected = detection(arguments)
    ratios = {name: cost(name, arguments) for name in TIMED}
    return {
        "title": "Faults on environments of others",
        "summary": summary(detected, ratios),
        "intro": [],
        "detected": detected,
        "ratios": ratios,
        "sections": [detection_section(detected), cost_section(ratios)],
    }


def summary(
    detected: Mapping[str, Mapping[str, Any]], ratios: Mapping[str, Mapping[str, float]]
) -> list[str]:
    """Which injected faults a residual sees, and what the wrapper costs at most."""
    whole = {
        name: by_severity[f"{SEVERITIES[-1]:g}"]["share"]
        for name, by_severity in detected.items()
        if name in FAULTS
    }
    most = max(whole, key=whole.__getitem__)
    least = min(whole, key=whole.__getitem__)
    false_share = detected["healthy"][""]["share"]
    costs = {name: max(by_what.values()) for name, by_what in ratios.items()}
    dearest = max(costs, key=costs.__getitem__)
    return [
        f"{len(whole)} faults were injected into a pendulum that one residual watches: of the "
        f"whole ones, it sees {most} in {percent(whole[most])} of the episodes and {least} in "
        f"{percent(whole[least])}.",
        f"It raises a false alarm in {percent(false_share)} of the healthy episodes.",
        f"A step with the wrapper takes at most {costs[dearest]:.2f} times as long ({dearest}).",
    ]


def detection(arguments: FaultInjectionStudy) -> dict[str, dict[str, Any]]:
    """Share of episodes with an alarm and its median delay [s], by fault and severity."""
    calibration = seeds("calibration", arguments.episodes, arguments.seed)
    limit = indicator([], calibration).max()
    test = seeds("test", arguments.episodes, arguments.seed)
    rows = {"healthy": {"": alarms(indicator([], test), limit)}}
    for name in FAULTS:
        rows[name] = {}
        for severity in SEVERITIES:
            event = {"fault": name, "onset": ONSET, "severity": severity}
            rows[name][f"{severity:g}"] = alarms(indicator([event], test), limit)
    return rows


def indicator(events: list[dict[str, Any]], lane_seeds: range) -> np.ndarray:
    """Mean absolute residual of the last second [rad/s], (n_steps, n_lanes), from the onset on."""
    noises = [{"fault": name, "onset": 0.0, "severity": 1.0} for name in NOISES]
    pendulums = gym.make_vec("Pendulum-v1", len(lane_seeds), "sync")
    env = FaultInjectionVector(pendulums, NOISES | FAULTS, [*noises, *events], SAMPLE_TIME)
    before, _ = env.reset(seed=list(lane_seeds))
    residuals = []
    for _ in range(N_STEPS):
        now, *_ = env.step(np.full((len(lane_seeds), 1), TORQUE, np.float32))
        residuals.append(residual(before, now))
        before = now
    env.close()
    means = np.lib.stride_tricks.sliding_window_view(np.abs(residuals), WINDOW, axis=0).mean(-1)
    first = round(ONSET / SAMPLE_TIME) - WINDOW
    return means[first:]


def residual(before: np.ndarray, now: np.ndarray) -> np.ndarray:
    """Change of the measured angle less the measured rate [rad/s], observations (n_lanes, 3)."""
    turn = np.angle((now[:, 0] + 1j * now[:, 1]) / (before[:, 0] + 1j * before[:, 1]))
    return turn / SAMPLE_TIME - now[:, 2]


def alarms(indicators: np.ndarray, limit: float) -> dict[str, Any]:
    """Share of the lanes with an alarm, and the median delay of those that have one [s]."""
    is_above = indicators > limit
    has_alarm = is_above.any(axis=0)
    delays = SAMPLE_TIME * is_above.argmax(axis=0)[has_alarm]
    return {
        "share": float(has_alarm.mean()),
        "delay": float(np.median(delays)) if has_alarm.any() else None,
    }


def cost(name: str, arguments: FaultInjectionStudy) -> dict[str, float]:
    """Time of a step with the wrapper over that without, by what the wrapper does."""
    faults = {"bias": SignalFault("bias", "observation", TIMED[name], 0.1)}
    wrap = partial(FaultInjection, faults=faults)
    wrap_vector = partial(FaultInjectionVector, faults=faults)
    bias = [{"fault": "bias", "onset": 0.0, "severity": 1.0}]
    singles: dict[str, Callable[[gym.Env], gym.Env]] = {
        "bare": lambda env: env,
        "no fault": wrap,
        "a bias": partial(wrap, schedules=bias),
        "a bias, truth in full": partial(wrap, schedules=bias, truth="full"),
    }
    vectors: dict[str, Callable[[gym.vector.VectorEnv], gym.vector.VectorEnv]] = {
        "bare": lambda env: env,
        "no fault": wrap_vector,
        "a bias": partial(wrap_vector, schedules=bias),
        "a bias, truth in full": partial(wrap_vector, schedules=bias, truth="full"),
    }
    many = partial(SyncVectorEnv, [partial(gym.make, name)] * LANES)
    runs_of_one = {
        what: single_run(wrapped(gym.make(name)), arguments.seed, STEPS)
        for what, wrapped in singles.items()
    }
    runs_of_many = {
        what: vector_run(wrapped(many()), arguments.seed) for what, wrapped in vectors.items()
    }
    ratios = ratios_to_bare(runs_of_one, arguments.repeats, name)
    of_many = ratios_to_bare(runs_of_many, arguments.repeats, f"{LANES} {name}")
    return ratios | {f"{what}, {LANES} in a vector": ratio for what, ratio in of_many.items()}


def vector_run(env: gym.vector.VectorEnv, seed: int) -> Run:
    """Steps of a vector with random actions, its own resets among them."""
    actions = prepare(env, seed, STEPS // LANES)

    def run() -> int:
        for action in actions:
            env.step(action)
        return len(actions)

    return run


def ratios_to_bare(runs: Mapping[str, Callable[[], int]], repeats: int, about: str) -> dict:
    """Median ratio of the time of a step to that of the run `bare`."""
    rates: Rates = rates_in_turn(runs, repeats, 0.2, about)
    bare = rates.pop("bare")
    return {
        what: statistics.median(np.divide(bare, measured).tolist())
        for what, measured in rates.items()
    }


def detection_section(detected: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """The table of what the residual sees."""
    rows = []
    for name, by_severity in detected.items():
        for severity, result in by_severity.items():
            delay = "-" if result["delay"] is None else f"{result['delay']:.2f} s"
            rows.append([name, severity, percent(result["share"]), delay])
    text = (
        f"Alarms within {(N_STEPS + 1) * SAMPLE_TIME - ONSET:g} s of the onset at {ONSET:g} s; the "
        "median delay is that of the episodes with an alarm."
    )
    columns = ("fault", "severity", "alarm", "median delay")
    return table_section("What one residual of a pendulum sees", columns, rows, text)


def cost_section(ratios: Mapping[str, Mapping[str, float]]) -> dict[str, Any]:
    """The table of the costs."""
    whats = next(iter(ratios.values()))
    rows = [[what, *(f"{by_what[what]:.2f}" for by_what in ratios.values())] for what in whats]
    text = "Time of a step with the wrapper over that without it, resets included."
    return table_section("What the wrapper costs", ("wrapper", *ratios), rows, text)


if __name__ == "__main__":
    command_line(main)
