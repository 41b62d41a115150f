"""Times in several columns: date and clock, or hour, minute and second."""

import re
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from training.field.logs.clock import DAY, HOUR
from training.field.logs.stamps import YEAR_FIRST, Stamps, days_since_1970

WORDS = frozenset(
    "t time timestamp stamp datetime date clock utc gmt epoch sec secs seconds zeit uhrzeit "
    "zeitstempel datum heure temps hora fecha tempo tijd".split()
)
OTHER_WORDS = frozenset("zone offset out constant run lag delay step delta diff interval".split())
PARTS = {
    "year": "year yyyy yr jahr",
    "month": "month mon monat",
    "day": "day dd tag",
    "hour": "hour hours hh h hr hrs stunde",
    "minute": "minute minutes min mins mm m",
    "second": "second seconds sec secs ss s sekunde",
}
CLOCK_PARTS = frozenset(("hour", "minute", "second"))
DATE_PARTS = frozenset(("year", "month", "day"))
LARGEST = {"year": 9999, "month": 12, "day": 31, "hour": 24, "minute": 59, "second": 61}


def beside_name(label: str) -> str:
    """The text in brackets of a column's name.

    >>> beside_name("Time [mm:ss]")
    'mm:ss'
    """
    found = re.search(r"[\[(]([^\])]*)[\])]", label)
    return found[1] if found else ""


def is_named_as_time(label: str) -> bool:
    """Whether a word of the name says that the column is a time.

    >>> is_named_as_time("GPSTime [s]"), is_named_as_time("time zone"), is_named_as_time("T3_rpm")
    (True, False, False)
    """
    plain = label.replace(f"[{beside_name(label)}]", "")
    words = {word.lower() for word in re.findall(r"[A-Z]?[a-zäü]+|[A-Z]+(?![a-z])|\d+", plain)}
    is_only_t = "t" not in words or len(words) == 1
    return bool(WORDS & words) and not OTHER_WORDS & words and is_only_t


def with_dates(
    stamps: Mapping[str, Stamps], labels: Sequence[str]
) -> tuple[dict[str, Stamps], list[tuple[str, str]]]:
    """The stamps, with the date of a column beside a clock's added to it; and the pairs of names.

    Of several clocks, the one next to the date has it. Either column of a pair holds both.
    """
    together = dict(stamps)
    pairs = []
    clocks = [label for label, one in stamps.items() if not one.dates and np.isfinite(one.period)]
    for label, one in stamps.items():
        if not one.dates or one.has_clock or not clocks:
            continue
        place = labels.index(label)
        nearest = min(clocks, key=lambda clock: abs(labels.index(clock) - place))
        clock = stamps[nearest]
        is_one_date = all(np.nanmax(days) == np.nanmin(days) for days in one.dates.values())
        period = clock.period if is_one_date else np.inf  # a date of the start may stay
        both = clock._replace(dates=one.dates, period=period)
        together |= {label: both, nearest: both}
        pairs.append((label, nearest))
    return together, pairs


def part_labels(labels: Iterable[str]) -> dict[str, str]:
    """The columns of hour, minute and second, and of a date beside them; empty without all three.

    >>> part_labels(["Hour", "Minute", "Second [s]", "u"])
    {'hour': 'Hour', 'minute': 'Minute', 'second': 'Second [s]'}
    """
    labels = list(labels)
    found = {}
    for part, names in PARTS.items():
        named = [label for label in labels if _last_word(label) in names.split()]
        if len(named) == 1:
            found[part] = named[0]
    if not CLOCK_PARTS <= set(found):
        return {}
    if not DATE_PARTS <= set(found):
        found = {part: label for part, label in found.items() if part in CLOCK_PARTS}
    return found


def time_of_parts(columns: Mapping[str, np.ndarray]) -> Stamps | None:
    """The time of the columns of `part_labels`; None if their numbers are none of a time."""
    labels = part_labels(columns)
    parts = {part: columns[label] for part, label in labels.items()}
    if not parts or not all(map(_can_be, parts, parts.values())):
        return None
    clock = HOUR * parts["hour"] + 60.0 * parts["minute"] + parts["second"]
    if "year" not in parts:
        return Stamps(clock, period=DAY)
    days = days_since_1970(parts["year"], parts["month"], parts["day"])
    return Stamps(clock, {YEAR_FIRST: days})


def _can_be(part: str, values: np.ndarray) -> bool:
    known = values[np.isfinite(values)]
    is_whole = part == "second" or bool((known % 1 == 0).all())
    return is_whole and known.size > 0 and known.min() >= 0 and known.max() <= LARGEST[part]


def _last_word(label: str) -> str:
    words = re.findall(r"[a-zäü]+", label.replace(f"[{beside_name(label)}]", "").lower())
    return words[-1] if words else ""
