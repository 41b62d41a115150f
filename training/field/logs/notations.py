"""Notations of time stamps: patterns with a named group for each field, months and zones."""

import math
import re
from functools import lru_cache

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


@lru_cache(maxsize=4096)
def is_stamp(cell: str) -> bool:
    """Whether a cell is written like a time stamp or a duration.

    >>> is_stamp("40:10.1"), is_stamp("May 1, 2024 10:00:00 AM"), is_stamp("1.5")
    (True, True, False)
    """
    return any(re.match(notation, cell) for notation in NOTATIONS)


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
