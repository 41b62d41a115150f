"""The page of ``auv-fault diagnose``: a row per log, and figures of some logs."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from auv_fault_env.channels import INDEX
from auv_fault_env.faults import classes
from auv_fault_env.parameters import SIDES
from diagnosers import Belief
from training.field.diagnosis.diagnosis import FAULT, TOP, Verdict
from training.field.diagnosis.estimates import healthy_currents, hull_history
from training.field.logs.log import Log
from training.field.vehicle_file import VehicleFile
from training.report.lines import rounded
from training.report.sections import Section, figure, table_section

POINTS = 1500  # of a line in a figure
PANELS = {
    "speed [m/s]": {"commanded": "speed_command", "speed": "speed"},
    "voltage [V]": {side: f"{side}_voltage" for side in SIDES},
    "shaft [rpm]": {side: f"{side}_rpm" for side in SIDES},
}
LOWEST = -30.0  # decimal logarithm of p(normal) at which the figure ends
LEAST_PROBABILITY = 1e-3  # of a class in the table
COLUMNS = (
    "log, verdict, alarm at [s], fault, severity (95 %), load of the shaft, duration [s], "
    "most probable faults"
).split(", ")
Line = dict[str, list[float | None]]


def page(
    command: str,
    diagnoser: str,
    threshold: float,
    verdicts: Sequence[Verdict],
    figures: Sequence[dict[str, Any]],
) -> dict[str, Any]:
    """The report as plain data; figures are those of `log_figure`."""
    n_faulty = sum(verdict.verdict == FAULT for verdict in verdicts)
    summary = (
        f"{n_faulty} of {len(verdicts)} logs with a fault. Diagnoser: {diagnoser} on the vehicle's "
        f"own parameters; alarm where log p(normal) stays below {threshold:.2f}."
    )
    warning = (
        "A fault outside the catalogue gets the class with the most similar readings. Then the "
        "load of the shafts says more than the class: it does not depend on the catalogue."
    )
    verdict_text = "Times are from the log's start; the rest is from the last moment of an alarm."
    rows = [verdict_row(verdict) for verdict in verdicts]
    figure_text = "Faulty logs first. Dotted: currents of healthy motors. Estimates: ±1 std."
    sections = [
        table_section("Verdicts", COLUMNS, rows, verdict_text),
        {
            "heading": "Logs in detail",
            "text": [figure_text],
            "figures": list(figures),
        },
        remarks_section(verdicts),
    ]
    intro = [summary, warning]
    return {
        "title": "Diagnosis",
        "command": command,
        "intro": intro,
        "sections": sections,
    }


def verdict_row(verdict: Verdict) -> list[str]:
    """A verdict as the cells of the table."""
    severity = ""
    if verdict.severity is not None:
        interval = f"{verdict.severity_low:.2f}–{verdict.severity_high:.2f}"
        severity = f"{verdict.severity:.2f} ({interval})"
    loads = [f"{side} {load:+.0%}" for side, load in (verdict.load or {}).items()]
    top = [f"{name} {share:.2g}" for name, share in verdict.top if share > LEAST_PROBABILITY]
    return [
        verdict.log,
        verdict.verdict,
        "" if verdict.alarm_time is None else f"{verdict.alarm_time:.1f}",
        verdict.fault or "",
        severity,
        ", ".join(loads),
        "" if verdict.duration is None else f"{verdict.duration:.1f}",
        ", ".join(top),
    ]


def remarks_section(verdicts: Sequence[Verdict]) -> Section:
    """What was repaired in the logs, and why some are unusable."""
    rows = [[verdict.log, remark] for verdict in verdicts for remark in verdict.remarks]
    if not rows:
        return {"heading": "Repairs", "text": ["No log had to be repaired."]}
    text = "What was repaired in a log, or why it is unusable."
    return table_section("Repairs", ["log", "remark"], rows, text)


def log_figure(
    number: int,
    verdict: Verdict,
    log: Log,
    belief: Belief,
    threshold: float,
    vehicle: VehicleFile,
) -> dict[str, Any]:
    """The figure of a log as plain data for `write_report`."""
    panels = {label: measured_lines(log, channels) for label, channels in PANELS.items()}
    panels["current [A]"] = current_lines(log, vehicle)
    panels["estimate"] = {
        name: line(log.time, *history) for name, history in hull_history(log, vehicle).items()
    }
    log_probability = belief.log_probability.astype(np.float64)
    log10_normal = np.maximum(log_probability[:, 0] / math.log(10.0), LOWEST)
    log10_threshold = np.full(2, threshold / math.log(10.0))
    panels["log10 p(normal)"] = {
        "belief": line(log.time, log10_normal),
        "threshold": line(log.time[[0, -1]], log10_threshold),
    }
    names = list(classes())
    shown = ["normal", *(name for name, _ in verdict.top[:TOP])]
    panels["probability"] = {
        name: line(log.time, np.exp(log_probability[:, names.index(name)])) for name in shown
    }
    panels = {label: lines for label, lines in panels.items() if lines}
    fault = f", {verdict.fault} from {verdict.alarm_time:.1f} s" if verdict.alarms else ""
    caption = f"{verdict.log}: {verdict.verdict}{fault}."
    data = {"panels": panels, "alarms": [list(alarm) for alarm in verdict.alarms]}
    return figure("diagnosed_log", f"log-{number}", caption, data)


def measured_lines(log: Log, channels: dict[str, str]) -> dict[str, Line]:
    """Lines of the channels with readings, by their name in the panel."""
    lines = {}
    for name, channel in channels.items():
        values = log.observation[:, INDEX[channel]]
        if not np.isnan(values).all():
            lines[name] = line(log.time, values)
    return lines


def current_lines(log: Log, vehicle: VehicleFile) -> dict[str, Line]:
    """Measured currents, and those of healthy motors."""
    lines = measured_lines(log, {side: f"{side}_current" for side in SIDES})
    for side, current in healthy_currents(log, vehicle).items():
        if side in lines:
            lines[f"{side}, healthy"] = line(log.time, current)
    return lines


def line(time: np.ndarray, value: np.ndarray, width: np.ndarray | None = None) -> Line:
    """A line for the figure, of at most `POINTS` points, without missing values."""
    available = np.flatnonzero(~np.isnan(value))
    shown = available[:: -(-available.size // POINTS) or 1]
    columns = {"time": time, "value": value, "width": width}
    return {name: rounded(column[shown]) for name, column in columns.items() if column is not None}
