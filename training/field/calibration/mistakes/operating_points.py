"""Medians of the readings over a few seconds, which single outliers and noise do not reach."""

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from auv_fault_env.channels import INDEX
from auv_fault_env.parameters import SAMPLE_RATE, SIDES
from training.field.logs.log import Log
from training.field.vehicle_file import VehicleFile

DURATION = 5.0  # s, of a point
SETTLED_CHANGE = 0.05  # from the point before, relative to the largest usual value
STARTED = 0.2  # of the largest usual value, above which a vehicle without a command is under way
LARGEST = 90.0  # percentile that is the largest usual value
COMMAND_NAMES = ("mission_speed", "speed_command")
MOTOR_KINDS = ("rpm", "voltage", "current")


@dataclass(frozen=True)
class OperatingPoints:
    """Points of all logs, one after the other.

    Attributes
    ----------
    values
        Median by channel of the vehicle file, (n,), NaN where no reading arrived; without the
        channels that never had one.
    log
        Index of the log, (n,).
    time
        Begin [s from the log's start], (n,).
    is_first
        Whether a point is the first of its segment, (n,).
    """

    values: Mapping[str, np.ndarray]
    log: np.ndarray
    time: np.ndarray
    is_first: np.ndarray

    def without(self, channels: Iterable[str]) -> "OperatingPoints":
        """The points without channels that are in doubt."""
        left = set(self.values) - set(channels)
        return replace(
            self, values={name: self.values[name] for name in self.values if name in left}
        )

    def without_logs(self, logs: Iterable[int]) -> "OperatingPoints":
        """The points of the other logs."""
        is_left = ~np.isin(self.log, list(logs))
        values = {name: column[is_left] for name, column in self.values.items()}
        return OperatingPoints(
            values, self.log[is_left], self.time[is_left], self.is_first[is_left]
        )

    def scaled(self, channels: Iterable[str], factor: float) -> "OperatingPoints":
        """The points with some readings multiplied."""
        scaled = {name: factor * self.values[name] for name in channels}
        return replace(self, values={**self.values, **scaled})

    @property
    def command(self) -> str | None:
        """Channel of the commanded speed, if there is one."""
        return next((name for name in COMMAND_NAMES if name in self.values), None)

    @property
    def sides(self) -> tuple[str, ...]:
        """Sides with any reading."""
        return tuple(side for side in SIDES if self.of_side(side))

    def of_side(self, side: str) -> tuple[str, ...]:
        """Channels of a side."""
        names = (f"{side}_{kind}" for kind in MOTOR_KINDS)
        return tuple(name for name in names if name in self.values)

    def others(self, channel: str) -> list[str]:
        """The channels of motion other than this one and those of the other side."""
        side = channel.partition("_")[0]
        return [
            name
            for name in self.of_motion
            if name != channel and {side, name.partition("_")[0]} != set(SIDES)
        ]

    @property
    def of_motion(self) -> tuple[str, ...]:
        """Channels that grow with the speed of the vehicle."""
        names = (self.command, "speed", *(name for side in SIDES for name in self.of_side(side)))
        return tuple(name for name in names if name in self.values)

    def largest(self, channel: str) -> float:
        """Largest usual magnitude of a channel; NaN without readings."""
        known = np.abs(self.values[channel][np.isfinite(self.values[channel])])
        return float(np.percentile(known, LARGEST)) if known.size else np.nan

    def typical(self, channel: str) -> float:
        """Median magnitude of a channel under way; NaN without readings."""
        known = self.values[channel][self.is_under_way]
        known = known[np.isfinite(known)]
        return float(np.median(np.abs(known))) if known.size else np.nan

    @cached_property
    def is_under_way(self) -> np.ndarray:
        """Where the commanded speed is above zero, (n,); without one, where the vehicle moves."""
        if self.command:
            return self.values[self.command] > 0.0
        for name in self.of_motion:
            return np.abs(self.values[name]) > STARTED * self.largest(name)
        return np.zeros(len(self.log), bool)

    @cached_property
    def is_settled(self) -> np.ndarray:
        """Where the vehicle is under way and hardly differs from the point before, (n,)."""
        is_settled = self.is_under_way & ~self.is_first
        for name in (self.command, "speed", *(f"{side}_rpm" for side in SIDES)):
            if name in self.values:
                change = np.abs(np.diff(self.values[name], prepend=np.nan))
                is_settled &= ~(change > SETTLED_CHANGE * self.largest(name))
        return is_settled


def operating_points(logs: Sequence[Log], vehicle: VehicleFile) -> OperatingPoints:
    """The points of all segments of all logs."""
    n_rows = round(DURATION * SAMPLE_RATE)
    names = [name for name in INDEX if name in vehicle.columns]
    indices = [INDEX[name] for name in names]
    medians = [np.zeros((0, len(names)))]
    log_index = []
    time = []
    is_first = []
    for k, log in enumerate(logs):
        for segment in log.segments:
            rows = log.observation[segment][:, indices]
            n_points = len(rows) // n_rows
            blocks = rows[: n_points * n_rows].reshape(n_points, n_rows, len(names))
            medians.append(_medians(blocks))
            log_index.append(np.full(n_points, k))
            time.append(log.time[segment][: n_points * n_rows : n_rows])
            is_first.append(np.arange(n_points) == 0)
    columns = dict(zip(names, np.concatenate(medians).T, strict=True))
    values = {name: column for name, column in columns.items() if np.isfinite(column).any()}
    return OperatingPoints(
        values, np.concatenate(log_index), np.concatenate(time), np.concatenate(is_first)
    )


def _medians(blocks: np.ndarray) -> np.ndarray:
    """Medians over the rows of each block, NaN for a channel without readings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return np.nanmedian(blocks, axis=1)
