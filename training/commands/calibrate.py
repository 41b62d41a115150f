"""``auv-fault calibrate``: a vehicle file fitted to healthy logs."""

import os
import shlex
import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from tqdm import tqdm

from auv_fault_env.errors import InputError, refusal
from auv_fault_env.printable import printable
from training.arguments import Calibrate
from training.field.calibration.calibration import (
    NAMES,
    Calibration,
    calibrate_samples,
)
from training.field.calibration.checks import leave_one_out
from training.field.calibration.fit_quality import FitQuality, fit_quality
from training.field.calibration.mistakes.finding import Finding
from training.field.calibration.mistakes.search import find_mistakes
from training.field.calibration.mistakes.section import HEADING
from training.field.calibration.page import REPAIRS, page, plain
from training.field.calibration.relation_fit import fit_relations
from training.field.calibration.samples import samples_of
from training.field.logs.log import Log, read_log
from training.field.vehicle_file import VehicleFile, read_vehicle, write_vehicle
from training.report.page import print_tables, write_report
from training.report.run_folder import run_folder, write_json


def main(arguments: Calibrate) -> None:
    """Fit, check, and write vehicle.toml, results and report."""
    if not arguments.logs:
        raise refusal("logs", 0, "at least one healthy log", "name them after the options")
    vehicle, logs = read_inputs(arguments)
    with run_folder(arguments.output, "calibrate", arguments) as folder:
        calibration, quality, results = calibrate(arguments, vehicle, logs)
        vehicle = replace(
            calibration.vehicle, diagnoser=quality.diagnoser, poor_fit=quality.poor_fit
        )
        write_vehicle(folder / "vehicle.toml", vehicle, comments(calibration, quality))
        write_json(folder / "results.json", results)
        write_report(results, folder)
    unprinted = (REPAIRS, HEADING)
    print_tables(one for one in results["sections"] if one["heading"] not in unprinted)
    print(f"\nvehicle file: {arguments.output / 'vehicle.toml'}")
    print(f"report: {arguments.output / 'index.html'}")
    print(quality.line)


def read_inputs(arguments: Calibrate) -> tuple[VehicleFile, list[Log]]:
    """The vehicle file to start from, and the logs with their paths as names."""
    vehicle = read_vehicle(arguments.vehicle)
    if len(set(map(os.path.realpath, arguments.logs))) < len(arguments.logs):
        names = [str(path) for path in arguments.logs]
        raise refusal("logs", names, "each log once", "leave the repetitions out")
    with tqdm(arguments.logs, "reading", unit="log", leave=False, file=sys.stderr) as paths:
        logs = [read_log(path, vehicle)._replace(name=printable(str(path))) for path in paths]
    return vehicle, logs


def calibrate(
    arguments: Calibrate, vehicle: VehicleFile, logs: Sequence[Log]
) -> tuple[Calibration, FitQuality, dict[str, Any]]:
    """The calibration, how well it knows the vehicle, and all results as plain data."""
    findings = find_mistakes(logs, vehicle)
    warn(findings)
    samples = samples_of(logs)
    vehicle = replace(vehicle, relations=fit_relations(logs, vehicle))
    try:
        calibration = calibrate_samples(samples, vehicle)
    except InputError as error:
        raise (_in_doubt(error, findings) if findings else error) from None
    left_out = leave_one_out(samples, calibration, [log.name for log in logs])
    quality = fit_quality(logs, calibration.vehicle).in_doubt([one.subject for one in findings])
    results = page(logs, samples, calibration, left_out, findings)
    results |= plain(calibration, left_out, logs)
    results["mistakes"] = [one._asdict() for one in findings]
    results["summary"].append(f"{quality.line[0].upper()}{quality.line[1:]}.")
    results["fit_quality"] = quality._asdict()
    command = (
        "auv-fault",
        "calibrate",
        "--vehicle",
        arguments.vehicle,
        *arguments.logs,
    )
    results["command"] = printable(shlex.join(map(str, command)))
    return calibration, quality, results


def _in_doubt(error: InputError, findings: Sequence[Finding]) -> InputError:
    """The refusal of a fit whose likely cause are mistakes that were warned of."""
    subjects = ", ".join(dict.fromkeys(one.subject for one in findings))
    return InputError(f"the fit fails ({error}); settle the warnings on {subjects} first")


def warn(findings: Sequence[Finding]) -> None:
    """Print the findings; one that leaves the fit without a meaning is an `InputError`."""
    fatal = next((one for one in findings if one.is_fatal), None)
    for one in findings:
        if one is not fatal:
            print(f"auv-fault calibrate: warning: {one}", file=sys.stderr)
    if fatal is not None:
        raise InputError(str(fatal))


def comments(calibration: Calibration, quality: FitQuality) -> dict[str, str]:
    """The comments of the vehicle file: on each fitted parameter, and on the diagnoser."""
    notes: dict[str, str] = {}
    for name in filter(calibration.is_fitted, NAMES):
        parameter = calibration.parameter(name)
        if name == "propeller_torque":
            interval = f"{parameter.low:.4g} to {parameter.high:.4g} times the former value"
            notes |= dict.fromkeys(("parameters.c1", "parameters.c2"), interval)
        else:
            notes[f"parameters.{name}"] = f"{parameter.low:.5g} to {parameter.high:.5g}"
    fitted = {key: f"fitted, 95 % interval {interval}" for key, interval in notes.items()}
    reached = {f"parameters.{key}": "reached in the healthy logs" for key in calibration.reached}
    return fitted | reached | {"vehicle.diagnoser": quality.line}
