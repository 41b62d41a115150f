"""Tables from text files of any dialect."""

import io
import math
from collections.abc import Sequence

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv

from auv_fault_env.errors import refusal
from training.field.logs.cells import SEPARATORS, WORDS, number, seconds, without_stray_quotes
from training.field.logs.dialect import Dialect, dialect_of
from training.field.logs.encoding import decoded
from training.field.logs.table import Table, named_columns, unique_labels

HEAD = 200  # lines by which the layout is found


def text_table(content: bytes, log: str) -> Table:
    """The table of a text file; `InputError` if it holds none."""
    text, remarks = decoded(content, log)
    lines = text.split("\n")
    dialect = dialect_of(lines[:HEAD], log)
    remarks += _layout_remarks(dialect)
    labels = unique_labels(dialect.names, log, remarks)
    rows = _without_stray_quotes(lines[dialect.first_row :], remarks)
    columns = {}
    for label, cells in zip(labels, _cells_by_column(rows, dialect, log, remarks), strict=True):
        columns[label], remark = column_values(cells, dialect.decimal_comma)
        if remark:
            remarks.append(f"{label}: {remark}")
    units = dict(zip(labels, dialect.units, strict=False))
    known_units = {label: unit for label, unit in units.items() if unit}
    return Table(named_columns(columns), tuple(remarks), known_units)


def _layout_remarks(dialect: Dialect) -> list[str]:
    remarks = []
    if dialect.separator != ",":
        remarks.append(f"cells: separated by {SEPARATORS[dialect.separator]}")
    if dialect.decimal_comma:
        remarks.append("numbers: read with decimal commas")
    if dialect.lines_before:
        remarks.append(f"header: lines before it left out ({dialect.lines_before})")
    if dialect.units:
        remarks.append("units: read from the row under the header")
    return remarks


def _without_stray_quotes(lines: Sequence[str], remarks: list[str]) -> list[str]:
    repaired = [without_stray_quotes(line) for line in lines]
    n_stray = sum(before != after for before, after in zip(lines, repaired, strict=True))
    if n_stray:
        remarks.append(f"rows: stray quotation marks removed ({n_stray})")
    return repaired


def _cells_by_column(
    lines: Sequence[str], dialect: Dialect, log: str, remarks: list[str]
) -> list[pa.ChunkedArray]:
    """The cells of the rows as text; rows with more or fewer cells than the header are left out."""
    skipped: list[str] = []
    separator = dialect.separator
    if separator == " ":
        separator = "\t"
        lines = ["\t".join(line.split()) for line in lines]
    labels = [str(k) for k in range(len(dialect.names))]
    parse_options = pyarrow.csv.ParseOptions(
        delimiter=separator,
        invalid_row_handler=lambda row: skipped.append(row.text) or "skip",
    )
    try:
        table = pyarrow.csv.read_csv(
            io.BytesIO("\n".join(lines).encode()),
            pyarrow.csv.ReadOptions(column_names=labels, block_size=1 << 24),
            parse_options,
            pyarrow.csv.ConvertOptions(column_types=dict.fromkeys(labels, pa.string())),
        )
    except pa.ArrowException as error:
        allowed = "a table with the same number of cells in each row"
        raise refusal("log", log, allowed, f"correct it ({one_line(error)})") from None
    if skipped:
        example = skipped[0][:40]
        kind = f"rows: those without {len(labels)} cells, such as {example!r}"
        remarks.append(f"{kind}, left out ({len(skipped)})")
    return table.columns


def column_values(cells: pa.ChunkedArray, decimal_comma: bool) -> tuple[np.ndarray, str]:
    """The numbers of a column (n_rows,), and a remark on cells that hold none."""
    text = pc.utf8_trim(cells, characters=" \t\"'")
    if decimal_comma:
        text = pc.replace_substring(text, ",", ".")
    try:
        return text.cast(pa.float64()).to_numpy(), ""
    except pa.ArrowInvalid:
        return _cell_values(text.to_pylist())


def _cell_values(cells: Sequence[str]) -> tuple[np.ndarray, str]:
    """As `column_values`, cell by cell: numbers, or time stamps where there is no number."""
    values = [number(cell) for cell in cells]
    if not any(map(_is_finite, values)):
        values = [seconds(cell) for cell in cells]
    unreadable = [
        cell
        for value, cell in zip(values, cells, strict=True)
        if value is None and cell.lower() not in WORDS
    ]
    remark = ""
    if unreadable and any(map(_is_finite, values)):
        example = unreadable[0][:40]
        remark = (
            f"cells without a number, such as {example!r}, taken as missing ({len(unreadable)})"
        )
    return np.array([np.nan if value is None else value for value in values]), remark


def _is_finite(value: float | None) -> bool:
    return value is not None and math.isfinite(value)


def one_line(error: Exception) -> str:
    """The message of an error without line breaks."""
    return " ".join(str(error).split())[:200]
