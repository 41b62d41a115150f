"""The figure of a diagnosed log: readings, indicators, distance to the threshold, belief."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from auv_fault_env.channels import INDEX
from auv_fault_env.faults import NORMAL, classes
from auv_fault_env.parameters import SIDES
from diagnosers import Belief
from diagnosers.residuals import Residuals
from training.field.diagnosis.diagnosis import Verdict
from training.field.diagnosis.estimates import healthy_currents, hull_history
from training.field.diagnosis.indicators import Indicator, LogCourse, indicators
from training.field.diagnosis.page import Setting
from training.field.logs.log import Log
from training.field.vehicle_file import VehicleFile
from training.report.lines import rounded
from training.report.sections import figure

POINTS = 1500  # of a line in a figure
PANELS = {
    "speed [m/s]": {"commanded": "speed_command", "speed": "speed"},
    "voltage [V]": {side: f"{side}_voltage" for side in SIDES},
    "shaft [rpm]": {side: f"{side}_rpm" for side in SIDES},
}
LOWEST = 1e-4  # p(normal) at which the figure ends, unless the threshold is near it or below
NORMAL_PANEL = "p(normal)"
LARGEST_STRENGTH = 5.0  # at which the figure ends
LARGEST_CHANGE = 2.0  # of an indicator, at which its line ends
BREAK = 1.5  # distances between windows; a line does not go on beyond it
Line = dict[str, list[float | None]]


class DiagnosedLog(NamedTuple):
    """A verdict with log and beliefs, which an unusable log does not have."""

    verdict: Verdict
    log: Log | None = None
    belief: Belief | None = None
    course: LogCourse | None = None  # of the vehicle's relations, if it has any


def log_figure(number: int, name: str, one: DiagnosedLog, setting: Setting) -> dict[str, Any]:
    """The figure of a log as plain data for `write_report`; name is that of the log."""
    verdict, log, belief, course = one
    panels = {label: measured_lines(log, channels) for label, channels in PANELS.items()}
    panels["current [A]"] = current_lines(log, setting.vehicle)
    if course is None:
        panels["estimate"] = {
            of: line(log.time, *history)
            for of, history in hull_history(log, setting.vehicle).items()
        }
    else:
        for of, indicator in indicators(course).items():
            panels[f"{of} [%]"] = {f"{of} ± 1 std": indicator_line(indicator, course.step)}
    if setting.diagnoser == Residuals.name:
        panels["strength, 1 = limit"] = strength_lines(log, course)
    else:
        panels[NORMAL_PANEL] = probability_lines(log, belief, setting.threshold)
    if verdict.alarms:
        panels["probability"] = class_lines(verdict, log, belief)
    panels = {label: lines for label, lines in panels.items() if lines}
    fault = f", {verdict.fault} from {verdict.alarm_time:.1f} s" if verdict.alarms else ""
    caption = f"{name}, {verdict.duration:.0f} s: {verdict.verdict}{fault}."
    alarms = [list(alarm) for alarm in verdict.alarms]
    data = {"panels": panels, "alarms": alarms, "logarithmic": [NORMAL_PANEL]}
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


def probability_lines(log: Log, belief: Belief, threshold: float) -> dict[str, Line]:
    """The probability of `normal`, from `LOWEST` on, and its threshold."""
    lowest = min(math.log(LOWEST), threshold - math.log(10.0))
    log_normal = belief.log_probability[:, 0].astype(np.float64)
    return {
        NORMAL: line(log.time, np.exp(np.maximum(log_normal, lowest))),
        "threshold": constant_line(log, math.exp(threshold)),
    }


def strength_lines(log: Log, course: LogCourse) -> dict[str, Line]:
    """How far beyond its limit the strongest rule has stayed, 1 at the limit."""
    strongest = np.minimum(course.strength.max(axis=1, initial=0.0), LARGEST_STRENGTH)
    return {
        "strongest rule": broken_line(course.time, course.step, {"value": strongest}),
        "threshold": constant_line(log, 1.0),
    }


def class_lines(verdict: Verdict, log: Log, belief: Belief) -> dict[str, Line]:
    """The probabilities of `normal` and of the most probable faults."""
    names = list(classes())
    shown = [names[0], *(name for name, _ in verdict.top)]
    probability = np.exp(belief.log_probability.astype(np.float64))
    return {name: line(log.time, probability[:, names.index(name)]) for name in shown}


def indicator_line(indicator: Indicator, step: float) -> Line:
    """An indicator in per cent, its std as the width, and its healthy band."""
    value = np.clip(indicator.value, -LARGEST_CHANGE, LARGEST_CHANGE)
    columns = {"value": value, "width": indicator.std, "limit": indicator.limit}
    in_percent = {name: 100.0 * column for name, column in columns.items()}
    return broken_line(indicator.time, step, in_percent)


def line(time: np.ndarray, value: np.ndarray, width: np.ndarray | None = None) -> Line:
    """A line for the figure, of at most `POINTS` points, without missing values."""
    available = np.flatnonzero(~np.isnan(value))
    shown = available[:: -(-available.size // POINTS) or 1]
    columns = {"time": time, "value": value, "width": width}
    return {name: rounded(column[shown]) for name, column in columns.items() if column is not None}


def broken_line(time: np.ndarray, step: float, columns: Mapping[str, np.ndarray]) -> Line:
    """A line of windows a step [s] apart, of at most `POINTS` points, broken where they are not."""
    every = -(-time.size // POINTS) or 1
    shown = slice(None, None, every)
    breaks = 1 + np.flatnonzero(np.diff(time[shown]) > BREAK * every * step)
    return {
        name: rounded(np.insert(column[shown].astype(float), breaks, np.nan))
        for name, column in {"time": time, **columns}.items()
    }


def constant_line(log: Log, value: float) -> Line:
    """A value from begin to end of the log."""
    return line(log.time[[0, -1]], np.full(2, value))
