"""The cells of a text log, in files and in streams: how lines are split, and what a cell means."""

import csv
import re
from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np

from training.field.units import is_unit

# of the cells of a line, by the name in remarks; the last: any number of blanks
SEPARATORS = {"\t": "tabs", ";": "semicolons", "|": "bars", ",": "commas", " ": "blanks"}
COMMENT_MARKS = "#%/"
LONGEST_LINE = 100_000  # characters
MISSING = ("", *"- -- --- ? * nan null none nil na n/a #n/a nat missing".split())
WORDS = dict.fromkeys(MISSING, float("nan")) | {"true": 1.0, "false": 0.0}
TIME_STAMP = re.compile(r"\d[\d.:/ TZ+-]*:\d\d[\d.,:Z+-]*")
DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(e[+-]?\d+)?", re.IGNORECASE)
DECIMAL_POINT = re.compile(r"[+-]?\d*\.\d+(e[+-]?\d+)?", re.IGNORECASE)
DAY_FIRST = re.compile(r"(\d\d)\.(\d\d)\.(\d{4})")


def cells_of(line: str, separator: str) -> list[str]:
    """The cells of a line, without the blanks and quotation marks around them.

    Where blanks separate, a unit in brackets stays with its name. `csv.Error` if it is no line.

    >>> cells_of('1.5, "2", east', ",")
    ['1.5', '2', 'east']
    """
    if separator == " ":
        return re.split(r"\s+(?![\[(])", line.strip())
    cells = next(csv.reader([line], delimiter=separator), [])
    return [cell.strip(" \t\"'") for cell in cells]


def without_stray_quotes(line: str) -> str:
    """The line without quotation marks if their number is odd: they would swallow other cells."""
    return line.replace('"', "") if line.count('"') % 2 else line


def separator_of(lines: Sequence[str]) -> str:
    """The separator that divides these lines into several cells, with most numbers among them."""

    def score(separator: str) -> tuple[bool, float]:
        rows = [cells_of(line, separator) for line in lines]
        width = usual_width(rows)
        shares = [share_of_values(row) for row in rows if len(row) == width]
        return width > 1, float(np.mean(shares))

    return max(SEPARATORS, key=score)


def usual_width(rows: Sequence[Sequence[str]]) -> int:
    """Number of cells of the rows that make up most of the table."""
    counts = Counter(map(len, rows))
    return max(counts, key=lambda width: width * counts[width])


def share_of_values(row: Sequence[str]) -> float:
    """Share of the cells that are numbers, time stamps or words for missing; empty cells aside."""
    filled = list(filter(None, row))
    return sum(map(_is_value, filled)) / len(filled) if filled else 0.0


def _is_value(cell: str) -> bool:
    return number(with_decimal_point(cell)) is not None or TIME_STAMP.fullmatch(cell) is not None


def decimal_mark(rows: Sequence[Sequence[str]]) -> str | None:
    """Comma or point, whichever the numbers of the rows have; the point if both; None if neither.

    >>> (
    ...     decimal_mark([["1", "0,5"]]),
    ...     decimal_mark([["0.5", "1,5"]]),
    ...     decimal_mark([["1"]]),
    ... )
    (',', '.', None)
    """
    cells = [cell for row in rows for cell in row]
    if any(map(DECIMAL_POINT.fullmatch, cells)):
        return "."
    return "," if any(map(DECIMAL_COMMA.fullmatch, cells)) else None


def with_decimal_point(cell: str) -> str:
    """The cell with a point for each comma."""
    return cell.replace(",", ".")


def is_unit_row(row: Sequence[str]) -> bool:
    """Whether most cells of the row name a unit; empty cells aside."""
    filled = [cell for cell in row if cell]
    return sum(map(is_unit, filled)) * 2 > len(filled)


def matching_names(
    names: Sequence[str], rows: Sequence[Sequence[str]], separator: str
) -> Sequence[str]:
    """The names of a header, one per cell of the rows below it where that is possible.

    Header or rows may end with a separator, and rows may begin with a number that has no name.
    """
    width = len(rows[0])
    if len(names) == width + 1 and not names[-1]:
        return names[:-1]
    if len(names) == width - 1:
        if not any(row[-1] for row in rows):
            return [*names, ""]
        if separator in "\t ":
            return ["", *names]
    return names


def number(cell: str) -> float | None:
    """The number in a cell, NaN for a word that means missing, None for other text.

    >>> number("1e3"), number("true"), number("fast")
    (1000.0, 1.0, None)
    """
    try:
        return float(cell)
    except ValueError:
        return WORDS.get(cell.lower())


def seconds(cell: str) -> float | None:
    """Seconds since 1970, or since midnight, of a time stamp; None for other text.

    A stamp is in ISO form, or its date is written with points or slashes.

    >>> (
    ...     seconds("1970-01-02T00:00:01.5Z"),
    ...     seconds("02.01.1970 00:00:01"),
    ...     seconds("00:01:00"),
    ... )
    (86401.5, 86401.0, 60.0)
    """
    text = DAY_FIRST.sub(r"\3-\2-\1", cell).replace("/", "-")
    has_date = "-" in text[:8]
    try:
        stamp = datetime.fromisoformat(text if has_date else f"1970-01-01T{text}")
        in_zone = stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)
        return in_zone.timestamp()
    except (ValueError, OverflowError):
        return None
