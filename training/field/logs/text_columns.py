"""Columns of text as numbers or times, each decided from all of its cells."""

from collections.abc import Mapping, MutableMapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from auv_fault_env.errors import InputError, refusal
from training.field.logs.cells import MISSING
from training.field.logs.numerals import (
    COMMA,
    OTHER_MARK,
    POINT,
    Evidence,
    as_floats,
    decimal_mark,
    evidence_of,
    grouped_by,
    plain_numbers,
    split_numbers,
    usual_unit,
)
from training.field.logs.stamp_columns import (
    beside_name,
    is_named_as_time,
    part_labels,
    time_of_parts,
    with_dates,
)
from training.field.logs.stamp_seconds import seconds_of
from training.field.logs.stamps import Stamps, Undecided, clock_of_digits, read_stamps
from training.field.logs.table import TIME, Table
from training.field.units import spelt

MOST_LOST = 0.1  # of the cells that hold something, beyond which a column is not used
FIRST = 1000  # cells of a column of plain numbers that may show the decimal point
MOST_KEPT = 1000  # lost cells of a column
MOST_SHOWN = 40  # characters of a cell in a remark


class TextColumn(NamedTuple):
    """A column of cells, and what they show before the other columns are known."""

    cells: pa.Array | None  # null where missing; None if the values are final
    values: np.ndarray | None  # (n_rows,), if all cells are plain numbers
    numbers: pa.Array | None  # the numbers in the cells, null for what is none
    units: pa.Array | None  # behind the numbers
    evidence: Evidence
    stamps: Stamps | None = None


class ReadColumn(NamedTuple):
    """A column of numbers or times."""

    values: np.ndarray  # (n_rows,)
    remark: str = ""
    refusal: InputError | None = None  # why the values must not be used
    unit: str = ""
    has_decimal_comma: bool = False
    # text of the cells that are no number by their row, of a column of numbers
    lost: Mapping[int, str] = MappingProxyType({})


class TextTable(NamedTuple):
    """The table of columns of text."""

    table: Table
    # text of the cells that are no number by their row, by the columns of numbers that have such
    lost: dict[str, Mapping[int, str]]


def read_columns(
    cells: MutableMapping[str, pa.ChunkedArray],
    units: Mapping[str, str] = MappingProxyType({}),
    separator: str = "",
) -> TextTable:
    """The table of columns of text, which are taken out of `cells` one by one.

    A column that loses more than a tenth of its cells is in `Table.refusals`, as is one that can be
    read in two ways: its values must not be used.
    """
    labels = list(cells)
    columns = {label: text_column(cells.pop(label), label) for label in labels}
    table_evidence = sum((column.evidence for column in columns.values()), Evidence())
    stamps: dict[str, Stamps] = {}
    read: dict[str, ReadColumn] = {}
    for label in labels:
        column = columns.pop(label)
        hint = f"{beside_name(label)} {units.get(label, '')}"
        mark = decimal_mark(column.evidence, table_evidence, separator)
        decided = column.stamps or _decided(column, label, hint, mark)
        if isinstance(decided, Stamps):
            stamps[label] = decided
        else:
            read[label] = decided
    return _as_table(labels, read, stamps, units)


def text_column(cells: pa.ChunkedArray, label: str) -> TextColumn:
    """A column as far as its own cells decide."""
    text = cells.combine_chunks()
    del cells  # of a long log, each copy counts
    text = pc.utf8_trim(text, characters=" \t\"'")
    plain = _plain_column(text)
    if plain is None:
        text = with_nulls(text)
        plain = _plain_column(text)
    if plain is None:
        numbers, units = split_numbers(text)
        return TextColumn(text, None, numbers, units, evidence_of(numbers))
    values, evidence = plain
    if evidence.comma:
        return TextColumn(None, values, None, None, evidence)
    stamps = _stamps_of_digits(text, values, label)
    if stamps is not None:
        return TextColumn(None, None, None, None, Evidence(), stamps)
    if not evidence.is_open:
        return TextColumn(None, values, None, None, evidence)
    return TextColumn(text, None, text, pa.array([""] * len(text)), evidence)


def _stamps_of_digits(text: pa.Array, values: np.ndarray, label: str) -> Stamps | None:
    """The stamps of plain numbers such as 100023.0, unless the name says that they are seconds."""
    if spelt(beside_name(label), "s"):
        return None
    named = read_stamps(text, only_digits=True) if is_named_as_time(label) else None
    return named or clock_of_digits(values)


def _plain_column(text: pa.Array) -> tuple[np.ndarray, Evidence] | None:
    """The values of plain numbers, with decimal points or commas, and what shows their mark."""
    first = evidence_of(text[:FIRST])
    values = _plain_floats(text)
    if values is not None:
        # plain numbers have no comma: one with a decimal point is enough
        return values, first if first.point else evidence_of(text)
    if not first.comma or pc.any(pc.match_substring(text, POINT)).as_py():
        return None
    values = _plain_floats(pc.replace_substring(text, COMMA, POINT))
    return None if values is None else (values, Evidence(comma=1))


def _plain_floats(text: pa.Array) -> np.ndarray | None:
    try:
        text[:FIRST].cast(pa.float64())  # a long cast that fails takes long
        return text.cast(pa.float64()).to_numpy(zero_copy_only=False)
    except pa.ArrowInvalid:
        return None


def with_nulls(text: pa.Array) -> pa.Array:
    """The cells with null for the words that mean missing."""
    is_missing = pc.is_in(pc.utf8_lower(text), pa.array(MISSING))
    return pc.if_else(is_missing, None, text)


def _decided(column: TextColumn, label: str, hint: str, mark: str | None) -> ReadColumn | Stamps:
    """A column as numbers or as stamps, whichever loses fewer cells."""
    if column.values is not None:
        return ReadColumn(column.values, has_decimal_comma=column.evidence.comma > 0)
    if mark is None:
        return _ambiguous_numbers(column, label)
    numbers = _as_numbers(column, label, mark)
    is_lost = np.isnan(numbers.values) & column.cells.is_valid().to_numpy(zero_copy_only=False)
    n_lost = int(is_lost.sum())
    if not n_lost:
        return numbers
    try:
        stamps = read_stamps(column.cells, hint)
    except Undecided as error:
        example = column.cells.drop_null()[0].as_py()
        reason = undecided_stamps(label, example, error)
        return numbers._replace(remark=f"may be {error}; not read", refusal=reason)
    if stamps is None or (without := _rows_without(stamps, column.cells)).size >= n_lost:
        return _with_loss(numbers, column.cells, np.flatnonzero(is_lost), label)
    if without.size > MOST_LOST * _n_known(column.cells):
        return _with_loss(numbers, column.cells, without, label)
    remark = _loss_remark("time stamp", column.cells, without) if without.size else ""
    return stamps._replace(remark="; ".join(filter(None, (stamps.remark, remark))))


def _as_numbers(column: TextColumn, label: str, mark: str) -> ReadColumn:
    """The numbers with this decimal mark, in the unit that most of them have."""
    unit = usual_unit(column.units)
    is_of_unit = pc.is_in(column.units, pa.array(["", unit]))
    plain = pc.if_else(is_of_unit, plain_numbers(column.numbers, mark), None)
    remarks = [f"in {unit}, as behind the numbers"] if unit else []
    grouped = column.evidence[2:4][mark == POINT]
    if grouped:
        is_grouped = pc.match_substring_regex(column.numbers, grouped_by(OTHER_MARK[mark]))
        example = pc.filter(column.numbers, is_grouped)[0].as_py()
        remarks.append(f"{example!r} read as {example.replace(OTHER_MARK[mark], '')}")
    has_comma = bool(mark == COMMA and pc.any(pc.match_substring(column.numbers, COMMA)).as_py())
    return ReadColumn(as_floats(plain), "; ".join(remarks), None, unit, has_comma)


def _ambiguous_numbers(column: TextColumn, label: str) -> ReadColumn:
    is_grouped = pc.match_substring_regex(
        column.numbers, f"{grouped_by(POINT)}|{grouped_by(COMMA)}"
    )
    example = pc.filter(column.cells, is_grouped)[0].as_py()
    allowed = "numbers that show their decimal mark: it may be a decimal number or thousands"
    remedy = "export the column without thousands"
    reason = refusal(f"column {label!r}", example, allowed, remedy)
    values = np.full(len(column.cells), np.nan)
    return ReadColumn(values, f"{example!r} may be a decimal number or thousands; not read", reason)


def _with_loss(read: ReadColumn, cells: pa.Array, rows: np.ndarray, label: str) -> ReadColumn:
    """The numbers with a remark on those rows without one; refused if they are too many."""
    texts = cells.take(pa.array(rows[:MOST_KEPT])).to_pylist()
    lost = dict(zip(rows.tolist(), texts, strict=False))
    n_known = _n_known(cells)
    reason = None
    is_time = is_named_as_time(label)
    if rows.size > MOST_LOST * n_known:
        kind = "time stamps" if is_time else "numbers"
        allowed = f"{kind}: {rows.size} of {n_known} cells are none that can be read"
        remedy = "export it in another notation: see docs/logs.md"
        reason = refusal(f"column {label!r}", texts[0], allowed, remedy)
    has_numbers = np.isfinite(read.values).any()
    kind = "number" if has_numbers else "time stamp"
    loss = _loss_remark(kind, cells, rows) if has_numbers or is_time else ""
    remark = "; ".join(filter(None, (read.remark, loss)))
    return read._replace(remark=remark, refusal=reason, lost=lost if has_numbers else {})


def _loss_remark(kind: str, cells: pa.Array, rows: np.ndarray) -> str:
    example = cells[int(rows[0])].as_py()[:MOST_SHOWN]
    return f"cells without a {kind}, such as {example!r}, taken as missing ({rows.size})"


def _n_known(cells: pa.Array) -> int:
    return len(cells) - cells.null_count


def _rows_without(stamps: Stamps, cells: pa.Array) -> np.ndarray:
    """The rows whose cell holds something that is no stamp."""
    is_stamp = ~np.isnan(stamps.clock)
    for days in stamps.dates.values():
        is_stamp &= ~np.isnan(days)
    return np.flatnonzero(~is_stamp & cells.is_valid().to_numpy(zero_copy_only=False))


def undecided_stamps(label: str, example: str, readings: object) -> InputError:
    """The refusal of stamps that can be read in two ways."""
    allowed = f"stamps with one meaning: these may be {readings}"
    remedy = (
        "write the notation into the header, as Time [mm:ss] or Date (dd/mm/yyyy), or ISO dates"
    )
    return refusal(f"column {label!r}", example, allowed, remedy)


def _as_table(
    labels: Sequence[str],
    read: Mapping[str, ReadColumn],
    stamps: Mapping[str, Stamps],
    units: Mapping[str, str],
) -> TextTable:
    numbers = {label: column.values for label, column in read.items() if column.refusal is None}
    remarks = []
    if any(column.has_decimal_comma for column in read.values()):
        remarks.append("numbers: read with decimal commas")
    time = None if _has_clock(stamps) or TIME in labels else time_of_parts(numbers)
    if time is not None:
        parts = part_labels(numbers).values()
        stamps = {TIME: time, **stamps}
        labels = [TIME, *(label for label in labels if label not in parts)]
        remarks.append(f"time: read from {', '.join(map(repr, parts))}")
    stamps, pairs = with_dates(stamps, labels)
    remarks += [f"time: {date!r} and {clock!r} are read together" for date, clock in pairs]
    columns = dict(read) | {label: _as_seconds(one, label) for label, one in stamps.items()}
    remarks += [f"{label}: {columns[label].remark}" for label in labels if columns[label].remark]
    units = {label: columns[label].unit or units.get(label, "") for label in labels}
    table = Table(
        {label: columns[label].values for label in labels},
        tuple(remarks),
        {label: unit for label, unit in units.items() if unit},
        {label: columns[label].refusal for label in labels if columns[label].refusal},
        frozenset(stamps),
    )
    return TextTable(table, {label: column.lost for label, column in read.items() if column.lost})


def _has_clock(stamps: Mapping[str, Stamps]) -> bool:
    return any(one.has_clock for one in stamps.values())


def _as_seconds(stamps: Stamps, label: str) -> ReadColumn:
    try:
        values, remark = seconds_of(stamps)
    except Undecided as error:
        reason = undecided_stamps(label, stamps.example, error)
        return ReadColumn(np.full(stamps.clock.size, np.nan), f"may be {error}; not read", reason)
    return ReadColumn(values, remark, unit="s")
