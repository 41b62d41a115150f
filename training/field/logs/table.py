"""Tables of numbers from log files as they come: CSV of any dialect, gzip, Parquet, MCAP and rosbag2."""

import gzip
import io
import math
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.parquet

from auv_fault_env.errors import InputError, refusal
from training.field.logs.dialect import WORDS, Dialect, decoded, dialect_of, number, seconds

BAGS = (b"\x89MCAP", b"SQLite format 3\0", b"#ROSBAG")  # how bags begin
LARGEST = 1 << 30  # bytes of a log, unpacked
WIDEST = 4096  # columns
HEAD = 200  # lines from which the layout is read


class Table(NamedTuple):
    """Columns of numbers by name (n_rows,), NaN where unreadable; what was repaired; units of a row under the header.

    A column of text is NaN throughout. Time stamps are seconds since 1970, or since midnight where
    they have no date.
    """

    columns: dict[str, np.ndarray]
    repairs: tuple[str, ...]
    units: Mapping[str, str] = MappingProxyType({})


def read_table(path: Path) -> Table:
    """Read a log, repair what can be repaired, and say so; `InputError` if it holds no table of numbers."""
    path = Path(path)
    content = _content(path)
    if content is None:
        from training.field.logs.bags import read_bag

        return read_bag(path)
    content, repairs = _unpacked(content, path.name)
    if not content.strip(b"\0 \t\r\n"):
        raise refusal(
            "log", path.name, "a table with a header and rows of numbers", "the file is empty"
        )
    if content.startswith(b"PAR1"):
        table = _parquet(content, path.name)
    else:
        table = _text(content, path.name)
    if not any(np.isfinite(values).any() for values in table.columns.values()):
        raise refusal(
            "log",
            path.name,
            "a table with at least one column of numbers",
            "check what was exported",
        )
    return table._replace(repairs=(*repairs, *table.repairs))


def _content(path: Path) -> bytes | None:
    """The bytes of a file; None if it is a bag."""
    try:
        if (path / "metadata.yaml").is_file():
            return None
        if path.exists() and not path.is_file():
            raise refusal("log", str(path), "a file or a rosbag2 folder", "name the file")
        with path.open("rb") as file:
            start = file.read(16)
            content = None if start.startswith(BAGS) else start + file.read(LARGEST)
    except InputError:
        raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise refusal("log", str(path), "a readable file", f"check the path ({reason})") from None
    if content and len(content) > LARGEST:
        raise refusal("log", str(path), f"a file of at most {LARGEST >> 20} MiB", "split it")
    return content


def _unpacked(content: bytes, name: str) -> tuple[bytes, list[str]]:
    """The content itself, or what can be read of a gzip file."""
    if not content.startswith(b"\x1f\x8b"):
        return content, []
    stream = gzip.GzipFile(fileobj=io.BytesIO(content))
    parts = []
    size = 0
    try:
        while part := stream.read1(1 << 20):
            parts.append(part)
            size += len(part)
            if size > LARGEST:
                raise refusal("log", name, f"at most {LARGEST >> 20} MiB unpacked", "split it")
    except (EOFError, zlib.error, gzip.BadGzipFile):
        return b"".join(parts), [f"gzip: breaks off; the {size} bytes before are read"]
    return b"".join(parts), []


def _text(content: bytes, name: str) -> Table:
    text, repairs = decoded(content, name)
    lines = text.split("\n")
    dialect = dialect_of(lines[:HEAD], name)
    repairs += _said(dialect)
    labels = _labels(dialect.names, name, repairs)
    cells = _cells(_balanced(lines[dialect.first :], repairs), dialect, name, repairs)
    columns = {}
    for label, column in zip(labels, cells, strict=True):
        columns[label], unreadable = _numbers(column, dialect.decimal_comma)
        repairs += [f"{label}: {unreadable}"] if unreadable else []
    units = dict(zip(labels, dialect.units, strict=False))
    return Table(
        _named(columns), tuple(repairs), {label: unit for label, unit in units.items() if unit}
    )


def _said(dialect: Dialect) -> list[str]:
    marks = {";": "semicolons", "\t": "tabs", "|": "bars", " ": "blanks"}
    said = [f"cells: separated by {marks[dialect.separator]}"] if dialect.separator in marks else []
    said += ["numbers: read with decimal commas"] if dialect.decimal_comma else []
    said += [f"header: lines before it left out ({dialect.before})"] if dialect.before else []
    return said + (["units: read from the row under the header"] if dialect.units else [])


def _labels(names: Sequence[str], log: str, repairs: list[str]) -> list[str]:
    """A label of its own for each column; one without a name gets a blank and its number."""
    if len(names) > WIDEST:
        raise refusal("log", f"{log}: {len(names)} columns", f"at most {WIDEST}", "export fewer")
    labels: list[str] = []
    taken = set(names)
    for k, name in enumerate(names):
        label = name or f" {k}"
        if label in labels:
            label = next(
                new for n in range(2, len(names) + 2) if (new := f"{name} ({n})") not in taken
            )
            repairs.append(
                f"header: {name!r} is there more than once; one of them is called {label!r}"
            )
            taken.add(label)
        labels.append(label)
    return labels


def _named(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {label: values for label, values in columns.items() if not label.startswith(" ")}


def _balanced(lines: list[str], repairs: list[str]) -> list[str]:
    """The lines without stray quotation marks, which would swallow the lines after them."""
    stray = [k for k, line in enumerate(lines) if line.count('"') % 2]
    for k in stray:
        lines[k] = lines[k].replace('"', "")
    repairs += [f"rows: stray quotation marks removed ({len(stray)})"] if stray else []
    return lines


def _cells(
    lines: Sequence[str], dialect: Dialect, name: str, repairs: list[str]
) -> list[pa.ChunkedArray]:
    """The cells of the rows as text, by column; rows with more or fewer cells than the header are left out."""
    skipped: list[str] = []
    mark = dialect.separator
    if mark == " ":
        mark = "\t"
        lines = ["\t".join(line.split()) for line in lines]
    labels = [str(k) for k in range(len(dialect.names))]
    try:
        table = pyarrow.csv.read_csv(
            io.BytesIO("\n".join(lines).encode()),
            pyarrow.csv.ReadOptions(column_names=labels, block_size=1 << 24),
            pyarrow.csv.ParseOptions(
                delimiter=mark, invalid_row_handler=lambda row: skipped.append(row.text) or "skip"
            ),
            pyarrow.csv.ConvertOptions(column_types=dict.fromkeys(labels, pa.string())),
        )
    except pa.ArrowException as error:
        remedy = f"mend it ({_one_line(error)})"
        raise refusal(
            "log", name, "a table with the same number of cells in each row", remedy
        ) from None
    if skipped:
        shown = skipped[0][:40]
        repairs.append(
            f"rows: those without {len(labels)} cells, such as {shown!r}, left out ({len(skipped)})"
        )
    return table.columns


def _numbers(cells: pa.ChunkedArray, decimal_comma: bool) -> tuple[np.ndarray, str]:
    """The numbers of a column (n_rows,), and what is said of cells that are none."""
    text = pc.utf8_trim(cells, characters=" \t\"'")
    if decimal_comma:
        text = pc.replace_substring(text, ",", ".")
    try:
        return text.cast(pa.float64()).to_numpy(), ""
    except pa.ArrowInvalid:
        return _one_by_one(text.to_pylist())


def _one_by_one(cells: Sequence[str]) -> tuple[np.ndarray, str]:
    values = [number(cell) for cell in cells]
    if not any(map(_finite, values)):
        values = [seconds(cell) for cell in cells]
    odd = [
        cell
        for value, cell in zip(values, cells, strict=True)
        if value is None and cell.lower() not in WORDS
    ]
    some = odd and any(map(_finite, values))
    said = (
        f"cells that are no numbers, such as {odd[0][:40]!r}, taken as missing ({len(odd)})"
        if some
        else ""
    )
    return np.array([np.nan if value is None else value for value in values]), said


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:200]


def _finite(value: float | None) -> bool:
    return value is not None and math.isfinite(value)


def _parquet(content: bytes, name: str) -> Table:
    try:
        table = pyarrow.parquet.read_table(pa.BufferReader(content))
    except (pa.ArrowException, OSError) as error:
        raise refusal(
            "log", name, "a whole Parquet file", f"write it again ({_one_line(error)})"
        ) from None
    repairs: list[str] = []
    labels = _labels(table.column_names, name, repairs)
    columns = {
        label: _parquet_column(column) for label, column in zip(labels, table.columns, strict=True)
    }
    return Table(_named(columns), tuple(repairs))


def _parquet_column(column: pa.ChunkedArray) -> np.ndarray:
    try:
        if pa.types.is_string(column.type) or pa.types.is_large_string(column.type):
            return _numbers(column.fill_null(""), decimal_comma=False)[0]
        if pa.types.is_timestamp(column.type):
            micros = column.cast(pa.timestamp("us", column.type.tz), safe=False).cast(pa.int64())
            return micros.cast(pa.float64()).to_numpy() / 1e6
        return column.cast(pa.float64(), safe=False).to_numpy()
    except pa.ArrowException:
        return np.full(len(column), np.nan)
