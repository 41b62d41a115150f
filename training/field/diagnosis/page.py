"""The page of ``auv-fault diagnose``: a row per log, and of some logs what was measured, estimated and believed."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from auv_fault_env.channels import INDEX
from auv_fault_env.faults import classes
from auv_fault_env.parameters import SIDES
from diagnosers import Belief
from training.field.diagnosis.diagnosis import FAULT, TOP, Verdict
from training.field.diagnosis.estimates import healthy_currents, hull_estimates
from training.field.logs.log import Log
from training.field.vehicle_file import VehicleFile

POINTS = 1500  # of a line in a figure
PANELS = {
    "speed [m/s]": {"commanded": "speed_command", "speed": "speed"},
    "voltage [V]": {side: f"{side}_voltage" for side in SIDES},
    "shaft [rpm]": {side: f"{side}_rpm" for side in SIDES},
}
CERTAIN = -30.0  # decimal logarithm of p(normal) at which the figure ends
WORTH_TELLING = 1e-3  # probability
COLUMNS = [
    "log",
    "verdict",
    "alarm at [s]",
    "fault",
    "severity (95 %)",
    "load of the shaft",
    "duration [s]",
]


def page(
    command: str,
    diagnoser: str,
    threshold: float,
    verdicts: Sequence[Verdict],
    figures: Sequence[dict[str, Any]],
) -> dict[str, Any]:
    """The report as plain data; figures are those of `figure`."""
    found = sum(one.verdict == FAULT for one in verdicts)
    return {
        "title": "Diagnosis",
        "command": command,
        "intro": [
            f"{found} of {len(verdicts)} logs with a fault. Diagnoser: {diagnoser} on the vehicle's own parameters; "
            f"alarm where log p(normal) stays below {threshold:.2f}.",
            "A fault outside the catalogue is given the class that it looks most like: then the load of the shafts, "
            "which takes nothing from the catalogue, says more than the class does.",
        ],
        "sections": [
            {
                "heading": "Verdicts",
                "text": [
                    "Times are from the log's start; the rest is from the last moment of an alarm."
                ],
                "table": {
                    "columns": [*COLUMNS, "most probable faults"],
                    "rows": [row(one) for one in verdicts],
                },
            },
            {
                "heading": "Logs in detail",
                "text": [
                    "Faulty logs first. Dotted: currents of healthy motors. Estimates: relative, ±1 std."
                ],
                "figures": list(figures),
            },
            repairs(verdicts),
        ],
    }


def row(one: Verdict) -> list[str]:
    """A verdict as the cells of the table."""
    interval = (
        ""
        if one.severity is None
        else f"{one.severity:.2f} ({one.severity_low:.2f}–{one.severity_high:.2f})"
    )
    return [
        one.log,
        one.verdict,
        "" if one.alarm_time is None else f"{one.alarm_time:.1f}",
        one.fault or "",
        interval,
        ", ".join(f"{side} {load:+.0%}" for side, load in (one.load or {}).items()),
        "" if one.duration is None else f"{one.duration:.1f}",
        ", ".join(f"{name} {share:.2g}" for name, share in one.top if share > WORTH_TELLING),
    ]


def repairs(verdicts: Sequence[Verdict]) -> dict[str, Any]:
    """What was repaired in the logs, and why some are unusable."""
    rows = [[one.log, remark] for one in verdicts for remark in one.remarks]
    text = "What was done to a log before it was read, or why it could not be."
    return {
        "heading": "Repairs",
        "text": [text if rows else "No log had to be repaired."],
        **({"table": {"columns": ["log", "remark"], "rows": rows}} if rows else {}),
    }


def figure(
    number: int, one: Verdict, log: Log, belief: Belief, threshold: float, vehicle: VehicleFile
) -> dict[str, Any]:
    """The figure of a log as plain data for `report.write_report`."""
    panels = {label: measured(log, lines) for label, lines in PANELS.items()}
    panels["current [A]"] = currents(log, vehicle)
    panels["estimate"] = {
        name: line(log.time, part.mean, part.std)
        for name, part in hull_estimates(log, vehicle).items()
    }
    depth = belief.log_probability[:, 0].astype(np.float64) / math.log(10.0)
    panels["log10 p(normal)"] = {"belief": line(log.time, np.maximum(depth, CERTAIN))} | {
        "threshold": line(log.time[[0, -1]], np.full(2, threshold / math.log(10.0)))
    }
    names = list(classes())
    panels["probability"] = {
        name: line(
            log.time, np.exp(belief.log_probability[:, names.index(name)].astype(np.float64))
        )
        for name in ("normal", *(name for name, _ in one.top[:TOP]))
    }
    panels = {label: lines for label, lines in panels.items() if lines}
    caption = f"{one.log}: {one.verdict}" + (
        f", {one.fault} from {one.alarm_time:.1f} s." if one.alarms else "."
    )
    data = {"panels": panels, "alarms": [list(alarm) for alarm in one.alarms]}
    return {"plot": "diagnosed_log", "name": f"log-{number}", "caption": caption, "data": data}


def measured(log: Log, channels: dict[str, str]) -> dict[str, Any]:
    """Lines of the channels that were read, by their name in the panel."""
    columns = {name: log.observation[:, INDEX[channel]] for name, channel in channels.items()}
    return {
        name: line(log.time, values)
        for name, values in columns.items()
        if not np.isnan(values).all()
    }


def currents(log: Log, vehicle: VehicleFile) -> dict[str, Any]:
    """Measured currents, and what healthy motors would draw."""
    lines = measured(log, {side: f"{side}_current" for side in SIDES})
    drawn = {
        side: values for side, values in healthy_currents(log, vehicle).items() if side in lines
    }
    return lines | {f"{side}, healthy": line(log.time, values) for side, values in drawn.items()}


def line(
    time: np.ndarray, value: np.ndarray, width: np.ndarray | None = None
) -> dict[str, list[float]]:
    """A line for the figure, of so many points at most, without those that were not read."""
    heard = np.flatnonzero(~np.isnan(value))
    shown = heard[:: -(-heard.size // POINTS) or 1]
    parts = {"time": time, "value": value} | ({} if width is None else {"width": width})
    return {
        name: [float(f"{number:.6g}") for number in part[shown]] for name, part in parts.items()
    }
