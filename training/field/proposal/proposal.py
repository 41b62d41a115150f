"""A vehicle file proposed from the header and the numbers of a log."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS, READINGS
from auv_fault_env.errors import refusal
from auv_fault_env.parameters import SAMPLE_RATE, SIDES, Vehicle
from training.field.logs.plausible import IMPOSSIBLE, largest_magnitudes
from training.field.logs.table import Table
from training.field.proposal.header import SIDED, Meaning, meaning
from training.field.units import UNITS
from training.field.vehicle_file import Column, VehicleFile

# units that are tried by the size of the numbers where the name has none
UNITS_BY_SIZE = {
    "m/s": ("m/s", "cm/s", "mm/s"),
    "rad": ("rad", "deg"),
    "V": ("V", "mV"),
    "A": ("A", "mA"),
}
# a shaft that never turns faster is taken to be logged in revolutions per second
SLOWEST_RPM = 60.0
PULSES = (800.0, 2500.0)  # us, limits of the pulses that command a motor driver
# least stamp that counts from 1970 in this unit
EPOCHS = {"ns": 1e17, "us": 1e14, "ms": 1e11, "s": 1e8}
# least step between two rows in this unit
STEPS = {"ns": 5e6, "us": 5e3, "ms": 3.0, "s": 0.0}
LONGEST_STEP = 10.0  # s, of a log that counts from 1970
COARSE_CLOCK = 0.3  # share of rows with the stamp of the row before
COMMENTS = {
    "vehicle.preset": "a guess to start with: calibrate fits the constants to healthy logs",
    "vehicle.hotel_load": "not in a log: the power of all but propulsion",
    "vehicle.diagnoser": "calibrate chooses it",
    "vehicle.battery": "not in a log: the charge when full",
}


class Proposal(NamedTuple):
    """A proposed vehicle file."""

    vehicle: VehicleFile
    comments: dict[str, str]  # the reason of each guess, by table and key
    missing: tuple[str, ...]  # channels without a column
    left_out: tuple[str, ...]  # columns that could be a channel but were left out, and why


class Guess(NamedTuple):
    """A column of the log for a channel or for the time, and why."""

    column: Column
    why: str


def propose(table: Table, name: str) -> Proposal:
    """A vehicle file for logs like this one.

    Names decide first, then numbers: the unit by their size where none is named, the sign by that
    of the speed. A log does not contain the vehicle's constants, hotel load and battery: the
    constants stay those of the preset, the others unknown. `InputError` if no column looks like a
    reading of a vehicle.
    """
    meanings = {}
    for label in table.columns:
        column_meaning = meaning(label, table.units.get(label, ""))
        if column_meaning:
            meanings[label] = column_meaning
    time = _time(table, meanings)
    labels, left_out = _labels(table, meanings)
    guesses = _guesses(table, meanings, labels, Vehicle(name))
    if not set(guesses) & set(READINGS):
        allowed = "one with a column for at least one of " + ", ".join(READINGS)
        remedy = "write the vehicle file by hand: see docs/vehicle.md"
        raise refusal("log", ", ".join(table.columns), allowed, remedy)
    rate, rate_comment = _sample_rate(table, time)
    shafts = 1 + any(channel.startswith("starboard") for channel in guesses)
    columns = {channel: guesses[channel].column for channel in CHANNELS if channel in guesses}
    vehicle = VehicleFile(
        Vehicle(name, shafts=shafts), columns, time.column if time else None, rate
    )
    comments = {f"channels.{channel}.column": guess.why for channel, guess in guesses.items()}
    comments |= COMMENTS
    if time:
        comments["time.column"] = time.why
    comments["vehicle.sample_rate"] = rate_comment
    comments["vehicle.shafts"] = "by the columns of the log"
    missing = tuple(_missing(guesses, time, shafts))
    return Proposal(vehicle, comments, missing, tuple(left_out))


def _missing(guesses: Mapping[str, Guess], time: Guess | None, shafts: int) -> Iterable[str]:
    if time is None:
        step = f"{1 / SAMPLE_RATE:g} s"
        yield f"time: no column whose numbers grow; rows are taken to be {step} apart"
    for channel, spec in CHANNELS.items():
        if channel not in guesses and (shafts == 2 or not channel.startswith("starboard")):
            yield f"{channel}: no column; {spec.about} [{spec.unit}]"


def _labels(table: Table, meanings: Mapping[str, Meaning]) -> tuple[dict[str, str], list[str]]:
    """The column with the most certain meaning, by channel, and remarks on the others."""
    best: dict[str, str] = {}
    left_out = []
    for label in sorted(meanings, key=lambda label: -meanings[label].score):
        quantity = meanings[label].quantity
        side = meanings[label].side
        channel = f"{side}_{quantity}" if quantity in SIDED else quantity
        if quantity == "time":
            continue
        if channel in best:
            left_out.append(f"{label!r}: {channel} is {best[channel]!r}")
        elif channel in READINGS and not _varies(table.columns[label]):
            left_out.append(f"{label!r}: it is constant or empty")
        else:
            best[channel] = label
    for side in SIDES:
        command = best.pop(f"{side}_motor_command", None)
        if command and best.setdefault(f"{side}_rpm", command) != command:
            left_out.append(f"{command!r}: the log has the shaft speed itself")
    if "speed_command" in best:
        best.setdefault("mission_speed", best["speed_command"])
    elif "mission_speed" in best:
        best["speed_command"] = best["mission_speed"]
    return best, left_out


def _varies(values: np.ndarray) -> bool:
    known = values[np.isfinite(values)]
    return known.size > 0 and known.min() < known.max()


def _guesses(
    table: Table,
    meanings: Mapping[str, Meaning],
    labels: Mapping[str, str],
    vehicle: Vehicle,
) -> dict[str, Guess]:
    """Columns with unit and sign.

    Motors have the sign of the speed; without a speed all are taken to go ahead most of the time.
    """
    limits = largest_magnitudes(vehicle)
    guesses = {}
    for channel, label in labels.items():
        values = table.columns[label]
        if meanings[label].quantity == "motor_command":
            guesses[channel] = _as_shaft_speed(label, values, vehicle)
        else:
            unit = meanings[label].unit
            guesses[channel] = _with_unit(channel, label, values, unit, limits[channel])
    ahead = np.ones(len(next(iter(table.columns.values()))))
    for channel in ("speed", *(name for name in READINGS if name.startswith(SIDES))):
        if channel in guesses:
            guesses[channel] = _with_sign(guesses[channel], table, ahead)
            if channel == "speed":
                column = guesses[channel].column
                ahead = column.scale * table.columns[column.name]
    return guesses


def _with_unit(
    channel: str, label: str, values: np.ndarray, named_unit: str | None, limit: float
) -> Guess:
    kind = CHANNELS[channel].unit
    if named_unit:
        return Guess(Column(label, UNITS[kind][named_unit]), "by its name")
    known = abs(values[np.isfinite(values)])
    size = float(np.percentile(known, 95)) if known.size else 0.0
    fitting = [
        unit
        for unit in UNITS_BY_SIZE.get(kind, ())
        if UNITS[kind][unit] * size < IMPOSSIBLE * limit
    ]
    unit = fitting[0] if fitting else kind
    if kind == "rpm" and size < SLOWEST_RPM:
        unit = "rev/s"
    why = f"its name has no unit; {unit} by its size, {size:.3g}"
    return Guess(Column(label, UNITS[kind][unit]), why)


def _as_shaft_speed(label: str, values: np.ndarray, vehicle: Vehicle) -> Guess:
    """A motor command as a shaft speed: the largest value is full speed, the least pulse rest."""
    known = abs(values[np.isfinite(values)])
    low = float(known.min()) if known.size else 0.0
    full = float(known.max()) if known.size else 0.0
    rest = low if PULSES[0] <= low < full <= PULSES[1] else 0.0
    scale = vehicle.maximum_rpm / ((full - rest) or 1.0)
    levels = f"{rest:g} as rest, {full:g} as {vehicle.maximum_rpm:g} rpm"
    why = f"the motor command replaces the shaft speed: {levels}; correct it"
    return Guess(Column(label, scale, -rest * scale), why)


def _with_sign(guess: Guess, table: Table, ahead: np.ndarray) -> Guess:
    """The column, reversed if it has the opposite sign of `ahead` (n_rows,)."""
    column = guess.column
    if np.nansum(np.sign(table.columns[column.name]) * np.sign(ahead)) >= 0:
        return guess
    why = f"{guess.why}; sign reversed, for it is negative while the vehicle goes ahead"
    return Guess(column._replace(scale=-column.scale), why)


def _time(table: Table, meanings: Mapping[str, Meaning]) -> Guess | None:
    """The first column of a time whose numbers grow, with its unit by name, size or step."""
    for label, column_meaning in meanings.items():
        values = table.columns[label]
        known = values[np.isfinite(values)]
        if column_meaning.quantity == "time" and known.size > 1 and known[-1] > known[0]:
            if column_meaning.unit:
                return Guess(Column(label, UNITS["s"][column_meaning.unit]), "by its name")
            unit, why = _time_unit(known)
            return Guess(Column(label, UNITS["s"][unit]), why)
    return None


def _time_unit(stamps: np.ndarray) -> tuple[str, str]:
    """The unit of stamps (n,) by their size or step, and why."""
    size = float(np.median(stamps))
    steps = np.diff(stamps)
    step = float(np.median(steps[steps > 0]))
    for unit, least in EPOCHS.items():
        if size > least and step * UNITS["s"][unit] < LONGEST_STEP:
            return unit, f"counts from 1970 in {unit}, by its size"
    unit = next(unit for unit, least in STEPS.items() if step > least)
    return unit, f"in {unit}, by the step of {step:.3g}"


def _sample_rate(table: Table, time: Guess | None) -> tuple[float, str]:
    """Rows per second in Hz, and why; a clock with few ticks counts the rows between two."""
    if time is None:
        return SAMPLE_RATE, "a guess: no time in the log"
    stamps = time.column.scale * table.columns[time.column.name]
    steps = np.diff(stamps[np.isfinite(stamps)])
    is_coarse = np.mean(steps == 0) > COARSE_CLOCK
    step = steps[steps >= 0].mean() if is_coarse else np.median(steps[steps > 0])
    rate = float(f"{1 / step:.3g}")
    if 0.5 <= rate <= 1e4:
        return rate, "by the stamps of its rows"
    return SAMPLE_RATE, f"a guess: the stamps say {rate:g} Hz, which cannot be"
