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
MOST = 95.0  # percentile of the reference's residuals of the net force, and
BEYOND_USUAL = 2.0  # the factor beyond it from which a change of the drag counts
LEAST_WINDOWS = 60  # a minute before and after a step
LEAST_SHARE = 0.6  # of the rows under way, in which a reading is there and not zero
MOST_STEPS = 100  # that are tried in a log
BEYOND = 0.05  # of the other logs' range of speeds, within which their relations hold
# largest command by smallest one, from which drag is known, and relations beyond their range
WIDE = 1.5


class LogWindows(NamedTuple):
    """The windows of one log."""

    name: str
    parts: list[EpisodeWindows]
    times: list[np.ndarray]  # of the middle of each part's windows [s]
    commands: list[np.ndarray]  # at the end of each part's windows [m/s]; without any, the speed


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
    if not _has_relations(readings, layout):
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
                command = rows.reading[part.last, INDEX["mission_speed"]]
                commands.append(np.where(np.isnan(command), part.windows.speed, command))
        if sum(map(len, times)) >= 2 * LEAST_WINDOWS:
            found.append(LogWindows(log.name, parts, times, commands))
    return found


def _has_relations(readings: Sequence[np.ndarray], layout: Layout) -> bool:
    """Whether every reading of the relations is usually there and not zero under way."""
    moving = [reading[is_under_way(reading)] for reading in readings]
    together = np.concatenate([np.zeros((0, len(INDEX))), *moving])
    kinds = ("voltage", "current", "rpm") if layout.has_shaft_speed else ("voltage", "current")
    names = ["speed", *(f"{side}_{kind}" for side in layout.sides for kind in kinds)]
    columns = together[:, [INDEX[name] for name in names]]
    is_there = np.isfinite(columns) & (columns != 0.0)
    return len(columns) > 0 and bool((is_there.mean(axis=0) > LEAST_SHARE).all())


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


class Range(NamedTuple):
    """The range of some quantities."""

    low: np.ndarray
    high: np.ndarray

    def has(self, values: np.ndarray) -> np.ndarray:
        """Whether each value is in the range of its quantity."""
        return (values >= self.low) & (values <= self.high)


class Reference(NamedTuple):
    """The relations of some logs."""

    coefficients: Mapping[str, np.ndarray]  # by relation
    least: np.ndarray  # sizes below which a residual is relative to these, (n_residuals,)
    speeds: Range  # of speed and shaft speeds
    commands: Range  # of the speed
    limits: np.ndarray  # smallest changes that count, (n_residuals,)

    @property
    def is_wide(self) -> bool:
        """Whether the commands differ enough to tell thrust from drag."""
        return bool(self.commands.high > WIDE * self.commands.low)

    def compared(self, windows: Windows, layout: Layout) -> tuple[np.ndarray, np.ndarray]:
        """Residuals of windows, and the sizes that they are relative to, (n, n_residuals)."""
        residual, size = residuals_of(layout, self.coefficients, windows)
        return residual, np.maximum(size, self.least)

    def is_loaded(self, size: np.ndarray, layout: Layout) -> np.ndarray:
        """Where the motors have a load by their shaft speeds, (n,), and the vehicle does not coast.

        Everywhere without shaft speeds, where one that lost its propeller would seem to coast.
        """
        if not layout.has_shaft_speed:
            return np.ones(len(size), bool)
        is_load = np.array([name.endswith("load") for name in layout.residuals])
        return (size > self.least)[:, is_load].all(axis=1)


def reference_of(logs: Sequence[LogWindows], layout: Layout, limits: np.ndarray) -> Reference:
    """The relations that are fitted to these logs.

    The drag is what the fit says: no change of it counts that residuals of the net force reach.
    """
    parts = [part for log in logs for part in log.parts]
    coefficients = {name: fit_relation(name, parts, layout) for name in layout.relations}
    least = FLOOR * np.array(list(median_sizes(parts, coefficients, layout).values()))
    speeds = _range_of(np.concatenate([_speeds(part.windows) for part in parts]))
    commands = _range_of(np.concatenate([one for log in logs for one in log.commands]))
    reference = Reference(coefficients, least, speeds, commands, limits)
    if PUSH not in layout.residuals:
        return reference
    push = layout.residuals.index(PUSH)
    pairs = [reference.compared(part.windows, layout) for part in parts]
    residual = np.concatenate([(residual / size)[:, push] for residual, size in pairs])
    usual = np.percentile(np.abs(residual), MOST)
    of_push = max(limits[push], BEYOND_USUAL * usual) if reference.is_wide else np.inf
    changed = np.where(np.arange(len(limits)) == push, of_push, limits)
    return reference._replace(limits=changed)


def _speeds(windows: Windows) -> np.ndarray:
    """Speed and shaft speeds of windows, (n, n_quantities); 0 for one that is not read."""
    shafts = [np.nan_to_num(shaft) for shaft in windows.shaft_speed.values()]
    return np.stack([windows.speed, *shafts], axis=1)


def _range_of(values: np.ndarray) -> Range:
    """The range of values (n, ...) with a margin."""
    margin = BEYOND * np.ptp(values, axis=0)
    return Range(values.min(axis=0) - margin, values.max(axis=0) + margin)


class Compared(NamedTuple):
    """A log by the relations of others."""

    residual: np.ndarray  # (n, n_residuals)
    size: np.ndarray  # that it is relative to, (n, n_residuals)
    time: np.ndarray  # s, (n,)
    command: np.ndarray  # m/s, (n,)
    limits: np.ndarray  # of the reference

    @property
    def median(self) -> np.ndarray:
        """Median of the relative residuals, (n_residuals,); 0 with too few windows."""
        if len(self.residual) < LEAST_WINDOWS:
            return np.zeros(len(self.limits))
        return np.median(self.residual / self.size, axis=0)


def compared_with(reference: Reference, log: LogWindows, layout: Layout) -> Compared:
    """The log by a reference.

    Windows without a load are left out, and those at speeds that the reference does not have,
    unless it has the command and several more.
    """
    residuals = []
    sizes = []
    times = []
    commands = []
    for part, time, command in zip(log.parts, log.times, log.commands, strict=True):
        is_known = reference.speeds.has(_speeds(part.windows)).all(axis=1)
        if reference.is_wide:
            is_known |= reference.commands.has(command)
        residual, size = reference.compared(part.windows, layout)
        is_known &= reference.is_loaded(size, layout)
        residuals.append(residual[is_known])
        sizes.append(size[is_known])
        times.append(time[is_known])
        commands.append(command[is_known])
    columns = map(np.concatenate, (residuals, sizes, times, commands))
    return Compared(*columns, reference.limits)


class Step(NamedTuple):
    """The largest step of a log's residuals."""

    score: float  # above 1: a step that no healthy vehicle has
    row: int  # index of the first window after it
    change: np.ndarray  # (n_residuals,)


def step_of(log: Compared) -> Step:
    """The step between the medians before and after that is largest by its limit.

    Windows at commands beyond those before the step do not count. A constant error of the log, as
    by the zero of a sensor, or a proportional one, is no step where the speeds before and after
    differ: the smaller of the steps of both views counts.
    """
    best = Step(0.0, 0, np.zeros(len(log.limits)))
    last = len(log.residual) - LEAST_WINDOWS
    relative = log.residual / log.size
    for row in range(LEAST_WINDOWS, last, max(1, (last - LEAST_WINDOWS) // MOST_STEPS)):
        is_after = np.arange(len(relative)) >= row
        is_after &= _range_of(log.command[:row]).has(log.command)
        if is_after.sum() < LEAST_WINDOWS // 2:
            continue
        constant = np.median(log.residual[:row], axis=0)
        parts = (relative[:row], relative[is_after])
        one = _change(*parts)
        other = _change(
            parts[0] - constant / log.size[:row], parts[1] - constant / log.size[is_after]
        )
        change = np.where(np.abs(one) < np.abs(other), one, other)
        change[np.sign(one) != np.sign(other)] = 0.0
        scores = np.abs(change) / np.maximum(log.limits, SCATTERS * _scatter_about(*parts))
        if scores.max() > best.score:
            best = Step(float(scores.max()), row, change)
    return best


def _change(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Difference of the medians of residuals (n, n_residuals)."""
    return np.median(after, axis=0) - np.median(before, axis=0)


def _scatter_about(*parts: np.ndarray) -> np.ndarray:
    """Scatter of residuals (n, n_residuals) about the medians of their parts."""
    errors = np.concatenate([np.abs(part - np.median(part, axis=0)) for part in parts])
    return NORMAL_MAD * np.median(errors, axis=0)


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
