"""Time stamps as text, in the notations of loggers, spreadsheets and libraries.

A notation is decided from the whole column: ``05/01`` alone may be in May or in January.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from training.field.logs.clock import DAY, GAP, HOUR, UNORDERED
from training.field.logs.notations import DIGITS, MONTHS, NOTATIONS, zone_hours

SHOWN = 60  # cells at either end of a column, by which its notation is found
LEAST_SHARE = 0.9  # of the cells that a notation has to explain
# rows with one stamp, above which 10:01 may be hours and minutes as well as minutes and seconds
MOST_PER_SECOND = 25
FEWEST_OF_DIGITS = 10  # different numbers that may be hour, minute and second
LAST_OF_DIGITS = 240_000.0
LAST_SECOND = 61.0  # of a minute, with a leap second
TURNS_OF_DIGITS = (1, 41, -2359)  # hundreds, into the next minute, hour and day
FIRST_YEAR_OF_CENTURY = 70  # of years with two digits
DAY_FIRST = "day first"
MONTH_FIRST = "month first"
YEAR_FIRST = "year first"


class Stamps(NamedTuple):
    """A column of time stamps: date and time of the day apart."""

    clock: np.ndarray  # s (n_rows,), 0 in a date without a time, NaN for what is no stamp
    # by the order of its fields: days since 1970 (n_rows,), NaN for no date; empty without dates
    dates: Mapping[str, np.ndarray] = MappingProxyType({})
    period: float = np.inf  # s, after which the clock begins again; never for a time that passed
    has_clock: bool = True
    is_local: bool = True  # without the difference to universal time
    remark: str = ""
    example: str = ""  # one of the cells


class Undecided(ValueError):
    """Stamps that can be read in two ways; the message says which."""


def read_stamps(
    cells: pa.Array, hint: str = "", only_digits: bool = False, is_whole: bool = True
) -> Stamps | None:
    """The stamps of a column (n_rows,), null for missing ones; None if its cells are none.

    The hint is the text beside its name, as in ``Time [mm:ss]``. Cells of digits alone are stamps
    only if all are, and where `only_digits` asks for it. Without `is_whole` they are the first
    cells of a column, and what its other cells would decide is `Undecided`.
    """
    if cells.null_count == len(cells):
        return None
    stamps = None if only_digits else _iso_stamps(cells)
    if stamps is not None:
        return stamps
    notation = _notation(cells, DIGITS if only_digits else NOTATIONS)
    if notation is None:
        return None
    fields = Fields(cells, notation)
    if "year" in notation or "last" in notation:
        stamps = _dated(fields, hint)
    elif "hour" in notation:
        stamps = _of_clock(fields, is_limited=only_digits or "zone" in fields)
    else:
        stamps = _in_two_parts(fields, hint.lower(), is_whole)
    if only_digits and np.isnan(stamps.clock).sum() > cells.null_count:
        return None
    zone = _only_unknown_zone(fields)
    remark = f"zone {zone!r} taken for universal time" if zone else stamps.remark
    return stamps._replace(example=cells.drop_null()[0].as_py(), remark=remark)


def _iso_stamps(cells: pa.Array) -> Stamps | None:
    """The stamps of a column in ISO form alone, which Arrow reads; None for another one."""
    for zone in (None, "UTC"):
        try:
            cells[:SHOWN].cast(pa.timestamp("us", zone))  # a long cast that fails takes long
            stamps = cells.cast(pa.timestamp("us", zone)).cast(pa.int64())
        except pa.ArrowInvalid:
            continue
        seconds = stamps.to_numpy(zero_copy_only=False) / 1e6
        days = np.floor_divide(seconds, DAY)
        has_clock = pc.max(pc.utf8_length(cells)).as_py() > len("2024-05-01")
        clock = np.round(seconds - DAY * days, 6)
        return Stamps(clock, {YEAR_FIRST: days}, has_clock=has_clock, is_local=zone is None)
    return None


def _notation(cells: pa.Array, notations: Sequence[str]) -> str | None:
    """The notation of most cells at the ends of a column, if it is that of nearly all there."""
    known = cells.drop_null()
    sample = [*known[:SHOWN].to_pylist(), *known[-SHOWN:].to_pylist()]
    counts = [sum(1 for cell in sample if re.match(one, cell)) for one in notations]
    most = max(counts)
    return notations[counts.index(most)] if most > LEAST_SHARE * len(sample) else None


class Fields:
    """The fields of the stamps of a column, by the names in their notation."""

    def __init__(self, cells: pa.Array, notation: str):
        self._parts = pc.extract_regex(cells, notation)
        self._names = {field.name for field in self._parts.type}
        self.is_missing = self._parts.is_null().to_numpy(zero_copy_only=False)

    def __contains__(self, name: str) -> bool:
        return name in self._names

    def text(self, name: str) -> pa.Array:
        """A field as text; empty without that field."""
        if name not in self:
            return pa.array([""] * len(self._parts))
        return pc.fill_null(pc.struct_field(self._parts, name), "")

    def numbers(self, name: str) -> np.ndarray:
        """A field as numbers (n_rows,); 0 where a stamp does not have it, NaN without a stamp."""
        if name not in self:
            return np.where(self.is_missing, np.nan, 0.0)
        text = pc.replace_substring_regex(self.text(name), "[,:]", ".")
        text = pc.if_else(pc.equal(text, ""), "0", text)
        numbers = text.cast(pa.float64()).to_numpy(zero_copy_only=False)
        return np.where(self.is_missing, np.nan, numbers)

    def longest(self, name: str) -> int:
        """Characters of the longest text of a field."""
        return pc.max(pc.utf8_length(self.text(name))).as_py()

    def has(self, name: str) -> bool:
        """Whether any stamp has the field."""
        return name in self and bool(pc.any(pc.not_equal(self.text(name), "")).as_py())

    def by_text(self, name: str, numbers: Callable[[str], float]) -> np.ndarray:
        """A field as the number (n_rows,) that a function gives for its text."""
        encoded = self.text(name).dictionary_encode()
        values = np.array([numbers(text) for text in encoded.dictionary.to_pylist()], float)
        return values[encoded.indices.to_numpy()]


def _time_of_day(fields: Fields) -> np.ndarray:
    """Seconds since midnight in universal time (n_rows,), NaN for an impossible time."""
    hour = fields.numbers("hour")
    if fields.has("half"):
        hour = _hour_of_half(fields, hour)
    clock = _sum_of(hour, fields)
    return np.where(hour <= 24, clock, np.nan) - HOUR * _zone_hours(fields)


def _hour_of_half(fields: Fields, hour: np.ndarray) -> np.ndarray:
    """The hour of the day (n_rows,) from that of a half with AM or PM; NaN for one beyond 12."""
    after = fields.by_text("half", lambda text: {"a": 0.0, "p": 12.0}.get(text[:1].lower(), np.nan))
    return np.where((hour >= 1) & (hour <= 12), hour % 12 + after, np.nan)


def _sum_of(hour: np.ndarray, fields: Fields, is_limited: bool = True) -> np.ndarray:
    """Seconds of hours, minutes and seconds; NaN where they are limited and beyond."""
    minute = fields.numbers("minute")
    second = fields.numbers("second")
    is_possible = (minute < 60) & (second < 61) | (not is_limited)
    return np.where(is_possible, HOUR * hour + 60.0 * minute + second, np.nan)


def _zone_hours(fields: Fields) -> np.ndarray:
    """Hours by which a zone is before universal time (n_rows,); NaN for one of several unknown."""
    if not fields.has("zone") or _only_unknown_zone(fields):
        return np.zeros(len(fields.is_missing))
    return fields.by_text("zone", zone_hours)


def _only_unknown_zone(fields: Fields) -> str:
    """The zone of all stamps, if it is not known; else empty."""
    zones = {zone for zone in pc.unique(fields.text("zone")).to_pylist() if zone}
    zone = zones.pop() if len(zones) == 1 else ""
    return zone if math.isnan(zone_hours(zone)) else ""


def _dated(fields: Fields, hint: str) -> Stamps:
    has_clock = fields.has("hour")
    clock = _time_of_day(fields)
    orders = _orders(fields, hint)
    losses = {order: np.isnan(days).sum() for order, days in orders.items()}
    fewest = min(losses.values())
    dates = {order: days for order, days in orders.items() if losses[order] == fewest}
    if fields.has("half") and MONTH_FIRST in dates:
        dates = {MONTH_FIRST: dates[MONTH_FIRST]}
    return Stamps(clock, dates, has_clock=has_clock, is_local=not fields.has("zone"))


def _orders(fields: Fields, hint: str) -> dict[str, np.ndarray]:
    """Days since 1970 (n_rows,) by the order in which the fields of the dates may be read."""
    if "name" in fields:
        month = fields.by_text("name", lambda text: MONTHS.get(text[:3].lower(), math.nan))
        year = _whole_year(fields.numbers("year"))
        return {DAY_FIRST: days_since_1970(year, month, fields.numbers("day"))}
    if "last" not in fields:
        year = fields.numbers("year")
        day = fields.numbers("day")
        if "month" in fields:
            return {YEAR_FIRST: days_since_1970(year, fields.numbers("month"), day)}
        return {YEAR_FIRST: days_since_1970(year, np.ones_like(year), day, 366)}
    first = fields.numbers("first")
    middle = fields.numbers("middle")
    last = fields.numbers("last")
    readings = {
        DAY_FIRST: (last, middle, first),
        MONTH_FIRST: (last, first, middle),
        YEAR_FIRST: (first, middle, last),
    }
    days = {}
    for order in _possible_orders(fields, hint.lower()):
        year, month, day = readings[order]
        days[order] = days_since_1970(_whole_year(year), month, day)
    return days


def _possible_orders(fields: Fields, hint: str) -> list[str]:
    named = re.search(r"\b(d+|m+|y+)[-/.](?:d+|m+)[-/.](?:d+|y+)\b", hint)
    if named:
        return [{"d": DAY_FIRST, "m": MONTH_FIRST, "y": YEAR_FIRST}[named[1][0]]]
    if pc.all(pc.equal(fields.text("mark"), ".")).as_py():
        return [DAY_FIRST]
    has_whole_years = fields.longest("last") == 4
    return [DAY_FIRST, MONTH_FIRST] if has_whole_years else [DAY_FIRST, MONTH_FIRST, YEAR_FIRST]


def _whole_year(year: np.ndarray) -> np.ndarray:
    """Years with four digits."""
    century = np.where(year < FIRST_YEAR_OF_CENTURY, 2000, 1900)
    return np.where(year < 100, year + century, year)


def days_since_1970(
    year: np.ndarray, month: np.ndarray, day: np.ndarray, last_day: int = 31
) -> np.ndarray:
    """Days since 1970 (n,), NaN for a date that does not exist."""
    is_known = (month >= 1) & (month <= 12) & (day >= 1) & (day <= last_day)
    months = np.where(is_known, 12 * (year - 1970) + month - 1, 0).astype("datetime64[M]")
    days = months.astype("datetime64[D]") + (np.where(is_known, day, 1) - 1).astype(int)
    is_in_month = (days.astype("datetime64[M]") == months) | (last_day > 31)
    return np.where(is_known & is_in_month, days.astype(np.int64).astype(float), np.nan)


def _of_clock(fields: Fields, is_limited: bool) -> Stamps:
    """Stamps of a time of the day, or of a time that has passed, whose parts may be unlimited."""
    sign = np.where(fields.by_text("sign", len) > 0, -1.0, 1.0)
    hour = fields.numbers("hour")
    known = hour[~np.isnan(hour)]
    if fields.has("days") or not is_limited or known.max(initial=0.0) > 24:
        days = sign * fields.numbers("days")  # as in -1 days +23:59:59
        rest = _sum_of(hour, fields, is_limited)
        return Stamps(DAY * days + np.where(days < 0, rest, sign * rest))
    is_half_day = not fields.has("half") and bool(((known >= 1) & (known <= 12)).all())
    return Stamps(sign * _time_of_day(fields), period=DAY / 2 if is_half_day else DAY)


def clock_of_digits(values: np.ndarray) -> Stamps | None:
    """The stamps of numbers (n_rows,) that go from 95959.5 to 100000.0; None for other numbers.

    Numbers that grow by less would have come by 95960 to 99999, which no clock shows.
    """
    known = values[np.isfinite(values)]
    if known.size < FEWEST_OF_DIGITS or known.min() < 0 or known.max() >= LAST_OF_DIGITS:
        return None
    if (known % 100 >= LAST_SECOND).any() or (known // 100 % 100 >= 60).any():
        return None
    steps = np.diff(known)
    is_growing = np.mean(steps < 0) <= UNORDERED and np.unique(known).size >= FEWEST_OF_DIGITS
    if not is_growing or not is_turn_of_digits(known[:-1], known[1:]).any():
        return None
    minutes = 60.0 * (values // 10_000) + values // 100 % 100
    return Stamps(60.0 * minutes + values % 100, period=DAY)


def is_turn_of_digits(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Whether numbers would go on into the next minute if they were times of the day (n,).

    >>> is_turn_of_digits(np.array([95959.5, 95999.5]), np.array([100000.0, 96000.0]))
    array([ True, False])
    """
    second = before % 100
    is_end = (second >= 60 - GAP) & (second < LAST_SECOND) & (after % 100 < GAP)
    return is_end & np.isin(after // 100 - before // 100, TURNS_OF_DIGITS)


def _in_two_parts(fields: Fields, hint: str, is_whole: bool) -> Stamps:
    """Stamps like 40:10.1 and 10:01: minutes and seconds, or hours and minutes."""
    first = fields.numbers("minute")
    second = fields.numbers("second")
    sign = np.where(fields.by_text("sign", len) > 0, -1.0, 1.0)
    if fields.has("half") or ("hh:mm" in hint and "ss" not in hint):
        clock = HOUR * first + 60.0 * second
        if fields.has("half"):
            clock = HOUR * _hour_of_half(fields, first) + 60.0 * second
        return Stamps(clock, period=DAY)
    known = first[~np.isnan(first)]
    clock = sign * np.where(second < 60, 60.0 * first + second, np.nan)
    period = HOUR if known.max(initial=0.0) < 60 else np.inf
    has_fraction = bool((second % 1 > 0).any()) or fields.longest("second") > 2
    if has_fraction or known.max(initial=0.0) > 24 or "mm:ss" in hint:
        return Stamps(clock, period=period)
    rows_per_stamp = known.size / max(1, np.unique(clock[~np.isnan(clock)]).size)
    if not is_whole or rows_per_stamp > MOST_PER_SECOND:
        raise Undecided("minutes and seconds, or hours and minutes")
    return Stamps(clock, period=period, remark="read as minutes and seconds")
