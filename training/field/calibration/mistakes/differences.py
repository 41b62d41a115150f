"""Healthy logs that differ from the others, or from themselves later on, by relations."""

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import INDEX
from diagnosers.relations.episode import EpisodeWindows, episode_windows
from diagnosers.relations.model import residuals_of
from diagnosers.relations.windows import BALANCE, DURATION, PUSH, Layout, Windows, is_under_way
from training.field.calibration.mistakes.finding import Finding
from training.field.calibration.relation_fit import layout_of, rows_of
from training.field.calibration.samples import NORMAL_MAD
from training.field.logs.log import Log
from training.field.vehicle_file import VehicleFile
from training.learning.relation_fit import (
    FLOOR,
    fit_relation,
    median_sizes,
    typical_of,
)

# Relative changes that no healthy vehicle has within a mission or from one to the next: beyond a
# payload, fouling, a cold seal that runs in, a motor that warms up, another state of the battery.
LEAST_CHANGE = {"push": 0.3, "load": 0.2, "voltage": 0.15, "balance": 0.1}
LEAST_LOAD_BY_SPEED = 0.3  # of a load without a shaft speed, which the drag enters
SCATTERS = 3.0  # standard deviations of the residual, beyond which a change counts
LEAST_WINDOWS = 60  # a minute before and after a step
MOST_STEPS = 100  # that are tried in a log
BEYOND = 0.05  # of the other logs' range of speeds, within which their relations hold
# largest command by smallest one, from which drag is known, and relations beyond their range
WIDE = 1.5


class LogWindows(NamedTuple):
    """The windows of one log."""

    name: str
    parts: list[EpisodeWindows]
    times: list[np.ndarray]  # of the middle of each part's windows [s]
    commands: list[np.ndarray]  # of the speed at the end of each part's windows [m/s]


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


def windows_of_logs(logs: Sequence[Log], layout: Layout) -> list[LogWindows]:
    """The windows of the logs that have enough of them."""
    rows_by_log = [rows_of(log, layout) for log in logs]
    readings = [rows.reading for parts in rows_by_log for rows in parts]
    found = []
    if not any(is_under_way(reading).any() for reading in readings):
        return found
    typical = {side: typical_of(readings, side) for side in layout.sides}
    for log, log_rows in zip(logs, rows_by_log, strict=True):
        parts = []
        times = []
        commands = []
        for rows in log_rows:
            part = episode_windows(rows.reading, layout, typical)
            if part.last.size:
                parts.append(part)
                times.append(rows.time[part.last] - DURATION / 2.0)
                commands.append(rows.reading[part.last, INDEX["mission_speed"]])
        if sum(map(len, times)) >= 2 * LEAST_WINDOWS:
            found.append(LogWindows(log.name, parts, times, commands))
    return found


def differences_of(
    logs: Sequence[LogWindows], layout: Layout, limits: np.ndarray
) -> list[Difference]:
    """Each log against the others; a single one against itself, for a step alone."""
    residuals = []
    for log in logs:
        others = [one for one in logs if one is not log] or [log]
        residuals.append(relative_residuals(log, others, layout))
    medians = np.array([np.median(residual, axis=0) for residual, _ in residuals])
    differences = []
    for k, log in enumerate(logs):
        residual, time = residuals[k]
        step = step_of(residual, limits)
        if step.score > 1.0:
            changes = _by_name(step.change, layout)
            differences.append(Difference(log.name, step.score, changes, float(time[step.row])))
        else:
            scatter = SCATTERS * _scatter(np.delete(medians, k, axis=0))
            score = np.max(np.abs(medians[k]) / np.maximum(limits, scatter))
            changes = _by_name(medians[k], layout)
            differences.append(Difference(log.name, float(score), changes, None))
    return differences


def _by_name(changes: np.ndarray, layout: Layout) -> dict[str, float]:
    return dict(zip(layout.residuals, changes.tolist(), strict=True))


def _scatter(values: np.ndarray) -> np.ndarray:
    """Standard deviation of values (n, n_columns) by column, robust; 0 for fewer than three."""
    if len(values) < 3:
        return np.zeros(values.shape[1])
    return NORMAL_MAD * np.median(np.abs(values - np.median(values, axis=0)), axis=0)


def relative_residuals(
    log: LogWindows, others: Sequence[LogWindows], layout: Layout
) -> tuple[np.ndarray, np.ndarray]:
    """Residuals (n, n_residuals) of a log by the relations of others, relative, and times (n,).

    Windows at speeds that the others do not have are left out, unless the others have the command
    and several more.
    """
    parts = [part for other in others for part in other.parts]
    coefficients = {name: fit_relation(name, parts, layout) for name in layout.relations}
    least = FLOOR * np.array(list(median_sizes(parts, coefficients, layout).values()))
    speeds = _range_of(np.concatenate([_speeds(part.windows) for part in parts]))
    commands = _range_of(np.concatenate([one for other in others for one in other.commands]))
    is_wide = commands.high > WIDE * commands.low
    residuals = []
    times = []
    for part, time, command in zip(log.parts, log.times, log.commands, strict=True):
        residual, size = residuals_of(layout, coefficients, part.windows)
        is_known = speeds.has(_speeds(part.windows)).all(axis=1)
        if is_wide:
            is_known |= commands.has(command)
        residuals.append((residual / np.maximum(size, least))[is_known])
        times.append(time[is_known])
    residual = np.concatenate(residuals)
    if not is_wide and PUSH in layout.residuals:
        residual[:, layout.residuals.index(PUSH)] = 0.0  # thrust and drag cannot be told apart
    return residual, np.concatenate(times)


def _speeds(windows: Windows) -> np.ndarray:
    """Speed and shaft speeds of windows, (n, n_quantities); 0 for one that is not read."""
    shafts = [np.nan_to_num(shaft) for shaft in windows.shaft_speed.values()]
    return np.stack([windows.speed, *shafts], axis=1)


class Range(NamedTuple):
    """The range of some quantities."""

    low: np.ndarray
    high: np.ndarray

    def has(self, values: np.ndarray) -> np.ndarray:
        """Whether each value is in the range of its quantity."""
        return (values >= self.low) & (values <= self.high)


def _range_of(values: np.ndarray) -> Range:
    """The range of values (n, ...) with a margin."""
    margin = BEYOND * np.ptp(values, axis=0)
    return Range(values.min(axis=0) - margin, values.max(axis=0) + margin)


class Step(NamedTuple):
    """The largest step of a log's residuals."""

    score: float  # above 1: a step that no healthy vehicle has
    row: int  # index of the first window after it
    change: np.ndarray  # (n_residuals,)


def step_of(residual: np.ndarray, limits: np.ndarray) -> Step:
    """The step between the medians before and after that is largest by its limit.

    Parameters
    ----------
    residual
        Relative, (n, n_residuals).
    limits
        Smallest step that counts, (n_residuals,).
    """
    best = Step(0.0, 0, np.zeros(len(limits)))
    last = len(residual) - LEAST_WINDOWS
    for row in range(LEAST_WINDOWS, last, max(1, (last - LEAST_WINDOWS) // MOST_STEPS)):
        before = np.median(residual[:row], axis=0)
        after = np.median(residual[row:], axis=0)
        level = np.where(np.arange(len(residual))[:, None] < row, before, after)
        scatter = NORMAL_MAD * np.median(np.abs(residual - level), axis=0)
        change = after - before
        scores = np.abs(change) / np.maximum(limits, SCATTERS * scatter)
        if scores.max() > best.score:
            best = Step(float(scores.max()), row, change)
    return best


def _finding(difference: Difference, limits: np.ndarray, n_logs: int) -> Finding:
    """The finding on one of so many logs."""
    changes = dict(zip(difference.changes, limits, strict=True))
    large = [name for name in changes if abs(difference.changes[name]) > changes[name]]
    texts = [_text(name, difference.changes[name], difference.time is None) for name in large]
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
