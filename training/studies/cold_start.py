"""How long the first commands on a machine wait for the compiler.

Run ``python -m training.studies.cold_start``. Each row is a process of its own with an empty cache
folder, and then another one with what the first has compiled. CPU seconds depend less on other load
on the machine than the time by the clock.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from training.report.sections import table_section
from training.studies.run import command_line, run_study

ENVIRONMENT = """
import gymnasium as gym
import auv_fault_env
env = gym.make("auv_fault_env/Propulsion-v0")
observation, _ = env.reset(seed=1)
env.step([observation[0], 0.0, 0.0])
"""
FILTER_BANK = """
import numpy as np
import auv_fault_env, diagnosers
bank = diagnosers.make("filter_bank")
bank.reset(1)
bank.update(np.zeros((1, len(auv_fault_env.CHANNELS)), np.float32))
"""
WATCH = """
from training.live.session import Session
Session(0).step()
"""
CLI = ("-m", "training.cli")
COLUMNS = (
    "what",
    "first start: by the clock [s]",
    "CPU [s]",
    "target [s]",
    "later: by the clock [s]",
    "CPU [s]",
)


@dataclass(frozen=True)
class ColdStart:
    """Measure how long the first start waits for the compiler, and a later one."""

    output: Path = Path("runs/cold_start")
    """Folder of the report; an earlier run there is replaced."""


class Start(NamedTuple):
    """A process: what it is, the arguments of Python, and the target of its first start [s]."""

    what: str
    arguments: Sequence[str]
    target: float


class Seconds(NamedTuple):
    """How long a process takes [s]."""

    clock: float
    cpu: float


def main(arguments: ColdStart) -> None:
    """Measure and print; a missed target is no error."""
    run_study("cold_start", arguments, measure, page)


def measure(folder: Path) -> dict[str, Any]:
    """The rows as plain data, in seconds."""
    with tempfile.TemporaryDirectory() as temporary:
        return {"rows": [measured(start, temporary) for start in starts(Path(temporary))]}


def starts(folder: Path) -> list[Start]:
    """What is measured; a simulated log and its vehicle file are written into the folder."""
    log = folder / "log" / "episodes.parquet"
    vehicle = folder / "vehicle.toml"
    simulate = ("simulate", "--vehicles", "1", "--duration", "60", "--mission", "thesis")
    prepare = (
        (*simulate, "--output", str(log.parent)),
        ("vehicle", "init", str(log), "--output", str(vehicle)),
    )
    for arguments in prepare:
        run((*CLI, *arguments), os.environ | {"MPLBACKEND": "agg"})
    diagnose = (*CLI, "diagnose", "--vehicle", str(vehicle), "--diagnoser", "filter_bank")
    return [
        Start("Propulsion-v0, first step", ("-c", ENVIRONMENT), 3.0),
        Start("filter_bank, first update", ("-c", FILTER_BANK), 15.0),
        Start(
            "auv-fault diagnose, a log of 60 s",
            (*diagnose, str(log), "--output", str(folder / "diagnosis")),
            15.0,
        ),
        Start("what auv-fault watch prepares", ("-c", WATCH), 10.0),
    ]


def measured(start: Start, folder: str) -> dict[str, Any]:
    """A row of the results: the process with an empty cache, and again."""
    with tempfile.TemporaryDirectory(dir=folder) as cache:
        environment = os.environ | {"NUMBA_CACHE_DIR": cache}
        first = run(start.arguments, environment)
        later = run(start.arguments, environment)
    return {
        "what": start.what,
        "target": start.target,
        "first": first._asdict(),
        "later": later._asdict(),
    }


def run(arguments: Sequence[str], environment: dict[str, str]) -> Seconds:
    """Run Python; its output is shown only if it fails. A fault found is no failure."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    began = time.perf_counter()
    done = subprocess.run(
        [sys.executable, *arguments], env=environment, capture_output=True, text=True, check=False
    )
    clock = time.perf_counter() - began
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode not in (0, 3):
        print(done.stderr, file=sys.stderr)
        done.check_returncode()
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Seconds(clock, cpu)


def page(results: dict[str, Any]) -> dict[str, Any]:
    """Title, introduction, command and sections."""
    rows = []
    for row in results["rows"]:
        first = row["first"]
        later = row["later"]
        numbers = (first["clock"], first["cpu"], row["target"], later["clock"], later["cpu"])
        rows.append([row["what"], *(f"{number:.1f}" for number in numbers)])
    return {
        "title": "The first start",
        "summary": [
            f"{row['what']}: {row['first']['clock']:.1f} s at the first start, "
            f"{row['later']['clock']:.1f} s later."
            for row in results["rows"]
        ],
        "intro": ["What the first start compiles, later ones read from the cache folder."],
        "command": results["command"],
        "sections": [table_section("Starts", list(COLUMNS), rows)],
    }


if __name__ == "__main__":
    command_line(main)
