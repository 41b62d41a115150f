"""``auv-fault diagnose``: verdicts on the logs of a vehicle, or on its stream on standard input."""

import csv
import shlex
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, NamedTuple

from auv_fault_env.errors import InputError, refusal
from diagnosers import Belief
from diagnosers.residuals import Residuals
from training.arguments import Diagnose
from training.field.calibration.sensitivity import described, with_healthy_logs
from training.field.diagnosis.diagnosis import (
    FAULT,
    HEALTHY,
    THRESHOLDS,
    UNUSABLE,
    Verdict,
    beliefs,
    diagnoser_for,
    is_alarmed,
    persistence,
    verdict,
)
from training.field.diagnosis.load_limits import Limits, is_overloaded, load_limits
from training.field.diagnosis.page import log_figure, page
from training.field.diagnosis.stream import close_quietly, follow
from training.field.logs.log import Log, read_log
from training.field.vehicle_file import VehicleFile, read_vehicle
from training.metrics import running_maximum
from training.report.page import print_tables, write_report
from training.report.run_folder import run_folder, write_json

EXIT_CODES = {HEALTHY: 0, UNUSABLE: 2, FAULT: 3}
MOST_FIGURES = {FAULT: 12, HEALTHY: 2}  # of logs, by verdict
# log p(normal) of a threshold: simulated vehicles with severe faults are at -8 to -15
LEAST_THRESHOLD = -15.0
CELLS = "log verdict alarm_time fault side severity severity_low severity_high duration".split()


class DiagnosedLog(NamedTuple):
    """A verdict with log and beliefs, which an unusable log does not have."""

    verdict: Verdict
    log: Log | None = None
    belief: Belief | None = None


def main(arguments: Diagnose) -> int:
    """Diagnose; the exit code is that of the worst verdict: 0 healthy, 2 unusable, 3 a fault."""
    vehicle = read_vehicle(arguments.vehicle)
    arguments = replace(arguments, diagnoser=arguments.diagnoser or vehicle.diagnoser)
    diagnoser_for(arguments.diagnoser, vehicle, {})
    if not arguments.follow and not arguments.logs:
        remedy = "name one, or add --follow to read standard input"
        raise refusal("logs", [], "at least one log", remedy)
    healthy_logs = [read_log(path, vehicle) for path in arguments.healthy]
    if arguments.diagnoser == Residuals.name:
        vehicle = replace(vehicle, relations=with_healthy_logs(vehicle.relations, healthy_logs))
        healthy_logs = []
        changes = described(vehicle.relations.smallest_changes())
        output = sys.stderr if arguments.follow else sys.stdout
        print(f"residuals finds lasting changes from: {changes}", file=output)
    threshold = threshold_of(healthy_logs, arguments.diagnoser, vehicle)
    if arguments.follow:
        alarmed = follow(sys.stdin.buffer, sys.stdout, vehicle, arguments.diagnoser, threshold)
        close_quietly(sys.stdout)
        return EXIT_CODES[FAULT if alarmed else HEALTHY]
    with run_folder(arguments.output, "diagnose", arguments) as folder:
        limits = load_limits(healthy_logs, vehicle)
        verdicts = write_verdicts(folder, arguments, vehicle, threshold, limits)
    print(f"\nreport: {arguments.output / 'index.html'}")
    return max(EXIT_CODES[verdict.verdict] for verdict in verdicts)


def threshold_of(healthy_logs: Sequence[Log], name: str, vehicle: VehicleFile) -> float:
    """Threshold of log p(normal): the benchmark's, or the lowest value on the healthy logs.

    `InputError` for a log that would lower it below `LEAST_THRESHOLD`.
    """
    threshold = THRESHOLDS[name]
    for log in healthy_logs:
        log_normal = beliefs(log, name, vehicle).log_probability[:, :1]
        for segment in log.segments:
            lasting = running_maximum(log_normal[segment], persistence(vehicle))[:, 0]
            lowest = float(lasting.min())
            if lowest < LEAST_THRESHOLD:
                time = float(log.time[segment][lasting.argmin()])
                raise too_improbable(log, lowest, time, vehicle)
            threshold = min(threshold, lowest)
    return threshold


def too_improbable(log: Log, lowest: float, time: float, vehicle: VehicleFile) -> InputError:
    """The refusal of a healthy log for its lowest log p(normal), reached at a time [s]."""
    allowed = (
        f"{LEAST_THRESHOLD:g} or more: with a lower threshold most faults would raise no alarm"
    )
    remedy = "leave the log out of --healthy, or calibrate with it"
    if vehicle.relations is not None:
        remedy = f"the model does not explain the log: add --diagnoser {Residuals.name}"
    got = f"log p(normal) of {lowest:.0f} at {time:.0f} s"
    return refusal(f"healthy log {log.name}", got, allowed, remedy)


def write_verdicts(
    folder: Path,
    arguments: Diagnose,
    vehicle: VehicleFile,
    threshold: float,
    limits: Limits,
) -> list[Verdict]:
    """Diagnose every log and write results and report; refused if none is usable."""
    verdicts: list[Verdict] = []
    figures: dict[str, list[dict[str, Any]]] = {FAULT: [], HEALTHY: []}
    for one_verdict, log, belief in diagnosed(arguments, vehicle, threshold, limits):
        verdicts.append(one_verdict)
        kind = one_verdict.verdict
        if log is not None and len(figures[kind]) < MOST_FIGURES[kind]:
            number = len(verdicts)
            figure = log_figure(number, one_verdict, log, belief, threshold, vehicle)
            figures[kind].append(figure)
    if all(verdict.verdict == UNUSABLE for verdict in verdicts):
        raise InputError("; ".join(verdict.remarks[0] for verdict in verdicts))
    shown = [*figures[FAULT], *figures[HEALTHY]]
    results = page(command_of(arguments), arguments.diagnoser, threshold, verdicts, shown)
    plain_verdicts = [asdict(verdict) for verdict in verdicts]
    write_json(folder / "results.json", results | {"verdicts": plain_verdicts})
    write_csv(folder / "results.csv", verdicts)
    write_report(results, folder)
    sections = results["sections"]
    print_tables(section for section in sections if section["heading"] != "Logs in detail")
    return verdicts


def command_of(arguments: Diagnose) -> str:
    """The command line that makes the same page."""
    options = [
        "--vehicle",
        arguments.vehicle,
        "--diagnoser",
        arguments.diagnoser,
        *arguments.logs,
    ]
    if arguments.healthy:
        options += ["--healthy", *arguments.healthy]
    return shlex.join(map(str, ("auv-fault", "diagnose", *options)))


def diagnosed(
    arguments: Diagnose, vehicle: VehicleFile, threshold: float, limits: Limits
) -> Iterator[DiagnosedLog]:
    """Every log with its verdict."""
    for path in arguments.logs:
        try:
            log = read_log(path, vehicle)
        except InputError as error:
            yield DiagnosedLog(Verdict(str(path), UNUSABLE, remarks=(str(error),)))
            continue
        belief = beliefs(log, arguments.diagnoser, vehicle)
        alarmed = is_alarmed(log, belief, threshold, persistence(vehicle))
        alarmed |= is_overloaded(log, vehicle, limits)
        yield DiagnosedLog(verdict(str(path), log, belief, alarmed, vehicle), log, belief)


def write_csv(path: Path, verdicts: list[Verdict]) -> None:
    """A row per log; empty cells where a verdict has no value."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, CELLS)
        writer.writeheader()
        for verdict in verdicts:
            row = asdict(verdict) | {"alarm_time": verdict.alarm_time}
            writer.writerow({name: _rounded(row[name]) for name in CELLS})


def _rounded(value: Any) -> Any:
    return round(value, 4) if isinstance(value, float) else value
