"""What a column can be: a quantity with a score, by name, unit and values, or why it is none."""

import math
import re
from typing import NamedTuple

import numpy as np

from auv_fault_env.parameters import FASTEST
from training.field.proposal.header import Name
from training.field.proposal.sides import Mark
from training.field.proposal.symbols import SEA, Context, quantity_of_symbol
from training.field.proposal.words import SIDE_PAIRS
from training.field.units import UNITS, spelt

# unit of the channel by quantity; a duty has none
KINDS = {
    "time": "s",
    "speed": "m/s",
    "speed_command": "m/s",
    "mission_speed": "m/s",
    "acceleration": "m/s^2",
    "rudder": "rad",
    "stern_plane": "rad",
    "voltage": "V",
    "current": "A",
    "rpm": "rpm",
    "duty": "",
    "rpm_command": "rpm",
    "supply_voltage": "V",
    "supply_current": "A",
}
SIDED = ("voltage", "current", "rpm", "duty", "rpm_command")
COMMANDS = ("speed_command", "mission_speed", "rudder", "stern_plane", "duty", "rpm_command")
WITHOUT_COMMAND = ("time", "acceleration", "current", "supply_current", "supply_voltage")
OF_NO_SIDE = "a thruster at bow or stern, vertical or lateral, is on neither side"
# evidence, in points
WORD = 4  # a word names the quantity
UNIT_ALONE = 3  # a part of the vehicle and a unit stand for the quantity
SYMBOL = 2
NAMED_UNIT = 2
THROUGH_WATER = 2
SURGE = 1
GROUND = -1
MOTOR = 1
COMMANDED_VOLTAGE = -2
UNKNOWN_WORD = -1
UNKNOWN_HEAD = -2  # besides: of current_task the task is named
ENOUGH = 2
# largest magnitudes of any vehicle, in the unit of the channel
LARGEST = {
    "m/s": FASTEST,
    "m/s^2": 100.0,
    "rad": 0.55 * math.pi,
    "V": 1000.0,
    "A": 1000.0,
    "rpm": 1e5,
}
# units that are tried where none is named and the numbers are beyond every vehicle in the first
UNITS_BY_SIZE = {
    "m/s": ("m/s", "cm/s", "mm/s"),
    "rad": ("rad", "deg"),
    "V": ("V", "mV"),
    "A": ("A", "mA"),
}
# a shaft that never turns faster is taken to be logged in revolutions per second
SLOWEST_RPM = 60.0
MISSING_MARK = re.compile(r"9{2,}(?:\.9+)?|32767|32768|65535|214748364[78]|4294967295")
FAR = 3.0  # times the largest of the other values
PULSES = (700.0, 2300.0)  # us, limits of the pulses that command a motor driver
MIDNIGHT = 0.9 * 86_400.0  # s: a longer step back is that of a clock without a date
ALSO_SPELT = {("ms", "m/s"): "m/s"}  # speed_ms, where ms alone are milliseconds
DUTY_UNITS = ("%", "pct", "percent", "us", "µs", "μs", "usec")


class Match(NamedTuple):
    """A column as a quantity."""

    label: str
    quantity: str  # of `KINDS`
    mark: Mark
    unit: str | None  # None if none is named
    score: int  # the higher, the more certain
    unknown: tuple[str, ...]  # words of its name without a known meaning


class Refused(NamedTuple):
    """A column that is no quantity of the vehicle."""

    label: str
    why: str  # empty if nothing is known of it
    quantity: str = ""  # by its name, where its values are against it


def match_of(
    label: str, name: Name, mark: Mark, values: np.ndarray, context: Context, is_stamp: bool = False
) -> Match | Refused:
    """The column as the quantity that it is most certainly, or why it is none.

    Parameters
    ----------
    label, name
        Of the column.
    mark
        Of its side.
    values
        (n_rows,)
    context
        Of the log.
    is_stamp
        Whether its cells are time stamps.
    """
    why = _foreign(name)
    if why:
        return Refused(label, why)
    if is_stamp and not name.quantities:
        why = _against_values("time", "s", values)
        return Refused(label, why) if why else Match(label, "time", mark, "s", ENOUGH, ())
    if not name.stem:
        return Refused(label, "")
    quantity, points, why = _quantity(label, name, mark, values, context)
    if not quantity:
        return Refused(label, why)
    if "place" in name.roles and quantity in SIDED:
        return Refused(label, OF_NO_SIDE)
    if "command" in name.roles and quantity in WITHOUT_COMMAND:
        return Refused(label, f"a command of {_spoken(quantity)} is no channel")
    unit = _unit(name, quantity)
    if unit is None and name.unit:
        return Refused(label, f"[{name.unit}] is no unit of {_spoken(quantity)}")
    score = points + _points_beside(name, quantity, unit, mark)
    if score < ENOUGH:
        return Refused(label, "")
    why = _against_values(quantity, unit, values)
    if why:
        return Refused(label, why, quantity)
    return Match(label, quantity, mark, unit, score, name.unknown)


def _foreign(name: Name) -> str:
    """Why the name is none of a channel's; empty if it can be one."""
    others = dict(name.others)
    if name.quantities & {"rudder", "stern_plane"}:
        others = {word: other for word, other in others.items() if "place" not in other}
    if others:
        word, other = next(iter(others.items()))
        return f"{word!r} names {other}"
    return ""


def _quantity(
    label: str, name: Name, mark: Mark, values: np.ndarray, context: Context
) -> tuple[str, int, str]:
    """The quantity by name, its points, and why there is none."""
    quantities = set(name.quantities)
    points = WORD
    if quantities == {"speed", "rpm"} or (quantities == {"speed"} and "motor" in name.roles):
        quantities = {"rpm"}
    if quantities == {"time", "current"}:
        quantities = {"time"}  # the time now
    if quantities == {"speed"} and isinstance(mark, str) and "command" not in name.roles:
        return "", 0, "a speed of one side could be that of a shaft"
    if len(quantities) > 1:
        return "", 0, f"it could be {' or '.join(sorted(quantities))}"
    is_bare = not name.unit and mark is None and not name.roles & {"motor", "supply"}
    if quantities == {"current"} and is_bare and SEA in context.others:
        return "", 0, f"beside the other columns it could be {SEA}"
    if not quantities and name.symbol:
        quantity, why = quantity_of_symbol(label, name, mark, context)
        if not quantity:
            return "", 0, why
        quantities = {quantity}
        points = SYMBOL
    if not quantities:
        quantities = _of_parts(name, mark, values)
        points = UNIT_ALONE
    if not quantities:
        return "", 0, ""
    return _as_command_or_supply(quantities.pop(), name), points, ""


def _as_command_or_supply(quantity: str, name: Name) -> str:
    """The quantity as that of a command or of the supply where a word names one."""
    if "supply" in name.roles and "motor" not in name.roles and quantity in ("voltage", "current"):
        return f"supply_{quantity}"
    if quantity == "speed" and "mission" in name.roles:
        return "mission_speed"
    if "command" in name.roles and quantity in ("speed", "rpm"):
        return f"{quantity}_command"
    return quantity


def _of_parts(name: Name, mark: Mark, values: np.ndarray) -> set[str]:
    """The quantity of a name without one: motor_cmd, left_cmd, port [V], motor1 in pulses."""
    is_part = bool(name.roles & {"motor", "supply"}) or mark is not None
    is_motor = "motor" in name.roles or isinstance(mark, str)
    if is_motor and not name.unit and ("command" in name.roles or are_pulses(values)):
        return {"duty"}
    if is_part:
        kinds = {"V": "voltage", "A": "current", "rpm": "rpm"}
        return {quantity for kind, quantity in kinds.items() if spelt(name.unit, kind)}
    return {"speed"} if "surge" in name.stem else set()


def _unit(name: Name, quantity: str) -> str | None:
    """The named unit, of the quantity's kind; None if there is none."""
    kind = KINDS[quantity]
    if kind == "rpm" and "omega" in name.stem and not name.unit:
        return "rad/s"
    if not kind:
        return name.unit if name.unit in DUTY_UNITS else None
    return ALSO_SPELT.get((name.unit, kind)) or spelt(name.unit, kind)


def _points_beside(name: Name, quantity: str, unit: str | None, mark: Mark) -> int:
    """Points of all but the word or the symbol."""
    short_marks = {word for pair in SIDE_PAIRS for word in pair} if isinstance(mark, str) else set()
    points = NAMED_UNIT * bool(unit)
    points += UNKNOWN_WORD * len(set(name.unknown) - short_marks)
    points += UNKNOWN_HEAD * len(set(name.unknown_heads) - short_marks)
    if KINDS[quantity] == "m/s":
        points += THROUGH_WATER * ("water" in name.roles)
        points += SURGE * ("surge" in name.roles or "vehicle" in name.stem or name.symbol == "vx")
        points += GROUND * ("ground" in name.roles)
    if quantity in SIDED:
        points += MOTOR * ("motor" in name.roles)
    if quantity == "voltage":
        points += COMMANDED_VOLTAGE * ("command" in name.roles)
    return points


def _against_values(quantity: str, unit: str | None, values: np.ndarray) -> str:
    """What in the values (n_rows,) is against the quantity; empty if nothing is."""
    known = values[np.isfinite(values)]
    if known.size == 0:
        return "it holds no number"
    if quantity == "time" and known.size < 0.5 * values.size:
        return "most of its cells hold no time"
    if quantity == "time":
        return _against_time(known)
    if known.min() == known.max():
        return f"it is constant at {known[0]:.6g}"
    if quantity not in COMMANDS:
        levels = np.unique(known)
        is_whole = bool((levels == np.round(levels)).all())
        if set(levels) <= {0.0, 1.0}:
            return "it is only 0 and 1"
        if is_whole and levels.size > 2 and (np.diff(known) >= 0).all():
            return "it counts up"
    kind = KINDS[quantity]
    if kind and unit_by_size(kind, unit, known) is None:
        named = unit or kind
        return f"{_size(without_missing_mark(known)):.4g} {named} is beyond every vehicle"
    return ""


def _against_time(known: np.ndarray) -> str:
    """A time grows, but for stamps out of order and for midnight."""
    steps = np.diff(known)
    back = -steps[(steps < 0) & (steps > -MIDNIGHT)].sum()
    growth = steps[steps > 0].sum()
    is_time = growth > 0 and back < 0.5 * growth and np.mean(steps >= 0) > 0.8
    return "" if is_time else "it does not grow as a time does"


def are_pulses(values: np.ndarray) -> bool:
    """Whether the values (n_rows,) are pulses that command a motor driver, in us."""
    known = values[np.isfinite(values)]
    return known.size > 0 and PULSES[0] <= known.min() < known.max() <= PULSES[1]


def _size(values: np.ndarray) -> float:
    known = abs(values[np.isfinite(values)])
    return float(np.percentile(known, 95)) if known.size else 0.0


def without_missing_mark(values: np.ndarray) -> np.ndarray:
    """The values (n_rows,), NaN where they are a far number of nines, or a far end of integers.

    Such as -9999, which loggers write for a reading that they do not have.
    """
    size = np.where(np.isfinite(values), abs(values), 0.0)
    largest = size.max(initial=0.0)
    is_mark = size == largest
    is_number = bool(MISSING_MARK.fullmatch(f"{largest:.10g}"))
    is_far = 0.0 < FAR * size.max(where=~is_mark, initial=0.0) < largest
    is_usual = is_number and is_far and is_mark.sum() > 1
    return np.where(is_mark, np.nan, values) if is_usual else values


def unit_by_size(kind: str, unit: str | None, values: np.ndarray) -> str | None:
    """The unit of values (n_rows,): the named one, else that of the channel unless it is too large.

    None if the values are beyond every vehicle in each unit. Size alone never makes a value smaller
    that a vehicle can have: 80.9 V stay 80.9 V.
    """
    size = _size(without_missing_mark(values))
    units = (unit,) if unit else UNITS_BY_SIZE.get(kind, (kind,))
    fitting = (one for one in units if UNITS[kind][one] * size <= LARGEST[kind])
    found = next(fitting, None)
    return "rev/s" if found == "rpm" and not unit and size < SLOWEST_RPM else found


def _spoken(quantity: str) -> str:
    return quantity.replace("_", " ")
