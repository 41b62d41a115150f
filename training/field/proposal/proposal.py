"""A vehicle file proposed from the header and the numbers of a log."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS, READINGS
from auv_fault_env.parameters import SAMPLE_RATE, SIDES, Vehicle
from training.field.logs.plausible import largest_magnitudes
from training.field.logs.table import Table
from training.field.proposal.columns import Found, found_columns
from training.field.proposal.evidence import without_missing_mark
from training.field.proposal.guess import Guess, guess_of
from training.field.proposal.motors import Motors, guesses_of_motors
from training.field.proposal.stamps import sample_rate, time_of
from training.field.vehicle_file import MAXIMA, QUANTITIES, Column, VehicleFile

COMMENTS = {
    "vehicle.preset": "a guess to start with: calibrate fits the constants to healthy logs",
    "vehicle.hotel_load": "not in a log: the power of all but propulsion",
    "vehicle.diagnoser": "calibrate chooses it",
    "vehicle.battery": "not in a log: the charge when full",
}
RATE_NOT_KNOWN = "the rate is not known; write it, or correct the time of the log"
NO_COLUMN = Column("?")  # in the file of a log without a reading


class Proposal(NamedTuple):
    """A proposed vehicle file. Every column of the log is used, left out or unknown."""

    vehicle: VehicleFile
    comments: dict[str, str]  # the reason of each guess, by table and key
    missing: dict[str, str]  # channels without a column, or the time, and what they are
    left_out: tuple[str, ...]  # columns that are no channel, and why
    unknown: tuple[str, ...]  # columns of which nothing is known

    @property
    def rate_is_known(self) -> bool:
        """Whether the rate is that of the log's time, or the log has no column of a time."""
        return self.comments["vehicle.sample_rate"] != RATE_NOT_KNOWN

    @property
    def used(self) -> tuple[str, ...]:
        """What is used, one line for each channel and the time, with the reason."""
        named = {f"channels.{channel}": column for channel, column in self.vehicle.columns.items()}
        if self.vehicle.time:
            named = {"time": self.vehicle.time} | named
        lines = []
        for table, column in named.items():
            if column == NO_COLUMN:
                continue
            names = " times ".join(map(repr, column.names))
            why = self.comments.get(f"{table}.column", "")
            lines.append(f"{table.removeprefix('channels.')}: {names}, {why}")
        return tuple(lines)

    @property
    def has_reading(self) -> bool:
        """Whether a column of the log is a reading."""
        return NO_COLUMN not in self.vehicle.columns.values()


@np.errstate(over="ignore", invalid="ignore")
def propose(table: Table, name: str) -> Proposal:
    """A vehicle file for logs like this one.

    Every column gets points for each quantity by its name, unit and values; the one with most is
    the channel. A log does not contain the vehicle's constants, hotel load and battery: the
    constants stay those of the preset, the others unknown.
    """
    found = found_columns(table)
    time = time_of(found.matches, table.columns)
    rate, rate_comment = sample_rate(time, table.columns)
    guesses = _guesses_of_hull(found, table.columns)
    guesses_of_motors(Motors(found, table.columns, guesses, Vehicle(name)))
    ordered = {channel: guesses[channel] for channel in CHANNELS if channel in guesses}
    ordered = _with_signs(ordered, table.columns)
    columns = {channel: guess.column for channel, guess in ordered.items()}
    shafts = 1 + any(channel.startswith(SIDES[1]) for channel in columns)
    vehicle, comments = _with_maxima(Vehicle(name, shafts=shafts), columns, table.columns)
    comments |= COMMENTS | {f"channels.{one}.column": guess.why for one, guess in ordered.items()}
    if time:
        comments["time.column"] = time.why
    comments["vehicle.sample_rate"] = rate_comment
    comments["vehicle.shafts"] = "by the columns of the log"
    if not set(columns) & set(READINGS):
        columns |= {"speed": NO_COLUMN}
    file = VehicleFile(vehicle, columns, time.column if time else None, rate)
    used = {name for column in columns.values() for name in column.names}
    used |= {time.column.name} if time else set()
    left_out = tuple(_left_out(found, used, ordered, time))
    missing = dict(_missing(ordered, time, shafts))
    if time is None and found.unread_times:
        missing["time"] = f"{found.unread_times[0]!r} cannot be read as a time: {RATE_NOT_KNOWN}"
        comments["vehicle.sample_rate"] = RATE_NOT_KNOWN
    return Proposal(file, comments, missing, left_out, found.unknown)


def _guesses_of_hull(found: Found, columns: Mapping[str, np.ndarray]) -> dict[str, Guess]:
    """The channels that belong to no shaft."""
    guesses = {}
    for channel in CHANNELS:
        if channel in found.best and not channel.startswith(SIDES):
            guesses[channel] = guess_of(found.best[channel], columns)
    if "speed_command" in guesses:
        guesses.setdefault("mission_speed", guesses["speed_command"])
    elif "mission_speed" in guesses:
        guesses["speed_command"] = guesses["mission_speed"]
    return guesses


def _with_signs(
    guesses: Mapping[str, Guess], columns: Mapping[str, np.ndarray]
) -> dict[str, Guess]:
    """Motors have the sign of the speed; without one they go ahead most of the time."""
    signed = dict(guesses)
    ahead = np.ones(len(next(iter(columns.values()))))
    for channel in ("speed", *(name for name in READINGS if name.startswith(SIDES))):
        if channel not in guesses:
            continue
        column = guesses[channel].column
        values = column.scale * columns[column.name] + column.offset
        if np.nansum(np.sign(values) * np.sign(ahead)) < 0:
            why = "sign reversed, for it is negative while the vehicle goes ahead"
            column = column._replace(scale=-column.scale, offset=-column.offset)
            signed[channel] = Guess(column, f"{guesses[channel].why}; {why}")
        if channel == "speed":
            ahead = column.scale * columns[column.name] + column.offset
    return signed


def _with_maxima(
    vehicle: Vehicle, channels: Mapping[str, Column], columns: Mapping[str, np.ndarray]
) -> tuple[Vehicle, dict[str, str]]:
    """The vehicle with full scales for the values of this log, and the reason of each."""
    comments = {}
    limits = largest_magnitudes(vehicle)
    for channel in READINGS:
        key = MAXIMA.get(CHANNELS[channel].unit)
        if channel not in channels or not key:
            continue
        column = channels[channel]
        values = column.scale * without_missing_mark(columns[column.name]) + column.offset
        if column.times:
            values = values * columns[column.times]
        known = abs(values[np.isfinite(values)])
        largest = float(np.percentile(known, 99.5)) if known.size else 0.0
        if largest > max(limits[channel], getattr(vehicle, key)):
            highest = QUANTITIES[key]["high"]
            vehicle = replace(vehicle, **{key: min(highest, float(f"{1.01 * largest:.3g}"))})
            comments[f"parameters.{key}"] = "by the largest values of the log"
    return vehicle, comments


def _left_out(
    found: Found, used: set[str], guesses: Mapping[str, Guess], time: Guess | None
) -> Iterable[str]:
    for label, why in found.left_out.items():
        if label not in used:
            yield f"{label!r}: {why}"
    for label, match in found.matches.items():
        if label in used or label in found.left_out:
            continue
        winner = time if match.quantity == "time" else None
        for channel, guess in guesses.items():
            if channel.removeprefix("port_").removeprefix("starboard_") == match.quantity:
                winner = winner or guess
        instead = f" is {winner.column.name!r}" if winner else " has another column"
        yield f"{label!r}: {match.quantity.replace('_', ' ')}{instead}"


def _missing(
    guesses: Mapping[str, Guess], time: Guess | None, shafts: int
) -> Iterable[tuple[str, str]]:
    if time is None:
        step = f"{1 / SAMPLE_RATE:g} s"
        yield "time", f"no column is a time by its name; rows are taken to be {step} apart"
    for channel, spec in CHANNELS.items():
        if channel not in guesses and (shafts == 2 or not channel.startswith(SIDES[1])):
            yield channel, f"no column; {spec.about} [{spec.unit}]"
