"""What does ``auv-fault diagnose --follow`` cost? ``python -m training.studies.stream``.

Lines of a healthy vehicle are written one by one to the command's standard input, each after the
answer to the one before. Measured are the time to an answer and the memory of the process.
"""

import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from auv_fault_env.channels import CHANNELS
from auv_fault_env.errors import finite_in_range
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MissionSampler, follow_mission
from auv_fault_env.parameters import PRESETS, SAMPLE_TIME
from training.field.vehicle_file import Column, VehicleFile, write_vehicle
from training.report.sections import table_section
from training.seeds import seeds
from training.studies.run import command_line, run_study

WARM_UP = 1000  # lines
FIRST_SEED = 710_000_000  # within those of tests
MEMORY_READINGS = 10  # instants at which the memory is measured


@dataclass(frozen=True)
class StreamStudy:
    """Measure time and memory of the command on a stream."""

    output: Path = Path("runs/stream-study")
    """Folder of the results; an earlier run there is replaced."""
    lines: int = 1_000_000
    """Lines to send."""
    diagnoser: str = "filter_bank"
    """Diagnoser of the stream."""
    seed: int = 0
    """Offset within the seeds of tests."""


def main(arguments: StreamStudy) -> None:
    """Write lines, measure, and write the results."""
    finite_in_range("lines", arguments.lines, 2 * WARM_UP, 1e9)
    columns = {name: Column(name) for name in CHANNELS}
    vehicle = VehicleFile(PRESETS["thesis1992"], columns, Column("time"))

    def results_of(folder: Path) -> dict[str, Any]:
        path = folder / "vehicle.toml"
        write_vehicle(path, vehicle)
        return study(arguments, path)

    run_study("stream", arguments, results_of)


def study(arguments: StreamStudy, vehicle: Path) -> dict[str, Any]:
    """Quantiles of the time to an answer [us], and resident memory [MB] by lines written."""
    options = [
        "--vehicle",
        str(vehicle),
        "--follow",
        "--diagnoser",
        arguments.diagnoser,
    ]
    command = [sys.executable, "-m", "training.cli", "diagnose", *options]
    durations = np.empty(arguments.lines)
    memory = {}
    pipes = dict(stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0)
    with subprocess.Popen(command, **pipes) as process:
        process.stdin.write(",".join(["time", *CHANNELS]).encode() + b"\n")
        bar = tqdm(lines(arguments), total=arguments.lines, unit="line", unit_scale=True)
        for k, line in enumerate(bar):
            start = time.perf_counter()
            process.stdin.write(line)
            process.stdout.readline()
            durations[k] = time.perf_counter() - start
            n_lines = k + 1
            if n_lines == WARM_UP or n_lines % (arguments.lines // MEMORY_READINGS) == 0:
                memory[n_lines] = resident_memory(process.pid)
        process.stdin.close()
    p50, p99 = (1e6 * np.percentile(durations[WARM_UP:], [50, 99])).tolist()
    rows = [[f"{n_lines:,}", f"{size:.1f}"] for n_lines, size in memory.items()]
    times = f"median {p50:.0f} µs, 99th percentile {p99:.0f} µs"
    heading = f"{arguments.diagnoser}, to an answer: {times}"
    return {
        "title": "The cost of a stream",
        "summary": [
            f"{arguments.diagnoser} answered {arguments.lines:,} lines of a stream, {times}.",
            f"A vehicle sends a line every {1e6 * SAMPLE_TIME:,.0f} µs: the median answer takes "
            f"{100 * p50 / (1e6 * SAMPLE_TIME):.1f} % of that.",
            f"The memory grew by {max(memory.values()) - memory[WARM_UP]:.1f} MB after the first "
            f"{WARM_UP:,} lines; it should not grow with their number.",
        ],
        "intro": [],
        "p50_us": p50,
        "p99_us": p99,
        "memory_mb": memory,
        "sections": [table_section(heading, ["lines", "resident memory [MB]"], rows)],
    }


def lines(arguments: StreamStudy) -> Iterator[bytes]:
    """Lines of a healthy vehicle's log, on random legs; the last leg continues to the end."""
    fleet = Fleet(1, missions=MissionSampler(n_legs=200))
    observation = fleet.reset(seeds("test", 1, FIRST_SEED + arguments.seed), schedules=[()])
    for k in range(arguments.lines):
        cells = [f"{k * SAMPLE_TIME:.1f}", *map(repr, observation[0].tolist())]
        yield (",".join(cells) + "\n").encode()
        observation = fleet.step(follow_mission(observation))


def resident_memory(process: int) -> float:
    """Resident memory of a process [MB]; Linux only."""
    status = Path(f"/proc/{process}/status").read_text(encoding="utf-8")
    return int(status.partition("VmRSS:")[2].split()[0]) / 1e3


if __name__ == "__main__":
    command_line(main)
