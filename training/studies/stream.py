"""What does ``auv-fault diagnose --follow`` cost? ``python -m training.studies.stream``.

Lines of a healthy vehicle go one by one into the command's standard input; each is sent when the
one before is answered. Measured: seconds to the answer, and the memory of the process on the way.
"""

import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from tqdm import tqdm

from auv_fault_env.channels import CHANNELS
from auv_fault_env.errors import finite_in_range
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MissionSampler, follow_mission
from auv_fault_env.parameters import PRESETS, SAMPLE_TIME
from training.field.vehicle_file import Column, VehicleFile, write_vehicle
from training.report.page import print_tables
from training.report.run_folder import run_folder, write_json
from training.seeds import seeds

WARM_UP = 1000  # lines
FIRST_SEED = 710_000_000  # within those of tests
MARKS = 10  # instants at which the memory is read


@dataclass(frozen=True)
class StreamStudy:
    """Send lines through the command and measure time and memory."""

    output: Path = Path("runs/stream-study")
    """Folder of the results; an earlier run there is replaced."""
    lines: int = 1_000_000
    """Lines to send."""
    diagnoser: str = "filter_bank"
    """Diagnoser to follow with."""
    seed: int = 0
    """Offset within the seeds of tests."""


def main(arguments: StreamStudy) -> None:
    """Send, measure, and write the results."""
    finite_in_range("lines", arguments.lines, 2 * WARM_UP, 1e9)
    with run_folder(arguments.output, "stream-study", arguments) as folder:
        columns = {name: Column(name) for name in CHANNELS}
        write_vehicle(
            folder / "vehicle.toml", VehicleFile(PRESETS["thesis1992"], columns, Column("time"))
        )
        results = study(arguments, folder / "vehicle.toml")
        write_json(folder / "results.json", results)
    print_tables(results["sections"])


def study(arguments: StreamStudy, vehicle: Path) -> dict[str, Any]:
    """Quantiles of the time to an answer [us], and resident memory [MB] by lines sent, as plain data and as a table."""
    options = [
        "diagnose",
        "--vehicle",
        str(vehicle),
        "--follow",
        "--diagnoser",
        arguments.diagnoser,
    ]
    command = [sys.executable, "-m", "training.cli", *options]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0
    ) as process:
        process.stdin.write(",".join(["time", *CHANNELS]).encode() + b"\n")
        durations = np.empty(arguments.lines)
        memory = {}
        for k, line in enumerate(
            tqdm(lines(arguments), total=arguments.lines, unit="line", unit_scale=True)
        ):
            start = time.perf_counter()
            process.stdin.write(line)
            process.stdout.readline()
            durations[k] = time.perf_counter() - start
            if k + 1 == WARM_UP or (k + 1) % (arguments.lines // MARKS) == 0:
                memory[k + 1] = resident(process.pid)
        process.stdin.close()
    p50, p99 = (1e6 * np.percentile(durations[WARM_UP:], [50, 99])).tolist()
    rows = [[f"{sent:,}", f"{size:.1f}"] for sent, size in memory.items()]
    heading = (
        f"{arguments.diagnoser}, to an answer: median {p50:.0f} µs, 99th percentile {p99:.0f} µs"
    )
    table = {"columns": ["lines", "resident memory [MB]"], "rows": rows}
    return {
        "p50_us": p50,
        "p99_us": p99,
        "memory_mb": memory,
        "sections": [{"heading": heading, "table": table}],
    }


def lines(arguments: StreamStudy) -> Iterator[bytes]:
    """Lines of a healthy vehicle's log, on random legs one after the other; the last leg goes on for ever."""
    fleet = Fleet(1, missions=MissionSampler(n_legs=200))
    observation = fleet.reset(seeds("test", 1, FIRST_SEED + arguments.seed), schedules=[()])
    for k in range(arguments.lines):
        yield (
            ",".join([f"{k * SAMPLE_TIME:.1f}", *map(repr, observation[0].tolist())]) + "\n"
        ).encode()
        observation = fleet.step(follow_mission(observation))


def resident(process: int) -> float:
    """Resident memory of a process [MB]; Linux only."""
    status = Path(f"/proc/{process}/status").read_text(encoding="utf-8")
    return int(status.partition("VmRSS:")[2].split()[0]) / 1e3


if __name__ == "__main__":
    main(tyro.cli(StreamStudy))
