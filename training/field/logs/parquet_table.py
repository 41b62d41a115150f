"""Tables from Parquet files."""

from collections.abc import Iterator

import numpy as np
import pyarrow as pa
import pyarrow.parquet

from auv_fault_env.errors import refusal
from training.field.logs.limits import check_content, check_table
from training.field.logs.table import Table, named_columns, unique_labels
from training.field.logs.text_table import column_values, one_line

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
DAY = 86_400.0  # s


def parquet_table(content: bytes, log: str) -> Table:
    """The table of a Parquet file: numbers, text, dates, times of day, and durations [s].

    A column of another type, such as a list, is left out with a remark. `InputError` for a damaged
    file, and before a file is unpacked that would fill the memory.
    """
    remarks: list[str] = []
    try:
        columns, units = _columns(content, log, remarks)
    except (pa.ArrowException, OSError) as error:
        remedy = f"write it again ({one_line(error)})"
        raise refusal("log", log, "a whole Parquet file", remedy) from None
    return Table(named_columns(columns), tuple(remarks), units)


def _columns(
    content: bytes, log: str, remarks: list[str]
) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    metadata = pyarrow.parquet.read_metadata(pa.BufferReader(content))
    check_table(log, metadata.num_rows, metadata.num_columns)
    groups = map(metadata.row_group, range(metadata.num_row_groups))
    check_content(log, sum(group.total_byte_size for group in groups))
    schema = metadata.schema.to_arrow_schema()
    labels = unique_labels(schema.names, log, remarks)
    columns = {}
    units = {}
    for label, column in zip(labels, _arrow_columns(content, schema), strict=True):
        kind = column.type
        values = _numbers(column, label, remarks)
        if values is None:
            remarks.append(f"{label}: {kind} is no type of a reading; the column is left out")
            continue
        columns[label] = values
        if pa.types.is_temporal(kind):
            units[label] = "s"
    return columns, units


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


def _numbers(column: pa.ChunkedArray, label: str, remarks: list[str]) -> np.ndarray | None:
    """The numbers of a column (n_rows,), NaN where it has none; None for a type without numbers."""
    kind = column.type
    try:
        if pa.types.is_dictionary(kind):
            return _numbers_of_words(column, label, remarks)
        if _is_text(kind):
            return _numbers_of_text(column, label, remarks)
        if pa.types.is_temporal(kind):
            return _seconds(column)
        return column.cast(pa.float64(), safe=False).to_numpy()
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError):
        return None


def _numbers_of_words(column: pa.ChunkedArray, label: str, remarks: list[str]) -> np.ndarray | None:
    """As `_numbers`, of a column that refers to a list of its different values."""
    words = column.combine_chunks()
    numbers = _numbers(pa.chunked_array([words.dictionary]), label, remarks)
    if numbers is None:
        return None
    places = words.indices.fill_null(len(numbers)).to_numpy(zero_copy_only=False)
    return np.append(numbers, np.nan)[places]


def _numbers_of_text(column: pa.ChunkedArray, label: str, remarks: list[str]) -> np.ndarray:
    values, remark = column_values(column.cast(pa.string()).fill_null(""), decimal_comma=False)
    if remark:
        remarks.append(f"{label}: {remark}")
    return values


def _seconds(column: pa.ChunkedArray) -> np.ndarray:
    """Seconds since 1970, since midnight, or of a duration."""
    kind = column.type
    if pa.types.is_date(kind):
        days = column.cast(pa.date32()).cast(pa.int32())
        return days.cast(pa.float64()).to_numpy() * DAY
    width = pa.int32() if pa.types.is_time32(kind) else pa.int64()
    counts = column.cast(width).cast(pa.float64(), safe=False)
    return counts.to_numpy() * SECONDS[kind.unit]
