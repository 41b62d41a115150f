"""The rows above a table's numbers: names, units, types and counts of bytes."""

import re
from collections.abc import Sequence
from typing import NamedTuple

from training.field.logs.cells import share_of_values
from training.field.units import is_unit, other_unit

# what loggers write in place of a unit, for columns that have none
UNIT_WORDS = frozenset(
    "nodim nd none bool enum lat lon datetime timestamp ts utc rn cc - 1".split()
)
TYPE = re.compile(
    r"(?:u?int(?:eger)?\d*|u?short|u?long|byte|float\d*|double|single|real\d*|decimal|numeric"
    r"|number|bool(?:ean)?|str(?:ing)?|text|char|object|datetime(?:64)?|[fiu][1248])(?:_t)?",
    re.IGNORECASE,
)
BYTE_COUNTS = frozenset("1248")


class Header(NamedTuple):
    """The rows above the numbers."""

    names: Sequence[str]
    units: Sequence[str]  # empty without a row of units
    n_before: int  # rows with text before the names


def header_of(above: Sequence[Sequence[str]]) -> Header:
    """Names and units among the rows with text above the numbers.

    The names are the last row of different words; rows of units, types and the like are below.

    >>> header_of([["Otter"], ["time", "depth", "lat"], ["s", "m", "lat"], ["f8", "f4", "f4"]])
    Header(names=['time', 'depth', 'lat'], units=['s', 'm', 'lat'], n_before=1)
    """
    rows = list(above)
    units: Sequence[str] = ()
    while len(rows) > 1 and _is_below_names(rows[-1], rows[-2]):
        row = rows.pop()
        if not is_type_row(row):
            units = row
    names = rows.pop() if rows else ()
    return Header(names, units, len(rows))


def _is_below_names(row: Sequence[str], upper: Sequence[str]) -> bool:
    """Whether a row describes columns whose names are above it."""
    if len(row) != len(upper) or share_of_values(upper) > 0:
        return False
    is_above = _are_names(upper) or is_unit_row(upper)
    return is_unit_row(row) or is_type_row(row) or (is_above and not _are_names(row))


def _are_names(row: Sequence[str]) -> bool:
    """Whether the cells are different words; the first or the last may be empty."""
    inner = [cell for k, cell in enumerate(row) if cell or 0 < k < len(row) - 1]
    return all(inner) and len(set(inner)) == len(inner) and not is_unit_row(row)


def is_unit_row(row: Sequence[str]) -> bool:
    """Whether most cells of the row name a unit, or all are in brackets; empty cells aside."""
    filled = [cell for cell in row if cell]
    units = [cell for cell in filled if _is_any_unit(cell)]
    in_brackets = [cell for cell in filled if cell[0] + cell[-1] in ("[]", "()")]
    return 2 * len(units) > len(filled) or 0 < len(filled) == len(in_brackets)


def _is_any_unit(cell: str) -> bool:
    return is_unit(cell) or other_unit(cell) or cell.strip("[]()").lower() in UNIT_WORDS


def is_type_row(row: Sequence[str]) -> bool:
    """Whether all cells of the row name a type of numbers or text; empty cells aside."""
    filled = [cell for cell in row if cell]
    return bool(filled) and all(map(TYPE.fullmatch, filled))


def is_byte_row(row: Sequence[str]) -> bool:
    """Whether all cells can be the size of a number in bytes."""
    return BYTE_COUNTS.issuperset(row)
