"""How a text file is laid out: separator, decimal mark, header and first row of numbers."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from auv_fault_env.errors import refusal
from training.field.logs.cells import (
    COMMENT_MARKS,
    LONGEST_LINE,
    cells_of,
    decimal_mark,
    is_unit_row,
    matching_names,
    separator_of,
    share_of_values,
    usual_width,
)

LAST_LINES = 40  # by which the separator is chosen: the last ones, which are rows
CHARACTERS = 1_000_000  # of a file, by which its layout is found


class Dialect(NamedTuple):
    """Layout of a text table."""

    separator: str  # one of `SEPARATORS`
    decimal_comma: bool  # whether numbers have a comma for the decimal point
    names: tuple[str, ...]  # by column
    units: tuple[str, ...]  # by column; empty without a row of units
    first_row: int  # number of the line with the first row of numbers
    lines_before: int  # how many lines with text stand before the header


def dialect_of(lines: Sequence[str], log: str) -> Dialect:
    """The layout of a file, from its first lines; `InputError` without a header above numbers."""
    lines = [line.lstrip(COMMENT_MARKS) for line in _enough_lines(lines, log)]
    separator = separator_of(lines[-LAST_LINES:])
    rows = [cells_of(line, separator) for line in lines]
    width = usual_width(rows)
    first_row = _first_row(rows, width)
    if first_row is None:
        allowed = "a header with rows of numbers below"
        raise refusal("log", log, allowed, "check what was exported")
    data = [row for row in rows[first_row:] if len(row) == width]
    above = [row for row in rows[:first_row] if any(row)]
    units = above.pop() if _ends_with_units(above) else ()
    names = matching_names(above.pop(), data, separator) if above else ()
    if len(names) != width:
        got = f"{log}: a header of {len(names)} names above rows of {width} cells"
        remedy = "write the header, and separate cells by semicolons"
        raise refusal("log", got, "one name for each column", remedy)
    decimal_comma = decimal_mark(data) == ","
    return Dialect(separator, decimal_comma, tuple(names), tuple(units), first_row, len(above))


def _enough_lines(lines: Sequence[str], log: str) -> Sequence[str]:
    longest = max(map(len, lines))
    if longest > LONGEST_LINE:
        allowed = f"lines of at most {LONGEST_LINE} characters"
        raise refusal("log", log, allowed, "export it with fewer columns")
    return lines[: max(10, CHARACTERS // (longest + 1))]


def _first_row(rows: Sequence[Sequence[str]], width: int) -> int | None:
    """The first line that has at least half as many numbers as is usual."""
    shares = [share_of_values(row) if len(row) == width else 0.0 for row in rows]
    usual = np.median([share for share in shares if share] or [0.0])
    return next((k for k, share in enumerate(shares) if share > usual / 2), None)


def _ends_with_units(above: Sequence[Sequence[str]]) -> bool:
    """Whether the last line above the numbers is a row of units under the header."""
    return len(above) > 1 and len(above[-1]) == len(above[-2]) and is_unit_row(above[-1])
