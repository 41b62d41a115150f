"""Time stamps as text, in the notations of loggers, spreadsheets and libraries.

A notation is decided from the whole column: ``05/01`` alone may be in May or in January.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from training.field.logs.clock import DAY, HOUR, unwrapped

SHOWN = 60  # cells at either end of a column, by which its notation is found
LEAST_SHARE = 0.9  # of the cells that a notation has to explain
# rows with one stamp, above which 10:01 may be hours and minutes as well as minutes and seconds
MOST_PER_SECOND = 25
FIRST_YEAR_OF_CENTURY = 70  # of years with two digits
# of its usual steps, by which a clock may miss the full hour when summer time sets it
SUMMER_TIME_STEPS = 3
SUMMER_TIME_MONTHS = (3, 4, 9, 10, 11)
DAY_FIRST = "day first"
MONTH_FIRST = "month first"
YEAR_FIRST = "year first"
MONTHS = {
    name: month
    for month, names in enumerate(
        "jan,feb,mar mär mrz,apr,may mai,jun,jul,aug,sep,oct okt,nov,dec dez".split(","), start=1
    )
    for name in names.split()
}
ZONES = {  # h; those with one meaning in logs
    "": 0, "z": 0, "utc": 0, "gmt": 0, "wet": 0, "west": 1, "cet": 1, "mez": 1, "cest": 2,
    "mesz": 2, "eet": 2, "eest": 3, "est": -5, "edt": -4, "cst": -6, "cdt": -5, "mst": -7,
    "mdt": -6, "pst": -8, "pdt": -7,
}  # fmt: skip
SECONDS = r"(?P<second>\d{2}(?:[.,]\d+|:\d{3})?)"
CLOCKS = (
    rf"(?P<hour>\d{{1,2}}):(?P<minute>\d{{2}})(?::{SECONDS})?",
    rf"(?P<hour>\d{{1,2}})\.(?P<minute>\d{{2}})\.{SECONDS}",
    rf"(?P<hour>\d{{1,2}})-(?P<minute>\d{{2}})-{SECONDS}",
    r"(?P<hour>\d{2})(?P<minute>\d{2})(?P<second>\d{2}(?:[.,]\d+)?)",
)
ZONE = r"(?:Z|z|(?:UTC|GMT)?[+-]\d{1,2}(?::?\d{2})?|[A-Za-z]{3,5})"
SUFFIX = rf"\s*(?P<half>[AaPp]\.?\s?[Mm]\.?)?\s*(?P<zone>{ZONE})?(?:\s*[\[(][^\])]+[\])])?"
WEEKDAY = r"(?:[A-Za-z]{2,9}\.?,?\s+)?"
NAME = r"(?P<name>[A-Za-zä]{3,9})\.?"
YEAR = r"(?P<year>\d{4}|\d{2})"
DATES = (
    r"(?P<year>\d{4})[-/.:](?P<month>\d{1,2})[-/.:](?P<day>\d{1,2})",
    r"(?P<first>\d{1,2})(?P<mark>[-/.])(?P<middle>\d{1,2})[-/.](?P<last>\d{4}|\d{2})",
    r"(?P<year>\d{4})(?P<month>\d{2})(?P<day>\d{2})",
    r"(?P<year>\d{4})[-:](?P<day>\d{3})",
    rf"(?P<day>\d{{1,2}})[-./\s]*{NAME}[-./,\s]*{YEAR}",
    rf"{NAME}\s+(?P<day>\d{{1,2}}),?\s+(?P<year>\d{{4}})",
)
BETWEEN = r"(?:\s*[T,;_]\s*|\s+-\s+|\s+|-|:)"
DURATION = r"(?:(?P<days>-?\d+)(?:\s*days?,?\s*|\.)\+?)?"
NOTATIONS = (
    rf"^(?P<sign>-)?{DURATION}(?P<hour>\d{{1,4}}):(?P<minute>\d{{2}}):{SECONDS}{SUFFIX}$",
    rf"^(?P<sign>-)?(?P<minute>\d{{1,4}}):{SECONDS}{SUFFIX}$",
    *(rf"^{WEEKDAY}{date}(?:{BETWEEN}{clock}{SUFFIX})?$" for date in DATES for clock in CLOCKS),
    rf"^{WEEKDAY}{NAME}\s+(?P<day>\d{{1,2}})\s+{CLOCKS[0]}\s+(?:{ZONE}\s+)?(?P<year>\d{{4}})$",
    r"^(?P<sign>-)?P(?:(?P<days>[\d.]+)D)?"
    r"(?:T(?:(?P<hour>[\d.]+)H)?(?:(?P<minute>[\d.]+)M)?(?:(?P<second>[\d.,]+)S)?)?$",
    r"^(?:(?P<hour>\d+)\s?h\w*\s*)?(?:(?P<minute>\d+)\s?m(?:in)?\s*)?"
    r"(?P<second>\d+(?:[.,]\d+)?)\s?s\w*$",
)
# notations without marks, which are read as such only where a name says that it is a time
DIGITS = (
    r"^(?P<year>(?:19|20)\d{2})(?P<month>\d{2})(?P<day>\d{2})"
    r"(?P<hour>[0-2]\d)(?P<minute>[0-5]\d)(?P<second>[0-5]\d(?:[.,]\d+)?)$",
    r"^(?P<year>(?:19|20)\d{2})(?P<month>[01]\d)(?P<day>[0-3]\d)$",
    r"^(?P<hour>[0-2]\d)(?P<minute>[0-5]\d)(?P<second>[0-5]\d(?:[.,]\d+)?)$",
)


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


@lru_cache(maxsize=4096)
def is_stamp(cell: str) -> bool:
    """Whether a cell is written like a time stamp or a duration.

    >>> is_stamp("40:10.1"), is_stamp("May 1, 2024 10:00:00 AM"), is_stamp("1.5")
    (True, True, False)
    """
    return any(re.match(notation, cell) for notation in NOTATIONS)


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


def zone_hours(zone: str) -> float:
    """Hours by which a zone is before universal time; NaN for one that is not known.

    >>> zone_hours("+0530"), zone_hours("UTC-3"), zone_hours("CEST")
    (5.5, -3.0, 2)
    """
    offset = re.fullmatch(r"(?:UTC|GMT)?([+-])(\d{1,2}):?(\d{2})?", zone)
    if offset is None:
        return ZONES.get(zone.lower(), math.nan)
    sign, hours, minutes = offset.groups()
    return (-1 if sign == "-" else 1) * (int(hours) + int(minutes or 0) / 60)


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
        return {
            DAY_FIRST: days_since_1970(
                _whole_year(fields.numbers("year")), month, fields.numbers("day")
            )
        }
    if "last" not in fields:
        year = fields.numbers("year")
        if "month" not in fields:
            return {
                YEAR_FIRST: days_since_1970(year, np.ones_like(year), fields.numbers("day"), 366)
            }
        return {YEAR_FIRST: days_since_1970(year, fields.numbers("month"), fields.numbers("day"))}
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


def _in_two_parts(fields: Fields, hint: str, is_whole: bool) -> Stamps:
    """Stamps like 40:10.1 and 10:01: minutes and seconds, or hours and minutes."""
    first = fields.numbers("minute")
    second = fields.numbers("second")
    sign = np.where(fields.by_text("sign", len) > 0, -1.0, 1.0)
    if fields.has("half") or "hh:mm" in hint:
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
    rows_per_stamp = known.size / np.unique(clock[~np.isnan(clock)]).size
    if not is_whole or rows_per_stamp > MOST_PER_SECOND:
        raise Undecided("minutes and seconds, or hours and minutes")
    return Stamps(clock, period=period, remark="read as minutes and seconds")


def seconds_of(stamps: Stamps, is_whole: bool = True) -> tuple[np.ndarray, str]:
    """Seconds since 1970 (n_rows,), or since a midnight where there is no date, and a remark.

    Where a clock begins again, as after midnight, its seconds go on. `Undecided` where day and
    month may be either, and the rows do not show which.
    """
    if not stamps.dates:
        return unwrapped(stamps.clock, stamps.period), stamps.remark
    readings = {order: DAY * days + stamps.clock for order, days in stamps.dates.items()}
    order, remark = _only_order(readings, is_whole)
    if not (stamps.is_local and stamps.has_clock and is_whole):
        return readings[order], "; ".join(filter(None, (stamps.remark, remark)))
    seconds, n_changes = without_summer_time(readings[order])
    if n_changes:
        remark = f"the clock was set by an hour for summer time; the time goes on ({n_changes})"
    return seconds, "; ".join(filter(None, (stamps.remark, remark)))


def _only_order(readings: Mapping[str, np.ndarray], is_whole: bool) -> tuple[str, str]:
    """The order of day and month, and a remark where it does not matter which."""
    orders = list(readings)
    if len(orders) == 1:
        return orders[0], ""
    if not is_whole:
        raise Undecided(", or ".join(orders))
    elapsed = [_elapsed(readings[order]) for order in orders]
    if all(np.array_equal(elapsed[0], other) for other in elapsed[1:]):
        return orders[0], f"dates may be {' or '.join(orders)}; the time between rows is the same"
    unbroken = [
        order
        for order, one in zip(orders, elapsed, strict=True)
        if abs(np.diff(one)).max(initial=0.0) < DAY
    ]
    if len(unbroken) != 1:
        raise Undecided(", or ".join(orders))
    return unbroken[0], f"dates read {unbroken[0]}: otherwise the rows would be days apart"


def _elapsed(seconds: np.ndarray) -> np.ndarray:
    known = seconds[~np.isnan(seconds)]
    return np.round(known - known[:1], 6)


def without_summer_time(seconds: np.ndarray) -> tuple[np.ndarray, int]:
    """Local time (n_rows,) without the hours by which summer time sets a clock, and their number.

    That is on a Sunday in spring or autumn, at a full hour.
    """
    rows = np.flatnonzero(~np.isnan(seconds))
    known = seconds[rows]
    steps = np.diff(known)
    places = np.flatnonzero((abs(steps) > HOUR / 2) & (abs(steps) < 2 * HOUR))
    if not places.size:
        return seconds, 0
    near = SUMMER_TIME_STEPS * np.median(abs(steps))
    hours = np.sign(steps[places])
    after = known[places + 1]
    is_hour = (abs(steps[places] - HOUR * hours) <= near) & (after % HOUR <= near)
    is_change = is_hour & _may_change(after)
    shift = np.zeros(known.size)
    shift[places[is_change] + 1] = HOUR * hours[is_change]
    corrected = seconds.copy()
    corrected[rows] = known - np.cumsum(shift)
    return corrected, int(is_change.sum())


def _may_change(seconds: np.ndarray) -> np.ndarray:
    """Whether a time is on a Sunday of the months in which summer time begins or ends."""
    days = np.floor(seconds / DAY).astype("datetime64[D]")
    month = days.astype("datetime64[M]").astype(int) % 12 + 1
    is_sunday = (days.astype(int) + 4) % 7 == 0  # 1 January 1970 was a Thursday
    return is_sunday & np.isin(month, SUMMER_TIME_MONTHS)
