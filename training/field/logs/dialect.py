"""How a text log is laid out: its encoding, what separates its cells, where its header and its first row are."""

import codecs
import csv
import re
from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np

from auv_fault_env.errors import refusal
from training.field.units import is_unit

SEPARATORS = ("\t", ";", "|", ",", " ")  # the last: any number of blanks
LONGEST_LINE = 100_000  # characters
TAIL = 40  # lines from which the separator is read: the last, for they are rows
ENOUGH = 1_000_000  # characters to see the layout
MISSING = (
    "",
    "-",
    "--",
    "?",
    "*",
    "nan",
    "null",
    "none",
    "nil",
    "na",
    "n/a",
    "#n/a",
    "nat",
    "missing",
    "---",
)
WORDS = dict.fromkeys(MISSING, float("nan")) | {"true": 1.0, "false": 0.0}
STAMP = re.compile(r"\d[\d.:/ TZ+-]*:\d\d[\d.,:Z+-]*")
DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(e[+-]?\d+)?", re.IGNORECASE)
DECIMAL_POINT = re.compile(r"[+-]?\d*\.\d+(e[+-]?\d+)?", re.IGNORECASE)
DAY_FIRST = re.compile(r"(\d\d)\.(\d\d)\.(\d{4})")
UNPRINTABLE = re.compile(r"[\x00-\x08\x0e-\x19\x1b-\x1f]")


class Dialect(NamedTuple):
    """Layout of a text table: cells, names and units by column, and the line of the first row of numbers."""

    separator: str
    decimal_comma: bool
    names: tuple[str, ...]
    units: tuple[str, ...]
    first: int
    before: int  # lines with something in them before the header


def number(cell: str) -> float | None:
    """The number in a cell, NaN for the usual words for missing; None if there is neither.

    >>> number("1e3"), number("true"), number("fast")
    (1000.0, 1.0, None)
    """
    try:
        return float(cell)
    except ValueError:
        return WORDS.get(cell.lower())


def seconds(cell: str) -> float | None:
    """Seconds since 1970, or since midnight, of a time stamp in ISO form or with a dotted date; None if it is none.

    >>> seconds("1970-01-02T00:00:01.5Z"), seconds("02.01.1970 00:00:01"), seconds("00:01:00")
    (86401.5, 86401.0, 60.0)
    """
    text = DAY_FIRST.sub(r"\3-\2-\1", cell).replace("/", "-")
    try:
        stamp = datetime.fromisoformat(text if "-" in text[:8] else f"1970-01-01T{text}")
        return (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)).timestamp()
    except (ValueError, OverflowError):
        return None


def decoded(content: bytes, name: str) -> tuple[str, list[str]]:
    """The text of a file with the line ends of Unix, and what was repaired; `InputError` if it is none."""
    encoding = _encoding(content)
    text = content.decode(encoding, errors="replace")
    repairs = [] if encoding.startswith("utf-8") else [f"encoding: read as {encoding.upper()}"]
    trimmed = text.rstrip("\0")
    if len(trimmed) < len(text):
        repairs.append(
            f"end: zero bytes left out, the log was cut while it was written ({len(text) - len(trimmed)})"
        )
    if "\0" in trimmed or len(UNPRINTABLE.findall(trimmed[:10_000])) > len(trimmed[:10_000]) / 100:
        raise refusal(
            "log", name, "a table as text, Parquet, MCAP or a rosbag2 folder", "export it as CSV"
        )
    return trimmed.replace("\r\n", "\n").replace("\r", "\n"), repairs


def _encoding(content: bytes) -> str:
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    zeros = [
        np.mean(np.frombuffer(content[k:4096:2], np.uint8) == 0) if len(content) > 1 else 0.0
        for k in (0, 1)
    ]
    if max(zeros) > 0.4 and min(zeros) < 0.1:
        return "utf-16-be" if zeros[0] > zeros[1] else "utf-16-le"
    try:
        content.decode("utf-8")
        return "utf-8-sig"
    except UnicodeDecodeError:
        return "latin-1"


def cells_of(line: str, separator: str) -> list[str]:
    """The cells of a line, without blanks and quotation marks around them; a unit in brackets stays with its name."""
    if separator == " ":
        return re.split(r"\s+(?![\[(])", line.strip())
    return [cell.strip(" \t\"'") for cell in next(csv.reader([line], delimiter=separator), [])]


def dialect_of(lines: Sequence[str], name: str) -> Dialect:
    """The layout, from the first lines of a file; `InputError` if they hold no header with rows of numbers below."""
    longest = max(map(len, lines))
    if longest > LONGEST_LINE:
        raise refusal(
            "log",
            name,
            f"lines of at most {LONGEST_LINE} characters",
            "export it with fewer columns",
        )
    plain = [line.lstrip("#%/") for line in lines[: max(10, ENOUGH // (longest + 1))]]
    separator = max(
        SEPARATORS, key=lambda mark: _score([cells_of(line, mark) for line in plain[-TAIL:]])
    )
    rows = [cells_of(line, separator) for line in plain]
    width = _width(rows)
    first = _first(rows, width)
    if first is None:
        raise refusal("log", name, "a header with rows of numbers below", "check what was exported")
    data = [row for row in rows[first:] if len(row) == width]
    above = [row for row in rows[:first] if any(row)]
    units = (
        above.pop()
        if len(above) > 1 and len(above[-1]) == len(above[-2]) and _are_units(above[-1])
        else ()
    )
    names = _fitted(above.pop(), data, separator) if above else ()
    if len(names) != width:
        got = f"{name}: a header of {len(names)} names above rows of {width} cells"
        raise refusal(
            "log",
            got,
            "one name for each column",
            "write the header, and separate cells by semicolons",
        )
    comma = _any_cell(data, DECIMAL_COMMA) and not _any_cell(data, DECIMAL_POINT)
    return Dialect(separator, comma, tuple(names), tuple(units), first, len(above))


def _is_value(cell: str) -> bool:
    return number(cell.replace(",", ".")) is not None or STAMP.fullmatch(cell) is not None


def _width(rows: Sequence[Sequence[str]]) -> int:
    """Number of cells of the lines that make most of the table."""
    counts = Counter(map(len, rows))
    return max(counts, key=lambda width: width * counts[width])


def _share(row: Sequence[str]) -> float:
    """Share of the cells with something in them that are numbers, stamps or words for missing."""
    filled = list(filter(None, row))
    return sum(map(_is_value, filled)) / len(filled) if filled else 0.0


def _score(rows: Sequence[Sequence[str]]) -> tuple[bool, float]:
    width = _width(rows)
    return width > 1, float(np.mean([_share(row) for row in rows if len(row) == width]))


def _first(rows: Sequence[Sequence[str]], width: int) -> int | None:
    """The first line that is as full of numbers as the lines usually are."""
    shares = [_share(row) if len(row) == width else 0.0 for row in rows]
    usual = np.median([share for share in shares if share] or [0.0])
    return next((k for k, share in enumerate(shares) if share > usual / 2), None)


def _any_cell(rows: Sequence[Sequence[str]], form: re.Pattern) -> bool:
    return any(form.fullmatch(cell) for row in rows for cell in row)


def _are_units(row: Sequence[str]) -> bool:
    filled = [cell for cell in row if cell]
    return sum(map(is_unit, filled)) * 2 > len(filled)


def _fitted(names: Sequence[str], data: Sequence[Sequence[str]], separator: str) -> Sequence[str]:
    """The names, where header or rows end with a separator, or the rows begin with a number that has no name."""
    if len(names) == len(data[0]) + 1 and not names[-1]:
        return names[:-1]
    if len(names) == len(data[0]) - 1:
        if not any(row[-1] for row in data):
            return [*names, ""]
        if separator in "\t ":
            return ["", *names]
    return names
