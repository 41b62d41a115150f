"""``auv-fault diagnose``: logs of a vehicle, or its stream on standard input, to verdicts."""

import csv
import shlex
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from auv_fault_env.errors import InputError, refusal
from diagnosers import Belief
from training.arguments import Diagnose
from training.field.diagnosis.diagnosis import (
    FAULT,
    HEALTHY,
    THRESHOLDS,
    UNUSABLE,
    Verdict,
    alarm_along,
    beliefs,
    diagnoser_for,
    persistence,
    verdict,
)
from training.field.diagnosis.load_limits import load_limits, overloaded
from training.field.diagnosis.page import figure, page
from training.field.diagnosis.stream import close_quietly, follow
from training.field.logs.log import Log, read_log
from training.field.vehicle_file import VehicleFile, read_vehicle
from training.metrics import running_maximum
from training.report.page import print_tables, write_report
from training.report.run_folder import run_folder, write_json

Limits = Mapping[str, tuple[float, float]]  # of the shafts' loads, by side
EXIT_CODES = {HEALTHY: 0, UNUSABLE: 2, FAULT: 3}
SHOWN = {FAULT: 12, HEALTHY: 2}  # logs with a figure
CELLS = (
    "log",
    "verdict",
    "alarm_time",
    "fault",
    "side",
    "severity",
    "severity_low",
    "severity_high",
    "duration",
)


def main(arguments: Diagnose) -> int:
    """Diagnose; the exit code is that of the worst verdict: 0 healthy, 2 unusable, 3 a fault."""
    vehicle = read_vehicle(arguments.vehicle)
    diagnoser_for(arguments.diagnoser, vehicle, {})
    if not arguments.follow and not arguments.logs:
        raise refusal(
            "logs", [], "at least one log", "name one, or give --follow to read standard input"
        )
    healthy = [read_log(path, vehicle) for path in arguments.healthy]
    threshold = threshold_of(healthy, arguments.diagnoser, vehicle)
    if arguments.follow:
        alarmed = follow(sys.stdin.buffer, sys.stdout, vehicle, arguments.diagnoser, threshold)
        close_quietly(sys.stdout)
        return EXIT_CODES[FAULT if alarmed else HEALTHY]
    with run_folder(arguments.output, "diagnose", arguments) as folder:
        limits = load_limits(healthy, vehicle)
        verdicts = write_verdicts(folder, arguments, vehicle, threshold, limits)
    print(f"\nreport: {arguments.output / 'index.html'}")
    return max(EXIT_CODES[one.verdict] for one in verdicts)


def threshold_of(healthy: Sequence[Log], name: str, vehicle: VehicleFile) -> float:
    """Threshold of log p(normal): the benchmark's, or lower where the healthy logs come below it."""
    threshold = THRESHOLDS[name]
    for log in healthy:
        log_normal = beliefs(log, name, vehicle).log_probability[:, :1]
        depths = [
            running_maximum(log_normal[segment], persistence(vehicle)).min()
            for segment in log.segments
        ]
        threshold = min(threshold, *map(float, depths))
    return threshold


def write_verdicts(
    folder: Path, arguments: Diagnose, vehicle: VehicleFile, threshold: float, limits: Limits
) -> list[Verdict]:
    """Diagnose every log and write results and report; refused if none is usable."""
    verdicts: list[Verdict] = []
    figures: dict[str, list[dict[str, Any]]] = {FAULT: [], HEALTHY: []}
    for one, log, belief in diagnosed(arguments, vehicle, threshold, limits):
        verdicts.append(one)
        if log is not None and len(figures[one.verdict]) < SHOWN[one.verdict]:
            figures[one.verdict].append(figure(len(verdicts), one, log, belief, threshold, vehicle))
    if all(one.verdict == UNUSABLE for one in verdicts):
        raise InputError("; ".join(one.remarks[0] for one in verdicts))
    options = ["--vehicle", arguments.vehicle, "--diagnoser", arguments.diagnoser, *arguments.logs]
    options += ["--healthy", *arguments.healthy] if arguments.healthy else []
    command = shlex.join(map(str, ("auv-fault", "diagnose", *options)))
    shown = [*figures[FAULT], *figures[HEALTHY]]
    results = page(command, arguments.diagnoser, threshold, verdicts, shown)
    write_json(folder / "results.json", results | {"verdicts": [asdict(one) for one in verdicts]})
    write_csv(folder / "results.csv", verdicts)
    write_report(results, folder)
    print_tables(
        section for section in results["sections"] if section["heading"] != "Logs in detail"
    )
    return verdicts


def diagnosed(
    arguments: Diagnose, vehicle: VehicleFile, threshold: float, limits: Limits
) -> Iterator[tuple[Verdict, Log | None, Belief | None]]:
    """The verdict on every log; with log and beliefs, but for those that are unusable."""
    for path in arguments.logs:
        try:
            log = read_log(path, vehicle)
        except InputError as error:
            yield Verdict(str(path), UNUSABLE, remarks=(str(error),)), None, None
            continue
        belief = beliefs(log, arguments.diagnoser, vehicle)
        standing = alarm_along(log, belief, threshold, persistence(vehicle)) | overloaded(
            log, vehicle, limits
        )
        yield verdict(str(path), log, belief, standing, vehicle), log, belief


def write_csv(path: Path, verdicts: list[Verdict]) -> None:
    """A row per log; empty cells where there is nothing to say."""
    rows = [asdict(one) | {"alarm_time": one.alarm_time} for one in verdicts]
    rows = [{name: _short(row[name]) for name in CELLS} for row in rows]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, CELLS)
        writer.writeheader()
        writer.writerows(rows)


def _short(value: Any) -> Any:
    """A number without the noise of its last digits."""
    return round(value, 4) if isinstance(value, float) else value
