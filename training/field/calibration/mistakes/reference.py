"""The relations of some logs as a reference for another one."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from diagnosers.relations.model import residuals_of
from diagnosers.relations.windows import PUSH, Layout, Windows
from training.field.calibration.mistakes.log_windows import LEAST_WINDOWS, LogWindows
from training.learning.relation_fit import FLOOR, fit_relation, median_sizes

MOST = 95.0  # percentile of the reference's residuals of the net force, and
BEYOND_USUAL = 2.0  # the factor beyond it from which a change of the drag counts
BEYOND = 0.05  # of a range of speeds, within which relations hold
# largest command by smallest one, from which drag is known, and relations beyond their range
WIDE = 1.5


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
    speeds = range_of(np.concatenate([_speeds(part.windows) for part in parts]))
    commands = range_of(np.concatenate([one for log in logs for one in log.commands]))
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


def range_of(values: np.ndarray) -> Range:
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
