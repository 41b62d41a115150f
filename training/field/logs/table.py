"""Tables of numbers, as all readers of log files return them."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from auv_fault_env.errors import InputError, refusal
from auv_fault_env.printable import printable

WIDEST = 4096  # columns
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
    stamps: frozenset[str] = frozenset()  # columns of time stamps as text


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


def named_columns(columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The columns without those that have no name in the header."""
    return {label: values for label, values in columns.items() if not label.startswith(" ")}
