"""Tables from Parquet files."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet

from auv_fault_env.errors import refusal
from training.field.logs.table import Table, named_columns, unique_labels
from training.field.logs.text_table import column_values, one_line


def parquet_table(content: bytes, log: str) -> Table:
    """The table of a Parquet file; a column of another type than numbers, text or time is NaN."""
    try:
        table = pyarrow.parquet.read_table(pa.BufferReader(content))
    except (pa.ArrowException, OSError) as error:
        remedy = f"write it again ({one_line(error)})"
        raise refusal("log", log, "a whole Parquet file", remedy) from None
    remarks: list[str] = []
    labels = unique_labels(table.column_names, log, remarks)
    columns = {
        label: _column_values(column) for label, column in zip(labels, table.columns, strict=True)
    }
    return Table(named_columns(columns), tuple(remarks))


def _column_values(column: pa.ChunkedArray) -> np.ndarray:
    kind = column.type
    try:
        if pa.types.is_string(kind) or pa.types.is_large_string(kind):
            return column_values(column.fill_null(""), decimal_comma=False)[0]
        if pa.types.is_timestamp(kind):
            micros = column.cast(pa.timestamp("us", kind.tz), safe=False).cast(pa.int64())
            return micros.cast(pa.float64()).to_numpy() / 1e6
        return column.cast(pa.float64(), safe=False).to_numpy()
    except pa.ArrowException:
        return np.full(len(column), np.nan)
