"""Readings that stay the same while the others of the vehicle change."""

from collections.abc import Sequence

import numpy as np

from auv_fault_env.channels import CHANNELS
from training.field.calibration.mistakes.finding import Finding
from training.field.calibration.mistakes.operating_points import DURATION, OperatingPoints

LEAST_POINTS = 12  # a minute
LEAST_CHANGE = 0.2  # of the other readings, relative
MIDDLE = (10.0, 90.0)  # percentiles between which that change is counted


def stuck_findings(points: OperatingPoints, logs: Sequence[str]) -> list[Finding]:
    """Findings on readings that stay the same for a minute under way; logs are their names.

    A reading that is constant in all logs is a matter of the vehicle file. Of a log, the first
    reading is named.
    """
    findings = []
    for name in points.of_motion:
        if name == points.command:
            continue
        by_log = {k: _stuck(points, name, k) for k in np.unique(points.log)}
        stuck = {k: stretch for k, stretch in by_log.items() if stretch is not None}
        if len(stuck) == len(by_log) and _is_constant(points, name):
            findings.append(_constant(name, points))
        else:
            found = [_of_log(name, points, *stuck[k], logs[k]) for k in stuck]
            named = {one.log for one in findings}
            findings += [one for one in found if one.log not in named]
    return findings


def _is_constant(points: OperatingPoints, name: str) -> bool:
    values = points.values[name][points.is_under_way]
    return np.unique(values[np.isfinite(values)]).size == 1


def _stuck(points: OperatingPoints, name: str, log: int) -> tuple[int, int] | None:
    """First and last point of the longest stretch with one value, if the others change in it."""
    index = np.flatnonzero((points.log == log) & points.is_under_way)
    values = points.values[name][index]
    index = index[np.isfinite(values)]
    if len(index) < LEAST_POINTS:
        return None
    values = points.values[name][index]
    begins = np.flatnonzero(np.append(True, np.diff(values) != 0.0))
    lengths = np.diff(np.append(begins, len(values)))
    longest = int(lengths.argmax())
    if lengths[longest] < LEAST_POINTS:
        return None
    stretch = index[begins[longest] : begins[longest] + lengths[longest]]
    changes = [_change(points.values[other][stretch]) for other in points.others(name)]
    changed = sum(change >= LEAST_CHANGE for change in changes)
    if not changes or 2 * changed <= len(changes):
        return None
    return int(stretch[0]), int(stretch[-1])


def _change(values: np.ndarray) -> float:
    values = values[np.isfinite(values)]
    if not len(values):
        return 0.0
    low, high = np.percentile(values, MIDDLE)
    return float((high - low) / max(abs(low), abs(high), 1e-12))


def _constant(name: str, points: OperatingPoints) -> Finding:
    value = np.nanmedian(points.values[name][points.is_under_way])
    evidence = f"constant at {value:.3g} {CHANNELS[name].unit} under way, while the others change"
    cause = "is it the wrong column, or does its sensor not work?"
    remedy = f"correct column in [channels.{name}], or leave the channel out"
    return Finding((name,), evidence, cause, remedy)


def _of_log(name: str, points: OperatingPoints, first: int, last: int, log: str) -> Finding:
    value = f"{points.values[name][first]:.3g} {CHANNELS[name].unit}"
    begin = points.time[first]
    end = points.time[last] + DURATION
    evidence = f"{name} stays at {value} from {begin:.0f} s to {end:.0f} s, while the others change"
    remedy = "leave the log out, or cut it before"
    return Finding((name,), evidence, "is its sensor stuck, and the log not healthy?", remedy, log)
