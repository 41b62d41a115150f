"""The files of a published data set, and columns with a number in every cell."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import csv

from auv_fault_env.errors import refusal


def data_files(folder: Path, pattern: str, source: str) -> list[Path]:
    """The files of the pattern, sorted; `InputError` with the data's source if there are none."""
    files = sorted(Path(folder).glob(pattern))
    if not files:
        allowed = f"one that holds {pattern}"
        raise refusal("data folder", str(folder), allowed, f"get the data at {source}")
    return files


def read_columns(path: Path, names: Sequence[str], least: int) -> np.ndarray:
    """The named columns of a CSV file, (n_rows, n_names), by their header.

    Raises `InputError` unless all columns are there, every cell is a finite number and there are at
    least `least` rows.
    """
    types = dict.fromkeys(names, pa.float64())
    options = csv.ConvertOptions(include_columns=list(names), column_types=types)
    contents = f"at least {least} rows and a number in every cell"
    allowed = f"CSV with the columns {', '.join(names)}, {contents}"
    try:
        table = csv.read_csv(path, csv.ReadOptions(use_threads=False), convert_options=options)
    except (OSError, pa.ArrowException) as error:
        raise refusal(f"file {path.name}", str(error), allowed, "download it again") from None
    columns = np.column_stack([table[name].to_numpy() for name in names])
    n_missing = np.count_nonzero(~np.isfinite(columns))
    if len(columns) < least or n_missing:
        got = f"{len(columns)} rows, {n_missing} cells without a number"
        raise refusal(f"file {path.name}", got, allowed, "download it again")
    return columns
