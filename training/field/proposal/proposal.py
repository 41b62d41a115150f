"""A vehicle file proposed from a log: what its header says, and what its numbers show."""

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

# by size
UNNAMED = {
    "m/s": ("m/s", "cm/s", "mm/s"),
    "rad": ("rad", "deg"),
    "V": ("V", "mV"),
    "A": ("A", "mA"),
}
# a shaft that never turns faster is taken to be logged in revolutions per second
SLOWEST_RPM = 60.0
PULSES = (800.0, 2500.0)  # us, in which the pulses lie that command a motor driver
# from which a stamp counts from 1970, in this unit
EPOCHS = {"ns": 1e17, "us": 1e14, "ms": 1e11, "s": 1e8}
# from which a step between two rows is in this unit
STEPS = {"ns": 5e6, "us": 5e3, "ms": 3.0, "s": 0.0}
COMMENTS = {
    "vehicle.preset": "a guess for a start: calibrate fits the constants to healthy logs",
    "vehicle.hotel_load": "in no log: the power of all but propulsion",
    "vehicle.battery": "in no log: the charge when full",
}


class Proposal(NamedTuple):
    """A vehicle file, why each guess was made (by table and key), what was not found, and what was left out."""

    vehicle: VehicleFile
    comments: dict[str, str]
    missing: tuple[str, ...]
    left: tuple[str, ...]


class Guess(NamedTuple):
    """A column of the log for a channel or for the time, and why."""

    column: Column
    why: str


def propose(table: Table, name: str) -> Proposal:
    """A vehicle file for logs like this one; `InputError` if no column looks like a reading of a vehicle.

    Names decide first, then numbers: the unit by their size where no unit is named, the sign by
    that of the speed. A log does not hold the vehicle's constants, hotel load and battery: they
    stay those of the preset, and unknown.
    """
    meanings = {
        label: what
        for label in table.columns
        if (what := meaning(label, table.units.get(label, "")))
    }
    time = _time(table, meanings)
    labels, left = _labels(table, meanings)
    guesses = _guesses(table, meanings, labels, Vehicle(name))
    if not set(guesses) & set(READINGS):
        allowed = "one with a column for at least one of " + ", ".join(READINGS)
        raise refusal(
            "log",
            ", ".join(table.columns),
            allowed,
            "write the vehicle file by hand: see docs/vehicle.md",
        )
    rate, why = _sample_rate(table, time)
    shafts = 1 + any(channel.startswith("starboard") for channel in guesses)
    columns = {channel: guesses[channel].column for channel in CHANNELS if channel in guesses}
    vehicle = VehicleFile(Vehicle(name), columns, time.column if time else None, rate, shafts)
    comments = {f"channels.{channel}.column": guess.why for channel, guess in guesses.items()}
    comments |= (
        COMMENTS | ({"time.column": time.why} if time else {}) | {"vehicle.sample_rate": why}
    )
    comments["vehicle.shafts"] = "by the columns that are there"
    return Proposal(vehicle, comments, tuple(_absent(guesses, time, shafts)), tuple(left))


def _absent(guesses: Mapping[str, Guess], time: Guess | None, shafts: int) -> Iterable[str]:
    if time is None:
        yield f"time: no column whose numbers grow; rows are taken to be {1 / SAMPLE_RATE:g} s apart"
    for channel, spec in CHANNELS.items():
        if channel not in guesses and (shafts == 2 or not channel.startswith("starboard")):
            yield f"{channel}: no column; {spec.about} [{spec.unit}]"


def _labels(table: Table, meanings: Mapping[str, Meaning]) -> tuple[dict[str, str], list[str]]:
    """The column whose name fits best, by channel, and what is said of the others."""
    best: dict[str, str] = {}
    left = []
    for label in sorted(meanings, key=lambda label: -meanings[label].score):
        quantity = meanings[label].quantity
        side = meanings[label].side
        channel = f"{side}_{quantity}" if quantity in SIDED else quantity
        if quantity == "time":
            continue
        if channel in best:
            left.append(f"{label!r}: {channel} is {best[channel]!r}")
        elif channel in READINGS and not _varies(table.columns[label]):
            left.append(f"{label!r}: it is constant or empty")
        else:
            best[channel] = label
    for side in SIDES:
        command = best.pop(f"{side}_motor_command", None)
        if command and best.setdefault(f"{side}_rpm", command) != command:
            left.append(f"{command!r}: the shaft speed itself is there")
    for one, other in (("mission_speed", "speed_command"), ("speed_command", "mission_speed")):
        best |= {one: best[other]} if other in best and one not in best else {}
    return best, left


def _varies(values: np.ndarray) -> bool:
    known = values[np.isfinite(values)]
    return known.size > 0 and known.min() < known.max()


def _guesses(
    table: Table, meanings: Mapping[str, Meaning], labels: Mapping[str, str], vehicle: Vehicle
) -> dict[str, Guess]:
    """Columns with unit and sign. What turns with the speed has its sign; without a speed all go ahead mostly."""
    limits = largest_magnitudes(vehicle)
    guesses = {
        channel: _scaled(
            channel, table.columns[label], label, meanings[label], limits[channel], vehicle
        )
        for channel, label in labels.items()
    }
    ahead = np.ones(len(next(iter(table.columns.values()))))
    for channel in ("speed", *(name for name in READINGS if name.startswith(SIDES))):
        if channel in guesses:
            guesses[channel] = _signed(guesses[channel], table, ahead)
            if channel == "speed":
                column = guesses[channel].column
                ahead = column.scale * table.columns[column.name]
    return guesses


def _scaled(
    channel: str, values: np.ndarray, label: str, what: Meaning, limit: float, vehicle: Vehicle
) -> Guess:
    kind = CHANNELS[channel].unit
    known = abs(values[np.isfinite(values)])
    size = float(np.percentile(known, 95)) if known.size else 0.0
    if what.quantity == "motor_command":
        return _stand_in(label, known, vehicle)
    if what.unit:
        return Guess(Column(label, UNITS[kind][what.unit]), "by its name")
    fitting = (
        unit for unit in UNNAMED.get(kind, ()) if UNITS[kind][unit] * size < IMPOSSIBLE * limit
    )
    unit = "rev/s" if kind == "rpm" and size < SLOWEST_RPM else next(fitting, kind)
    return Guess(
        Column(label, UNITS[kind][unit]), f"its name has no unit; {unit} by its size, {size:.3g}"
    )


def _stand_in(label: str, known: np.ndarray, vehicle: Vehicle) -> Guess:
    """A motor command as a shaft speed: its largest value is full speed; pulse widths are at rest where least."""
    low, full = (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)
    rest = low if PULSES[0] <= low < full <= PULSES[1] else 0.0
    scale = vehicle.maximum_rpm / ((full - rest) or 1.0)
    words = f"the motor command stands in for the shaft speed: {rest:g} as rest, {full:g} as {vehicle.maximum_rpm:g} rpm"
    return Guess(Column(label, scale, -rest * scale), f"{words}; correct it")


def _signed(guess: Guess, table: Table, ahead: np.ndarray) -> Guess:
    """The column, turned round if it has the opposite sign of `ahead` (n_rows,)."""
    column = guess.column
    if np.nansum(np.sign(table.columns[column.name]) * np.sign(ahead)) >= 0:
        return guess
    why = f"{guess.why}; turned round, for it is negative while the vehicle goes ahead"
    return Guess(column._replace(scale=-column.scale), why)


def _time(table: Table, meanings: Mapping[str, Meaning]) -> Guess | None:
    """The first column of a time whose numbers grow, with its unit by name, size or step."""
    for label, what in meanings.items():
        values = table.columns[label]
        known = values[np.isfinite(values)]
        if what.quantity == "time" and known.size > 1 and known[-1] > known[0]:
            if what.unit:
                return Guess(Column(label, UNITS["s"][what.unit]), "by its name")
            size = float(np.median(known))
            steps = np.diff(known)
            step = float(np.median(steps[steps > 0]))
            since = (
                unit
                for unit, least in EPOCHS.items()
                if size > least and step * UNITS["s"][unit] < 10
            )
            epoch = next(since, None)
            unit = epoch or next(unit for unit, least in STEPS.items() if step > least)
            why = (
                f"counts from 1970 in {unit}, by its size"
                if epoch
                else f"in {unit}, by the step of {step:.3g}"
            )
            return Guess(Column(label, UNITS["s"][unit]), why)
    return None


def _sample_rate(table: Table, time: Guess | None) -> tuple[float, str]:
    """Rows per second in Hz, and how it was found; a clock with few ticks counts the rows between two."""
    if time is None:
        return SAMPLE_RATE, "a guess: no time in the log"
    stamps = time.column.scale * table.columns[time.column.name]
    steps = np.diff(stamps[np.isfinite(stamps)])
    coarse = np.mean(steps == 0) > 0.3
    rate = float(f"{1 / (steps[steps >= 0].mean() if coarse else np.median(steps[steps > 0])):.3g}")
    if 0.5 <= rate <= 1e4:
        return rate, "by the stamps of its rows"
    return SAMPLE_RATE, f"a guess: the stamps say {rate:g} Hz, which cannot be"
