"""Reading a published data set: its files, and their columns, of which every cell has to be a number."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import csv

from auv_fault_env.errors import refusal


def data_files(folder: Path, pattern: str, source: str) -> list[Path]:
    """The files of the pattern in their order; if there are none, a refusal that says where to get the data."""
    files = sorted(Path(folder).glob(pattern))
    if not files:
        raise refusal(
            "data folder", str(folder), f"one that holds {pattern}", f"get the data at {source}"
        )
    return files


def read_columns(path: Path, names: Sequence[str], least: int) -> np.ndarray:
    """The named columns of a CSV file, (n_rows, n_names), by their header.

    Raises `InputError` unless all columns are there, every cell is a finite number and there are at
    least `least` rows.
    """
    every = csv.ConvertOptions(
        include_columns=list(names), column_types=dict.fromkeys(names, pa.float64())
    )
    allowed = (
        f"CSV with the columns {', '.join(names)}, at least {least} rows and a number in every cell"
    )
    try:
        table = csv.read_csv(path, csv.ReadOptions(use_threads=False), convert_options=every)
    except (OSError, pa.ArrowException) as error:
        raise refusal(f"file {path.name}", str(error), allowed, "download it again") from None
    columns = np.column_stack([table[name].to_numpy() for name in names])
    if len(columns) < least or not np.isfinite(columns).all():
        got = (
            f"{len(columns)} rows, {np.count_nonzero(~np.isfinite(columns))} cells without a number"
        )
        raise refusal(f"file {path.name}", got, allowed, "download it again")
    return columns
