"""Healthy logs that differ from the others, or from themselves later on, by relations."""

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from diagnosers.relations.windows import BALANCE, PUSH, Layout
from training.field.calibration.mistakes.finding import Finding
from training.field.calibration.mistakes.log_windows import LogWindows, windows_of_logs
from training.field.calibration.mistakes.reference import compared_with, reference_of
from training.field.calibration.mistakes.step import SCATTERS, step_of
from training.field.calibration.relation_fit import layout_of
from training.field.calibration.samples import NORMAL_MAD
from training.field.logs.log import Log
from training.field.vehicle_file import VehicleFile

# Relative changes that no healthy vehicle has within a mission or from one to the next: beyond a
# payload, fouling, a cold seal that runs in, a motor that warms up, another state of the battery.
LEAST_CHANGE = {"push": 0.3, "load": 0.2, "voltage": 0.15, "balance": 0.1}
LEAST_LOAD_BY_SPEED = 0.3  # of a load without a shaft speed, which the drag enters


class Difference(NamedTuple):
    """How far a log is from the relations of the others."""

    log: str
    score: float  # above 1: a difference that no healthy vehicle has
    changes: Mapping[str, float]  # relative, by residual
    time: float | None  # of a step [s]; None if the log differs as a whole


def difference_findings(
    logs: Sequence[Log], vehicle: VehicleFile, left_out: Collection[str]
) -> list[Finding]:
    """Findings on logs; residuals of these names, or of these kinds, are left out.

    The log that differs most is taken out, one with a step first, and the others are compared anew.
    Nothing without the channels of relations.
    """
    layout = layout_of(vehicle)
    if layout is None:
        return []
    left = windows_of_logs(logs, layout)
    limits = limits_of(layout, left_out)
    findings = []
    while left:
        differences = differences_of(left, layout, limits)
        large = [difference for difference in differences if difference.score > 1.0]
        if not large:
            break
        worst = max(large, key=lambda difference: (difference.time is not None, difference.score))
        findings.append(_finding(worst, limits, len(left)))
        left = [one for one in left if one.name != worst.log]
    return findings


def limits_of(layout: Layout, left_out: Collection[str]) -> np.ndarray:
    """Smallest change that counts, by residual (n_residuals,); infinite for those left out."""
    limits = []
    for name in layout.residuals:
        kind = BALANCE if name == BALANCE else name.rpartition("_")[2]
        limit = LEAST_CHANGE[kind]
        if kind == "load" and not layout.has_shaft_speed:
            limit = LEAST_LOAD_BY_SPEED
        limits.append(np.inf if {name, kind} & set(left_out) else limit)
    return np.array(limits)


def differences_of(
    logs: Sequence[LogWindows], layout: Layout, limits: np.ndarray
) -> list[Difference]:
    """Each log against the others; a single one against itself, for a step alone."""
    compared = []
    for log in logs:
        others = [one for one in logs if one is not log] or [log]
        compared.append(compared_with(reference_of(others, layout, limits), log, layout))
    medians = np.array([one.median for one in compared])
    differences = []
    for k, one in enumerate(compared):
        step = step_of(one)
        if step.score > 1.0:
            changes = _by_name(step.change, layout)
            time = float(one.time[step.row])
            differences.append(Difference(logs[k].name, step.score, changes, time))
        else:
            scatter = SCATTERS * _scatter(np.delete(medians, k, axis=0))
            score = np.max(np.abs(one.median) / np.maximum(one.limits, scatter))
            changes = _by_name(one.median, layout)
            differences.append(Difference(logs[k].name, float(score), changes, None))
    return differences


def _by_name(changes: np.ndarray, layout: Layout) -> dict[str, float]:
    return dict(zip(layout.residuals, changes.tolist(), strict=True))


def _scatter(values: np.ndarray) -> np.ndarray:
    """Standard deviation of values (n, n_columns) by column, robust; 0 for fewer than three."""
    if len(values) < 3:
        return np.zeros(values.shape[1])
    return NORMAL_MAD * np.median(np.abs(values - np.median(values, axis=0)), axis=0)


def _finding(difference: Difference, limits: np.ndarray, n_logs: int) -> Finding:
    """The finding on one of so many logs."""
    texts = [
        _text(name, change, difference.time is None)
        for (name, change), limit in zip(difference.changes.items(), limits, strict=True)
        if abs(change) > limit
    ]
    evidence = " and ".join(texts)
    if difference.time is not None:
        evidence += f" at about {difference.time:.0f} s"
        remedy = "leave the log out, or use the part before"
    elif n_logs == 2:
        evidence += " against the other log"
        remedy = "leave out the one that is not healthy"
    else:
        evidence += " against the other logs"
        remedy = "leave the log out"
    return Finding((), evidence, "is it healthy, and its sensors?", remedy, difference.log)


def _text(residual: str, change: float, is_whole: bool) -> str:
    """What has changed, in words; the net force that is lacking is drag."""
    side, _, kind = residual.rpartition("_")
    share = -change if residual == PUSH else change
    things = {
        "push": "the drag",
        "load": f"the load of {side}",
        "voltage": f"the voltage of {side} for its speed",
        "balance": "the voltage of port against starboard",
    }
    verb = "differs" if is_whole else "changes"
    return f"{things[kind]} {verb} by {100 * share:+.0f} %"
