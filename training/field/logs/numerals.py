"""Numbers as text: which mark is the decimal one, thousands, and units behind the number.

A cell such as ``1.017`` is 1.017 or 1017; ``0.403`` is not 403, and ``1.234,5`` not 1.2345. The
cells that leave no choice decide for the others of their column, and for columns without such.
"""

import re
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

POINT = "."
COMMA = ","
OTHER_MARK = {POINT: COMMA, COMMA: POINT}
NARROW_MARKS = "\u00a0\u202f '’"  # between thousands, whatever the decimal mark
MINUS = "\u2212"
EXPONENT = r"(?:[eE][+-]?\d+)?"
UNIT = r"[A-Za-z%°µμΩ‰][A-Za-zµμΩ°%/·*^²³⁻¹1-4-]{0,11}"
NUMERAL = (
    rf"^(?P<number>[+-]?(?:\d[\d.,{NARROW_MARKS}]*|[.,]\d+){EXPONENT}|[+-]?(?i:inf(?:inity)?))"
    rf"\s*(?P<unit>{UNIT})?$"
)
TRUTH = {"true": "1", "false": "0"}


class Evidence(NamedTuple):
    """Counts of the cells of a column that say something about its decimal mark."""

    point: int = 0  # cells that are a number only if the point is the decimal mark
    comma: int = 0
    grouped_by_point: int = 0  # cells like 1.017
    grouped_by_comma: int = 0
    whole: int = 0  # numbers without a mark; counted only beside grouped ones
    is_counting: bool = False  # groups that end in 0 beside whole numbers of three digits

    @property
    def is_open(self) -> bool:
        """Whether the column itself leaves a choice."""
        return not self.point and not self.comma and bool(self.grouped)

    @property
    def grouped(self) -> int:
        """Cells that may be a decimal number or thousands."""
        return self.grouped_by_point + self.grouped_by_comma

    def __add__(self, other: "Evidence") -> "Evidence":
        """The evidence of both."""
        return Evidence(*(mine + its for mine, its in zip(self, other, strict=True)))


def evidence_of(numbers: pa.Array) -> Evidence:
    """What the numbers of a column say about its decimal mark.

    >>> evidence_of(pa.array(["990", "1.017", "0.5"]))
    Evidence(point=1, comma=0, grouped_by_point=1, grouped_by_comma=0, whole=1, is_counting=False)
    """
    has_mark = {mark: pc.any(pc.match_substring(numbers, mark)).as_py() for mark in OTHER_MARK}
    if not any(has_mark.values()):
        return Evidence()
    grouped = {mark: count_matching(numbers, grouped_by(mark)) for mark in OTHER_MARK}
    proving = {mark: count_matching(numbers, _proving(mark)) for mark in OTHER_MARK}
    for mark, other in OTHER_MARK.items():
        proving[mark] -= grouped[mark]
        proving[mark] += count_matching(numbers, rf"^[+-]?[1-9]\d{{0,2}}(?:\{other}\d{{3}}){{2,}}$")
    evidence = Evidence(proving[POINT], proving[COMMA], grouped[POINT], grouped[COMMA])
    if not evidence.grouped:
        return evidence
    whole = count_matching(numbers, r"^[+-]?\d+$")
    ends_in_zero = count_matching(numbers, r"^[+-]?[1-9]\d{0,2}[.,]\d{2}0$") > 0
    has_hundreds = count_matching(numbers, r"^[+-]?[1-9]\d\d$") > 0
    return evidence._replace(whole=whole, is_counting=ends_in_zero and has_hundreds)


def is_grouped(cell: str) -> bool:
    """Whether a cell may be a decimal number or thousands.

    >>> is_grouped("1.017"), is_grouped("0.403")
    (True, False)
    """
    return any(re.match(grouped_by(mark), cell) for mark in OTHER_MARK)


@lru_cache(maxsize=4096)
def evidence_of_number(number: str) -> Evidence:
    """What one number says about the decimal mark."""
    return evidence_of(pa.array([number]))


def grouped_by(mark: str) -> str:
    """Pattern of the numbers that are decimal with this mark, or thousands."""
    return rf"^[+-]?[1-9]\d{{0,2}}\{mark}\d{{3}}$"


def _proving(mark: str) -> str:
    """Pattern of the numbers with one decimal mark, which those grouped by it match too."""
    groups = rf"[1-9]\d{{0,2}}(?:[{NARROW_MARKS}{OTHER_MARK[mark]}]\d{{3}})+"
    return rf"^[+-]?(?:\d*|{groups})\{mark}\d*{EXPONENT}$"


def count_matching(text: pa.Array, pattern: str) -> int:
    """How many of the texts match the pattern."""
    return pc.sum(pc.match_substring_regex(text, pattern)).as_py() or 0


def decimal_mark(own: Evidence, table: Evidence, separator: str) -> str | None:
    """The decimal mark of a column; None where it may be either.

    Parameters
    ----------
    own
        Evidence of the column.
    table
        Evidence of all columns; it decides where the column itself leaves a choice.
    separator
        Of the cells: a comma between cells is no decimal mark, unless the cells are quoted.

    >>> thousands = Evidence(grouped_by_point=9, whole=200)
    >>> decimal_mark(thousands, Evidence(comma=50), ";")
    ','
    >>> decimal_mark(thousands, Evidence(), ";")
    """
    if own.point or own.comma:
        return POINT if own.point >= own.comma else COMMA
    if not own.grouped:
        return POINT
    if own.grouped_by_point and own.grouped_by_comma:
        return None
    mark = POINT if own.grouped_by_point else COMMA
    if bool(table.point) != bool(table.comma):
        proven = POINT if table.point else COMMA
        return None if proven == mark and own.is_counting else proven
    is_usual = mark == POINT or separator != COMMA
    return mark if is_usual and not own.whole and not table.point else None


def split_numbers(cells: pa.Array) -> tuple[pa.Array, pa.Array]:
    """Number and unit of every cell; null for a cell that is no number with or without unit.

    >>> numbers, units = split_numbers(pa.array(["12.3 V", "0,4", "true", "east"]))
    >>> numbers.to_pylist(), units.to_pylist()
    (['12.3', '0,4', '1', None], ['V', '', '', None])
    """
    cells = pc.replace_substring(cells, MINUS, "-")
    words = pc.utf8_lower(cells)
    for word, digit in TRUTH.items():
        cells = pc.if_else(pc.equal(words, word), digit, cells)
    parts = pc.extract_regex(cells, NUMERAL)
    numbers = pc.utf8_trim(pc.struct_field(parts, "number"), characters=NARROW_MARKS)
    return numbers, pc.struct_field(parts, "unit")


def usual_unit(units: pa.Array) -> str:
    """The unit behind most of the numbers that have one; empty if none has."""
    counts = pc.value_counts(pc.filter(units, pc.not_equal(units, "")))
    names = counts.field("values").to_pylist()
    return names[int(np.argmax(counts.field("counts")))] if names else ""


def split_number(cell: str) -> tuple[str | None, str]:
    """Number and unit of one cell, as `split_numbers`.

    >>> split_number("12.3 V"), split_number("east")
    (('12.3', 'V'), (None, ''))
    """
    cell = TRUTH.get(cell.lower(), cell.replace(MINUS, "-"))
    parts = re.match(NUMERAL, cell)
    return (parts["number"].strip(NARROW_MARKS), parts["unit"] or "") if parts else (None, "")


def plain_numbers(numbers: pa.Array, mark: str) -> pa.Array:
    """The numbers without thousands, with a decimal point; null for what is none with this mark.

    >>> plain_numbers(pa.array(["1.234,5", "12", "1 000", "1.5"]), ",").to_pylist()
    ['1234.5', '12', '1000', None]
    """
    is_number = pc.match_substring_regex(numbers, _number(mark))
    plain = pc.replace_substring_regex(numbers, _between_thousands(mark), "")
    if mark == COMMA:
        plain = pc.replace_substring(plain, COMMA, POINT)
    return pc.if_else(is_number, plain, None)


def plain_number(number: str, mark: str) -> str | None:
    """One number, as `plain_numbers`.

    >>> plain_number("1.234,5", ","), plain_number("1.5", ",")
    ('1234.5', None)
    """
    if not re.match(_number(mark), number):
        return None
    return re.sub(_between_thousands(mark), "", number).replace(COMMA, POINT)


@cache
def _number(mark: str) -> str:
    """Pattern of the numbers with this decimal mark."""
    whole = rf"(?:\d+|[1-9]\d{{0,2}}(?:{_between_thousands(mark)}\d{{3}})+)"
    finite = rf"[+-]?(?:{whole}(?:\{mark}\d*)?|\{mark}\d+){EXPONENT}"
    return rf"^(?:{finite}|[+-]?(?i:inf(?:inity)?))$"


@cache
def _between_thousands(mark: str) -> str:
    return f"[{NARROW_MARKS}{OTHER_MARK[mark]}]"


def as_floats(plain: pa.Array) -> np.ndarray:
    """The plain numbers (n_rows,), NaN for null."""
    return plain.cast(pa.float64()).to_numpy(zero_copy_only=False)
