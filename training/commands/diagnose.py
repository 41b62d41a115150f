"""``auv-fault diagnose``: verdicts on the logs of a vehicle, or on its stream on standard input."""

import csv
import shlex
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.errors import InputError, refusal
from auv_fault_env.printable import printable
from diagnosers.residuals import Residuals
from training.arguments import Diagnose
from training.field.calibration.sensitivity import described, with_healthy_logs
from training.field.diagnosis.causes import causes
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
from training.field.diagnosis.indicators import course_of, indicators_during
from training.field.diagnosis.load_limits import Limits, is_overloaded, load_limits
from training.field.diagnosis.log_figure import DiagnosedLog, log_figure
from training.field.diagnosis.page import POOR_FIT, REPAIRS, VERDICTS, Setting, page
from training.field.diagnosis.stream import close_quietly, follow
from training.field.logs.files import first_bytes
from training.field.logs.log import Log, read_log
from training.field.logs.plausible import other_unit
from training.field.vehicle_file import VehicleFile, read_vehicle, unit_of
from training.metrics import running_maximum
from training.report.cells import distinct_names
from training.report.page import print_tables, write_report
from training.report.run_folder import run_folder, write_json
from training.terminal import without_guard

EXIT_CODES = {HEALTHY: 0, UNUSABLE: 2, FAULT: 3}
MOST_FIGURES = {FAULT: 12, HEALTHY: 2}  # of logs, by verdict
# log p(normal) of a threshold: simulated vehicles with severe faults are at -8 to -15
LEAST_THRESHOLD = -15.0
CELLS = "log verdict alarm_time fault side severity severity_low severity_high duration".split()
CELLS += ["raised_by"]  # of the last alarm


def main(arguments: Diagnose) -> int:
    """Diagnose; the exit code is that of the worst verdict: 0 healthy, 2 unusable, 3 a fault."""
    vehicle = read_vehicle(arguments.vehicle)
    if vehicle.poor_fit:
        print(f"auv-fault diagnose: warning: {POOR_FIT}: {vehicle.poor_fit}", file=sys.stderr)
    why = "as `--diagnoser` says" if arguments.diagnoser else "as the vehicle file says"
    arguments = replace(arguments, diagnoser=arguments.diagnoser or vehicle.diagnoser)
    weights = arguments.weights
    diagnoser_for(arguments.diagnoser, vehicle, {}, weights)
    if not arguments.follow and not arguments.logs:
        remedy = "name one, or add --follow to read standard input"
        raise refusal("logs", [], "at least one log", remedy)
    if arguments.follow and arguments.logs:
        remedy = "leave them out, or leave out --follow"
        shown = " ".join(map(str, arguments.logs))
        raise refusal("logs", shown, "none with --follow, which reads standard input", remedy)
    require_one_of(arguments.logs)
    healthy_logs = [read_checked(path, vehicle) for path in arguments.healthy]
    if arguments.diagnoser == Residuals.name:
        vehicle = replace(vehicle, relations=with_healthy_logs(vehicle.relations, healthy_logs))
        healthy_logs = []
        changes = described(vehicle.relations.smallest_changes())
        output = sys.stderr if arguments.follow else sys.stdout
        print(f"residuals finds lasting changes from: {changes}", file=output)
    threshold = threshold_of(healthy_logs, arguments.diagnoser, vehicle, weights)
    if arguments.follow:
        return EXIT_CODES[follow_input(vehicle, arguments.diagnoser, threshold, weights)]
    limits = load_limits(healthy_logs, vehicle)
    setting = Setting(
        command_of(arguments), arguments.diagnoser, why, threshold, vehicle, bool(limits), weights
    )
    with run_folder(arguments.output, "diagnose", arguments) as folder:
        verdicts = write_verdicts(folder, arguments.logs, setting, limits)
    print(f"\nreport: {arguments.output / 'index.html'}")
    return max(EXIT_CODES[verdict.verdict] for verdict in verdicts)


def require_one_of(paths: Sequence[Path]) -> None:
    """Refuse logs of which none can be opened; where some can, the others get a verdict each."""
    errors = []
    for path in paths:
        try:
            first_bytes(path)
        except InputError as error:
            errors.append(str(error))
    if errors and len(errors) == len(paths):
        raise InputError("; ".join(errors))


def read_checked(path: Path, vehicle: VehicleFile) -> Log:
    """A log to be diagnosed: refused if a channel is almost surely in another unit.

    Its verdict would be confident and wrong.
    """
    log = read_log(path, vehicle)
    values = {channel: log.observation[:, INDEX[channel]] for channel in vehicle.columns}
    found = other_unit(values, vehicle)
    if found is not None:
        channel, unit = found
        now = unit_of(vehicle.columns[channel], CHANNELS[channel].unit)
        raise refusal(
            f"unit of {channel} in {log.name}",
            now,
            f"{unit}, with which speed, voltages and shaft speeds agree throughout the log",
            f'write unit = "{unit}" in [channels.{channel}] for this log',
        )
    return log


def follow_input(
    vehicle: VehicleFile, name: str, threshold: float, weights: Path | None = None
) -> str:
    """Answer standard input line by line on standard output; the verdict at the end."""
    if sys.stdin is None:
        raise refusal("standard input", None, "a stream of lines", "pipe the logger into it")
    # a lost reader ends the command, and is not waited out
    sink = without_guard(sys.stdout)
    try:
        alarmed = follow(sys.stdin.buffer, sink, vehicle, name, threshold, sys.stderr, weights)
        close_quietly(sink)
    except OSError as error:
        allowed = "standard input and output that work"
        raise refusal("stream", error.strerror, allowed, "check where they lead") from None
    return FAULT if alarmed else HEALTHY


def threshold_of(
    healthy_logs: Sequence[Log], name: str, vehicle: VehicleFile, weights: Path | None = None
) -> float:
    """Threshold of log p(normal): the benchmark's, or the lowest value on the healthy logs.

    `InputError` for a log that would lower it below `LEAST_THRESHOLD`.
    """
    threshold = THRESHOLDS[name]
    for log in healthy_logs:
        log_normal = beliefs(log, name, vehicle, weights).log_probability[:, :1]
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
    folder: Path, paths: Sequence[Path], setting: Setting, limits: Limits
) -> list[Verdict]:
    """Diagnose every log and write results and report; refused if none is usable."""
    verdicts: list[Verdict] = []
    figures: dict[str, list[dict[str, Any]]] = {FAULT: [], HEALTHY: []}
    names = distinct_names([printable(str(path)) for path in paths])
    for name, one in zip(names, diagnosed(paths, setting, limits), strict=True):
        verdicts.append(one.verdict)
        kind = one.verdict.verdict
        if one.log is not None and len(figures[kind]) < MOST_FIGURES[kind]:
            figures[kind].append(log_figure(len(verdicts), name, one, setting))
    if all(verdict.verdict == UNUSABLE for verdict in verdicts):
        raise InputError("; ".join(verdict.remarks[0] for verdict in verdicts))
    results = page(setting, verdicts, [*figures[FAULT], *figures[HEALTHY]])
    plain_verdicts = [asdict(verdict) for verdict in verdicts]
    write_json(folder / "results.json", results | {"verdicts": plain_verdicts})
    write_csv(folder / "results.csv", verdicts)
    write_report(results, folder)
    sections = [one for one in results["sections"] if one["heading"] in (VERDICTS, REPAIRS)]
    print_tables(sections, whole=True)
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
    if arguments.weights:
        options += ["--weights", arguments.weights]
    if arguments.healthy:
        options += ["--healthy", *arguments.healthy]
    return printable(shlex.join(map(str, ("auv-fault", "diagnose", *options))))


def diagnosed(paths: Sequence[Path], setting: Setting, limits: Limits) -> Iterator[DiagnosedLog]:
    """Every log with its verdict."""
    for path in paths:
        try:
            log = read_checked(path, setting.vehicle)
        except InputError as error:
            yield DiagnosedLog(Verdict(printable(str(path)), UNUSABLE, remarks=(str(error),)))
        else:
            yield diagnosed_log(printable(str(path)), log, setting, limits)


def diagnosed_log(path: str, log: Log, setting: Setting, limits: Limits) -> DiagnosedLog:
    """The verdict on a log, with the cause of each alarm and the indicators in the last one."""
    vehicle = setting.vehicle
    belief = beliefs(log, setting.diagnoser, vehicle, setting.weights)
    is_improbable = is_alarmed(log, belief, setting.threshold, persistence(vehicle))
    alarmed = is_improbable | is_overloaded(log, vehicle, limits)
    found = verdict(path, log, belief, alarmed, vehicle)
    course = None if vehicle.relations is None else course_of(log, vehicle.relations)
    by_rules = course if setting.diagnoser == Residuals.name else None
    found = replace(found, raised_by=causes(log, found.alarms, belief, is_improbable, by_rules))
    if found.alarms and course is not None:
        found = replace(found, indicators=indicators_during(course, *found.alarms[-1]))
    return DiagnosedLog(found, log, belief, course)


def write_csv(path: Path, verdicts: list[Verdict]) -> None:
    """A row per log; empty cells where a verdict has no value."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, CELLS)
        writer.writeheader()
        for verdict in verdicts:
            rule = verdict.raised_by[-1].rule if verdict.raised_by else None
            row = asdict(verdict) | {"alarm_time": verdict.alarm_time, "raised_by": rule}
            writer.writerow({name: _rounded(row[name]) for name in CELLS})


def _rounded(value: Any) -> Any:
    return round(value, 4) if isinstance(value, float) else value
