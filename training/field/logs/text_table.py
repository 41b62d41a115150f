"""Tables from text files of any dialect."""

import re
from collections.abc import Mapping, Sequence

import pyarrow as pa
import pyarrow.csv

from auv_fault_env.errors import InputError, refusal
from training.field.logs.cells import SEPARATORS
from training.field.logs.dialect import Dialect, dialect_of
from training.field.logs.encoding import as_utf8
from training.field.logs.limits import check_table
from training.field.logs.table import Table, named_columns, unique_labels, with_named_time
from training.field.logs.text_columns import read_columns

BLOCK = 1 << 20  # bytes that are parsed at once
MOST_SKIPPED = 0.1  # of the rows, from which the file has several tables
FEWEST_SKIPPED = 10  # rows
STRAY_QUOTES = re.compile(rb'^[^"\n]*"(?:[^"\n]*"[^"\n]*")*[^"\n]*$', re.MULTILINE)


def text_table(content: bytes, log: str) -> Table:
    """The table of a text file; `InputError` if it holds none, or several."""
    content, remarks = as_utf8(content, log)
    dialect = dialect_of(content, log)
    check_table(log, content.count(b"\n"), len(dialect.names))
    remarks += _layout_remarks(dialect)
    labels = unique_labels(dialect.names, log, remarks)
    rows = memoryview(content)[dialect.start :]
    if b'"' in content:
        rows = _without_stray_quotes(rows, remarks)
    columns = _cells_by_column(rows, dialect.separator, len(labels), log, remarks)
    cells = dict(zip(labels, columns, strict=True))
    del content, rows, columns
    named_units = zip(labels, dialect.units, strict=False)
    units = {label: unit.strip("[]()") for label, unit in named_units if unit}
    table, lost = read_columns(cells, units, dialect.separator)
    if second := _second_header(lost, dialect, labels, log):
        raise second
    table = with_named_time(table)
    return table._replace(columns=named_columns(table.columns), remarks=(*remarks, *table.remarks))


def _layout_remarks(dialect: Dialect) -> list[str]:
    remarks = []
    if dialect.separator != ",":
        remarks.append(f"cells: separated by {SEPARATORS[dialect.separator]}")
    if dialect.lines_before:
        remarks.append(f"header: lines before it left out ({dialect.lines_before})")
    if dialect.units:
        remarks.append("units: read from the row under the header")
    return remarks


def _without_stray_quotes(content: memoryview, remarks: list[str]) -> bytes:
    repaired, n_stray = STRAY_QUOTES.subn(lambda line: line[0].replace(b'"', b""), content)
    if n_stray:
        remarks.append(f"rows: stray quotation marks removed ({n_stray})")
    return repaired


def _cells_by_column(
    content: memoryview | bytes, separator: str, width: int, log: str, remarks: list[str]
) -> list[pa.ChunkedArray]:
    """The cells of the rows as text; rows with more or fewer cells than the header are left out."""
    skipped: list[str] = []
    if separator == " ":
        separator = "\t"
        content = re.sub(rb"[ \t]+", b"\t", re.sub(rb"(?m)^[ \t]+|[ \t]+$", b"", content))
    names = [str(k) for k in range(width)]

    def skip(row: pyarrow.csv.InvalidRow) -> str:
        skipped.append(row.text)
        return "skip"

    # a thread that still lets go of `skip` when the interpreter ends would abort the process
    is_long = len(content) > BLOCK
    parse_options = pyarrow.csv.ParseOptions(delimiter=separator, invalid_row_handler=skip)
    try:
        table = pyarrow.csv.read_csv(
            pa.BufferReader(pa.py_buffer(content)),
            pyarrow.csv.ReadOptions(column_names=names, block_size=BLOCK, use_threads=is_long),
            parse_options,
            pyarrow.csv.ConvertOptions(column_types=dict.fromkeys(names, pa.string())),
        )
    except pa.ArrowException as error:
        allowed = "a table with the same number of cells in each row"
        raise refusal("log", log, allowed, f"correct it ({one_line(error)})") from None
    if skipped:
        kind = f"rows: those without {width} cells, such as {skipped[0][:40]!r}"
        remarks.append(f"{kind}, left out ({len(skipped)})")
    if len(skipped) > max(FEWEST_SKIPPED, MOST_SKIPPED * (table.num_rows + len(skipped))):
        got = f"{log}: {len(skipped)} rows without {width} cells, such as {skipped[0][:40]!r}"
        remedy = "write each of its tables into a file of its own"
        raise refusal("log", got, f"{width} cells in each row, as below the header", remedy)
    return table.columns


def _second_header(
    lost: Mapping[str, Mapping[int, str]], dialect: Dialect, labels: Sequence[str], log: str
) -> InputError | None:
    """The refusal of a table whose rows contain the header of another one."""
    names = dict(zip(labels, dialect.names, strict=True))
    units = dict(zip(labels, dialect.units, strict=False))
    rows: dict[int, dict[str, str]] = {}
    for label, texts in lost.items():
        for row, text in texts.items():
            rows.setdefault(row, {})[label] = text
    for row, texts in rows.items():
        is_known = all(text in (names[label], units.get(label)) for label, text in texts.items())
        is_header = len(texts) > max(1, len(lost) / 2) and len(set(texts.values())) == len(texts)
        if is_header and not is_known:
            shown = ", ".join(texts.values())[:80]
            got = f"{log}: another header in row {row + 1} below the first: {shown!r}"
            remedy = "write each of its tables into a file of its own"
            return refusal("log", got, "one table", remedy)
    return None


def one_line(error: Exception) -> str:
    """The message of an error without line breaks."""
    return " ".join(str(error).split())[:200]
