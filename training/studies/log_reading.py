"""How long does reading a large log take? ``python -m training.studies.log_reading``.

Logs of random readings are written in three dialects; each is read by this package and, in the
same run, by ``pandas.read_csv`` (extra ``bench``), in processes of their own. Pandas is given the
decimal mark and the column of stamps, which this package finds out.
"""

import importlib.util
import statistics
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from auv_fault_env.errors import whole_number
from training.report.sections import table_section
from training.studies.run import command_line, run_study

FIRST = np.datetime64("2024-05-01T00:00:00", "ms")
STEP = np.timedelta64(100, "ms")
BLOCK = 100_000  # rows that are made at once
SEED = 0
OURS = "from pathlib import Path; from training.field.logs.files import read_table as read"
OUR_CALL = "read(Path(sys.argv[1]))"
PANDAS = "from pandas import read_csv as read"
MEASURE = """
import resource, sys, time
{imports}
start = time.perf_counter()
table = {call}
print(time.perf_counter() - start, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3)
"""
# by dialect: separator, whether commas are decimal, whether stamps are dates, options of pandas
DIALECTS = {
    "numbers": (",", False, False, ""),
    "ISO stamps": (",", False, True, ", parse_dates=['time']"),
    "German": (";", True, True, ", sep=';', decimal=',', parse_dates=['time']"),
}


@dataclass(frozen=True)
class LogReadingStudy:
    """Measure time and memory of reading large logs."""

    output: Path = Path("runs/log-reading-study")
    """Folder of the results; an earlier run there is replaced."""
    rows: int = 1_000_000
    """Rows of each log."""
    columns: int = 12
    """Columns of each log, the time included."""
    repeats: int = 3
    """Readings of each log, of which the median counts."""


def main(arguments: LogReadingStudy) -> None:
    """Write logs, read them, and write the results."""
    whole_number("rows", arguments.rows)
    whole_number("columns", arguments.columns, low=2)
    whole_number("repeats", arguments.repeats)
    run_study("log_reading", arguments, lambda folder: study(arguments, folder))


def study(arguments: LogReadingStudy, folder: Path) -> dict[str, Any]:
    """Time [s] and peak resident memory [MB] of both readers by dialect."""
    has_pandas = importlib.util.find_spec("pandas") is not None
    results = {}
    path = folder / "log.csv"
    for dialect, (separator, has_commas, has_stamps, options) in DIALECTS.items():
        write_log(path, arguments, separator, has_commas, has_stamps)
        reading = {"ours": (OURS, OUR_CALL)}
        if has_pandas:
            reading["pandas"] = (PANDAS, f"read(sys.argv[1]{options})")
        results[dialect] = {
            name: measured(imports, call, path, arguments.repeats)
            for name, (imports, call) in reading.items()
        }
        path.unlink()
    names = ["dialect", "time [s]", "peak memory [MB]", "pandas [s]", "pandas [MB]", "ratio"]
    table = table_section(
        f"{arguments.rows:,} rows of {arguments.columns} columns",
        names,
        [_row(dialect, results[dialect]) for dialect in results],
    )
    return {
        "title": "Reading a large log",
        "summary": summary(results, arguments),
        "intro": [],
        "results": results,
        "sections": [table],
    }


def summary(results: dict[str, Any], arguments: LogReadingStudy) -> list[str]:
    """The slowest dialect, beside pandas if that is there."""
    times = {dialect: result["ours"]["time"] for dialect, result in results.items()}
    slowest = max(times, key=times.__getitem__)
    memory = max(result["ours"]["memory"] for result in results.values())
    sentences = [
        f"A log of {arguments.rows:,} rows and {arguments.columns} columns was read in "
        f"{len(results)} dialects, in at most {times[slowest]:.1f} s ({slowest}) and "
        f"{memory:.0f} MB.",
    ]
    ratios = [
        result["ours"]["time"] / result["pandas"]["time"]
        for result in results.values()
        if "pandas" in result
    ]
    if ratios:
        sentences.append(
            f"That is {min(ratios):.2f} to {max(ratios):.2f} times as long as pandas takes with "
            "the dialect given by hand."
        )
    else:
        sentences.append("pandas, to compare with, is not installed.")
    return sentences


def _row(dialect: str, result: dict[str, Any]) -> list[str]:
    ours = result["ours"]
    row = [dialect, f"{ours['time']:.2f}", f"{ours['memory']:.0f}"]
    if "pandas" not in result:
        return [*row, "not installed", "", ""]
    pandas = result["pandas"]
    ratio = ours["time"] / pandas["time"]
    return [*row, f"{pandas['time']:.2f}", f"{pandas['memory']:.0f}", f"{ratio:.2f}"]


def write_log(
    path: Path, arguments: LogReadingStudy, separator: str, has_commas: bool, has_stamps: bool
) -> None:
    """Write a log of random readings at 10 Hz."""
    generator = np.random.default_rng(SEED)
    n_readings = arguments.columns - 1
    with path.open("w", encoding="utf-8") as file:
        file.write(separator.join(["time", *(f"x{k}" for k in range(n_readings))]) + "\n")
        for start in range(0, arguments.rows, BLOCK):
            rows = np.arange(start, min(start + BLOCK, arguments.rows))
            stamps = FIRST + rows * STEP
            times = np.datetime_as_string(stamps) if has_stamps else np.char.mod("%.1f", rows / 10)
            readings = np.char.mod("%.4f", generator.normal(0.0, 30.0, (rows.size, n_readings)))
            if has_commas:
                readings = np.char.replace(readings, ".", ",")
            lines = np.column_stack([times, readings]).tolist()
            file.writelines(separator.join(line) + "\n" for line in lines)


def measured(imports: str, call: str, path: Path, repeats: int) -> dict[str, float]:
    """Median time [s] and largest memory [MB] of readings in processes of their own."""
    command = [sys.executable, "-c", MEASURE.format(imports=imports, call=call), str(path)]
    runs = [
        [float(word) for word in subprocess.check_output(command, text=True).split()]
        for _ in range(repeats)
    ]
    times = [time for time, _ in runs]
    return {"time": statistics.median(times), "memory": max(memory for _, memory in runs)}


if __name__ == "__main__":
    command_line(main)
