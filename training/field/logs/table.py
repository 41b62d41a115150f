"""Tables of numbers, as all readers of log files return them."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from auv_fault_env.errors import InputError, refusal
from auv_fault_env.printable import printable

WIDEST = 4096  # columns
TIME = "time"  # the column that is read from several ones, or from one without a name
LONGEST_NAME = 200  # characters of a column's name


class Table(NamedTuple):
    """Columns of numbers by name."""

    # (n_rows,) each, NaN where a cell holds no number. Time stamps are seconds since 1970, or since
    # midnight where they have no date.
    columns: dict[str, np.ndarray]
    remarks: tuple[str, ...]  # what was repaired, one line each
    # from a row under the header or behind the numbers; s of time stamps
    units: Mapping[str, str] = MappingProxyType({})
    # by column whose values must not be used: why
    refusals: Mapping[str, InputError] = MappingProxyType({})
    stamps: frozenset[str] = frozenset()  # columns of time stamps, not of numbers


def unique_labels(names: Sequence[str], log: str, remarks: list[str]) -> list[str]:
    """A label of its own for each column; a column without a name gets a blank and its number.

    Control characters are escaped, and long names are cut, here and nowhere else.
    """
    if len(names) > WIDEST:
        raise refusal("log", f"{log}: {len(names)} columns", f"at most {WIDEST}", "export fewer")
    names = [printable(name, longest=LONGEST_NAME) for name in names]
    labels: list[str] = []
    taken = set(names)
    for k, name in enumerate(names):
        label = name or f" {k}"
        if label in labels:
            numbered = (f"{name} ({number})" for number in range(2, len(names) + 2))
            label = next(candidate for candidate in numbered if candidate not in taken)
            remarks.append(f"header: {name!r} occurs more than once; one is called {label!r}")
            taken.add(label)
        labels.append(label)
    return labels


def with_named_time(table: Table) -> Table:
    """The table in which the only column of time stamps without a name is the column `time`."""
    unnamed = [label for label in table.stamps if label.startswith(" ")]
    if len(unnamed) != 1 or TIME in table.columns:
        return table
    label = unnamed[0]
    columns = {TIME: table.columns[label], **table.columns}
    return table._replace(
        columns=columns,
        units={**table.units, TIME: "s"},
        stamps=table.stamps | {TIME},
        remarks=(*table.remarks, "time: read from the column without a name"),
    )


def named_columns(columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The columns without those that have no name in the header."""
    return {label: values for label, values in columns.items() if not label.startswith(" ")}
