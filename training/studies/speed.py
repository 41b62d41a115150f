"""How fast the environments are, beside others measured at the same time, and what a step costs.

Run ``python -m training.studies.speed``. Rates are medians over the repeats; a ratio is the median
of the ratios within each repeat. They include all that a user pays for: noise, controllers, faults,
observations, information and resets. Runs of this project's batches are whole episodes, so that the
resets of all lanes have their share; other runs reset whenever an episode ends. Random actions are
sampled before the measurement. Other load on the machine affects the parallel batches most: measure
on an idle machine.
"""

import contextlib
import importlib.util
import os
import platform
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from importlib import metadata
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

from auv_fault_env.errors import finite_in_range, whole_number
from training.report.sections import table_section
from training.studies import speed_history
from training.studies.run import command_line, run_study
from training.studies.speed_profiles import ENVIRONMENT, batch_profile, single_profile
from training.studies.speed_runs import (
    Rates,
    Run,
    batch_run,
    rates_in_turn,
    single_run,
)

CARTPOLE = "CartPole-v1"
GEM_MISSING = (
    "gym-electric-motor is not installed; its rows are missing. To install it: "
    'pip install -e ".[bench]"'
)
NOTES = (
    "A step of gym-electric-motor is 0.1 ms of one motor; ours is 0.1 s of two motors, hull, "
    "controllers and sensors. By default its constraints end an episode of random actions after a "
    "few steps, so that resets take much of its time; the solver Euler is without constraints. "
    "CartPole-v1 is hand-vectorised over many lanes, where the aim is 60 times its single rate. A "
    "lane-step is a step of one lane. Both profiles are of one thread."
)
VERSIONED_PACKAGES = (
    "auv-fault",
    "gymnasium",
    "numpy",
    "numba",
    "gym-electric-motor",
)
TARGET_WORDS = {True: "met", False: "missed", None: ""}
# steps of a run of gym-electric-motor
GEM_STEPS = 100


@dataclass(frozen=True)
class Speed:
    """Measure the speed of the environments beside others, and profile a step."""

    repeats: int = 5
    """Number of repeats, of which the median counts."""
    seed: int = 0
    """Seed of the environments and of the actions."""
    output: Path = Path("runs/speed")
    """Folder of the report; an earlier run there is replaced."""
    history: Path | None = None
    """File to which the ratios are added, see `training.studies.speed_history`."""


@dataclass(frozen=True)
class Size:
    """How much is measured.

    Attributes
    ----------
    lanes, many
        Lanes of the two batches.
    episode
        Steps of an episode.
    seconds
        Least time of one measurement.
    """

    lanes: int = 4096
    many: int = 65_536
    episode: int = 600
    seconds: float = 0.3


class Comparison(NamedTuple):
    """A row of the table: a run, and the ratio of two rates with its limits.

    Attributes
    ----------
    what, to
        Run and meaning of the ratio in the table.
    numerator, denominator
        Names of the runs whose rates are divided.
    least, most
        Limits of the ratio.
    """

    what: str
    numerator: str
    denominator: str
    to: str
    least: float = -inf
    most: float = inf

    @property
    def target(self) -> str:
        """The limit in words; empty without one."""
        if self.least > -inf:
            return f">= {self.least:g}"
        return f"<= {self.most:g}" if self.most < inf else ""


TO_CARTPOLE = ("cartpole", CARTPOLE)
# environments of gymnasium.vector.SyncVectorEnv
SYNC = 8
GEM = "gym-electric-motor DC speed"
BATCH = "Propulsion-v0, {lanes} lanes"
COST = "cost per lane-step at {lanes}"
# by run
COMPARISONS = {
    "cartpole": Comparison("CartPole-v1, single", "cartpole", *TO_CARTPOLE),
    "single": Comparison("Propulsion-v0, single", "single", *TO_CARTPOLE, least=0.6),
    "sync_cartpoles": Comparison(
        f"CartPole-v1, SyncVectorEnv of {SYNC}", "sync_cartpoles", *TO_CARTPOLE
    ),
    "sync": Comparison(
        f"Propulsion-v0, SyncVectorEnv of {SYNC}",
        "sync_cartpoles",
        "sync",
        "time of a step to that of CartPole-v1",
        most=2.0,
    ),
    "gem": Comparison(f"{GEM}, single", "single", "gem", "ours over it", least=15.0),
    "gem_free": Comparison(f"{GEM}, no constraints", "single", "gem_free", "ours over it"),
    "gem_euler": Comparison(f"{GEM}, Euler", "single", "gem_euler", "ours over it"),
    "serial": Comparison(f"{BATCH}, serial", "serial", *TO_CARTPOLE, least=25.0),
    "parallel": Comparison(BATCH, "parallel", *TO_CARTPOLE, least=25.0),
    "cartpoles": Comparison("CartPole-v1, {lanes} lanes", "cartpoles", *TO_CARTPOLE),
    "many": Comparison("Propulsion-v0, {many} lanes", "parallel", "many", COST, most=1.2),
}


def main(arguments: Speed) -> None:
    """Measure and print; a missed target is no error."""
    report(arguments, Size())


def report(arguments: Speed, size: Size) -> None:
    """Measure, and write results and page."""
    whole_number("repeats", arguments.repeats)
    finite_in_range("seed", arguments.seed, 0, 2**31)
    if arguments.history is not None and arguments.history.exists():
        speed_history.read(arguments.history)
    run_study("speed", arguments, lambda folder: measure(arguments, size), page)


def measure(arguments: Speed, size: Size) -> dict[str, Any]:
    """All results as plain data: machine, comparison, rates of every repeat, profiles."""
    seed = arguments.seed
    repeats = arguments.repeats
    rates = rates_in_turn(compared_runs(seed, size), repeats, size.seconds, "comparison")
    profile_seconds = size.seconds / 3
    rows = comparison_rows(rates, size)
    if arguments.history is not None:
        ratios = {name: row["ratio"] for name, row in zip(rates, rows, strict=True)}
        speed_history.append(arguments.history, machine(), ratios)
    return {
        "seed": seed,
        "repeats": repeats,
        "size": asdict(size),
        "machine": machine(),
        "comparison": rows,
        "rates": rates,
        "batch_profile": batch_profile(seed, repeats, size.lanes, size.episode, profile_seconds),
        "single_profile": single_profile(seed, repeats, size.episode, profile_seconds),
    }


def compared_runs(seed: int, size: Size) -> dict[str, Run]:
    """The runs of the comparison; a batch of this project runs a whole episode, resets included."""
    steps = size.episode + 1
    return {
        "cartpole": single_run(gym.make(CARTPOLE), seed, size.episode),
        "single": single_run(gym.make(ENVIRONMENT), seed, size.episode),
        "sync_cartpoles": batch_run(CARTPOLE, SYNC, seed, size.episode, "sync"),
        "sync": batch_run(ENVIRONMENT, SYNC, seed, size.episode, "sync"),
        **gem_runs(seed),
        "serial": batch_run(ENVIRONMENT, size.lanes, seed, steps, parallel=False),
        "parallel": batch_run(ENVIRONMENT, size.lanes, seed, steps),
        "cartpoles": batch_run(CARTPOLE, size.lanes, seed, steps // 4),
        "many": batch_run(ENVIRONMENT, size.many, seed, steps),
    }


def gem_runs(seed: int) -> dict[str, Run]:
    """A permanently excited DC motor of gym-electric-motor in three settings; none without it."""
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
    return {name: single_run(env, seed, GEM_STEPS) for name, env in environments.items()}


def comparison_rows(rates: Rates, size: Size) -> list[dict[str, Any]]:
    """Rows of the table: what, rate [lane-steps/s], ratio, to, target, and whether it is met."""
    rows = []
    for name, measured in rates.items():
        comparison = COMPARISONS[name]
        ratios = np.divide(rates[comparison.numerator], rates[comparison.denominator])
        ratio = statistics.median(ratios.tolist())
        is_met = comparison.least <= ratio <= comparison.most
        row = {
            "what": comparison.what.format(**asdict(size)),
            "rate": statistics.median(measured),
            "ratio": ratio,
            "to": comparison.to.format(**asdict(size)),
            "target": comparison.target,
            "met": is_met if comparison.target else None,
        }
        rows.append(row)
    return rows


def machine() -> dict[str, Any]:
    """Processor, number of cores and versions, on which the rates depend."""
    information = Path("/proc/cpuinfo")
    lines = information.read_text().splitlines() if information.exists() else []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    versions = {"python": platform.python_version()}
    for name in VERSIONED_PACKAGES:
        with contextlib.suppress(metadata.PackageNotFoundError):
            versions[name] = metadata.version(name)
    processor = models[0] if models else platform.machine()
    return {"processor": processor, "cores": os.cpu_count(), "versions": versions}


def page(results: dict[str, Any]) -> dict[str, Any]:
    """Title, introduction, command and sections."""
    about = results["machine"]
    versions = ", ".join(f"{name} {version}" for name, version in about["versions"].items())
    rows = [
        [
            row["what"],
            f"{row['rate']:,.0f}",
            f"{row['ratio']:.2f}",
            row["to"],
            row["target"],
            TARGET_WORDS[row["met"]],
        ]
        for row in results["comparison"]
    ]
    columns = ["what", "rate [1/s]", "ratio", "to", "target", "met"]
    return {
        "title": "How fast the environments are",
        "summary": summary(results["comparison"]),
        "intro": [
            f"{about['processor']}, {about['cores']} cores; {versions}.",
            NOTES,
        ],
        "command": results["command"],
        "sections": [
            table_section("Rates", columns, rows),
            profile_section(f"Batch of {results['size']['lanes']} lanes", results["batch_profile"]),
            profile_section("Single environment", results["single_profile"]),
        ],
    }


def summary(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """The fastest environment, and which targets are met."""
    judged = [row for row in rows if row["met"] is not None]
    missed = [
        f"{row['what']} ({row['ratio']:.2f}, {row['target']})" for row in judged if not row["met"]
    ]
    own = [row for row in rows if row["what"].startswith("Propulsion-v0")]
    fastest = max(own, key=lambda row: row["rate"])
    verdict = f"missed: {'; '.join(missed)}" if missed else "none is missed"
    return [
        "The environments of this package were timed beside CartPole-v1 and other simulators.",
        f"The fastest is {fastest['what']} with {fastest['rate']:,.0f} steps of a vehicle per "
        "second.",
        f"{len(judged) - len(missed)} of {len(judged)} targets are met; {verdict}.",
    ]


def profile_section(heading: str, parts: dict[str, float]) -> dict[str, Any]:
    """A profile: ns per lane-step and share of each part."""
    whole = sum(parts.values())
    rows = [
        [name, f"{cost:,.2f}", f"{100 * cost / whole:.1f} %"]
        for name, cost in (*parts.items(), ("whole", whole))
    ]
    return table_section(heading, ["part of a step", "ns/lane-step", "share"], rows)


if __name__ == "__main__":
    command_line(main)
