"""Tables from Parquet files."""

import re
from collections.abc import Iterator

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet

from auv_fault_env.errors import refusal
from training.field.logs.limits import LARGEST_CONTENT, check_content, check_table
from training.field.logs.table import Table, named_columns, unique_labels, with_named_time
from training.field.logs.text_columns import read_columns
from training.field.logs.text_table import one_line

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
DAY = 86_400.0  # s
UNNAMED_INDEX = re.compile(r"__index_level_\d+__")  # as pandas writes it


def parquet_table(content: bytes, log: str) -> Table:
    """The table of a Parquet file: numbers, text, dates, times of day, and durations [s].

    A column of another type, such as a list, is left out with a remark. `InputError` for a damaged
    file, and before a file is unpacked that would fill the memory.
    """
    remarks: list[str] = []
    try:
        return _table(content, log, remarks)
    except (pa.ArrowException, OSError) as error:
        remedy = f"write it again ({one_line(error)})"
        raise refusal("log", log, "a whole Parquet file", remedy) from None


def _table(content: bytes, log: str, remarks: list[str]) -> Table:
    metadata = pyarrow.parquet.read_metadata(pa.BufferReader(content))
    check_table(log, metadata.num_rows, metadata.num_columns)
    groups = map(metadata.row_group, range(metadata.num_row_groups))
    check_content(log, sum(group.total_byte_size for group in groups))
    schema = metadata.schema.to_arrow_schema()
    names = ["" if UNNAMED_INDEX.fullmatch(name) else name for name in schema.names]
    labels = unique_labels(names, log, remarks)
    columns = {}
    texts = {}
    stamps = set()
    for label, column in zip(labels, _arrow_columns(content, schema), strict=True):
        kind = column.type
        text = _as_text(column)
        if text is not None:
            texts[label] = text
            continue
        values = _numbers(column)
        if values is None:
            remarks.append(f"{label}: {kind} is no type of a reading; the column is left out")
            continue
        columns[label] = values
        if pa.types.is_temporal(kind.value_type if pa.types.is_dictionary(kind) else kind):
            stamps.add(label)
    read = read_columns(texts, separator=",").table
    columns |= read.columns
    in_order = {label: columns[label] for label in labels if label in columns}
    table = read._replace(
        columns=in_order | columns,
        remarks=(*remarks, *read.remarks),
        units={**dict.fromkeys(stamps, "s"), **read.units},
        stamps=read.stamps | stamps,
    )
    table = with_named_time(table)
    return table._replace(columns=named_columns(table.columns))


def _arrow_columns(content: bytes, schema: pa.Schema) -> Iterator[pa.ChunkedArray]:
    """The columns, one after the other in memory; a text stands once, however many rows have it."""
    texts = [field.name for field in schema if _is_text(field.type)]
    file = pyarrow.parquet.ParquetFile(pa.BufferReader(content), read_dictionary=texts)
    n_before = dict.fromkeys(schema.names, 0)
    for name, kind in zip(schema.names, schema.types, strict=True):
        if pa.types.is_nested(kind):
            yield pa.chunked_array([], kind)
            continue
        yield file.read(columns=[name]).column(n_before[name])
        n_before[name] += 1


def _is_text(kind: pa.DataType) -> bool:
    tests = (
        pa.types.is_string,
        pa.types.is_large_string,
        pa.types.is_string_view,
        pa.types.is_binary,
        pa.types.is_large_binary,
        pa.types.is_binary_view,
    )
    return any(test(kind) for test in tests)


def _as_text(column: pa.ChunkedArray) -> pa.ChunkedArray | None:
    """A column of text without its list of different texts; None for another one.

    A list is left as it is where the rows would have more text than a file may have.
    """
    kind = column.type
    is_dictionary = pa.types.is_dictionary(kind)
    if not _is_text(kind.value_type if is_dictionary else kind):
        return None
    try:
        if not is_dictionary:
            return column.cast(pa.string())
        words = column.combine_chunks()
        texts = words.dictionary.cast(pa.string())
    except pa.ArrowInvalid:  # bytes that are no text
        return None
    n_bytes = pc.sum(pc.binary_length(texts).take(words.indices)).as_py() or 0
    return pa.chunked_array([texts.take(words.indices)]) if n_bytes <= LARGEST_CONTENT else None


def _numbers(column: pa.ChunkedArray) -> np.ndarray | None:
    """The numbers of a column (n_rows,), NaN where it has none; None for a type without numbers."""
    kind = column.type
    try:
        if pa.types.is_dictionary(kind) and not _is_text(kind.value_type):
            return _numbers(column.cast(kind.value_type))
        if pa.types.is_temporal(kind):
            return _seconds(column)
        return column.cast(pa.float64(), safe=False).to_numpy()
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError):
        return None


def _seconds(column: pa.ChunkedArray) -> np.ndarray:
    """Seconds since 1970, since midnight, or of a duration."""
    kind = column.type
    if pa.types.is_date(kind):
        days = column.cast(pa.date32()).cast(pa.int32())
        return days.cast(pa.float64()).to_numpy() * DAY
    width = pa.int32() if pa.types.is_time32(kind) else pa.int64()
    counts = column.cast(width).cast(pa.float64(), safe=False)
    return counts.to_numpy() * SECONDS[kind.unit]
