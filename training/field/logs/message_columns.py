"""Columns from messages of several kinds, each with a rate of its own, on one axis of time."""

import re
from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from auv_fault_env.errors import refusal
from training.field.logs import limits
from training.field.logs.limits import check_table
from training.field.logs.table import Table, unique_labels
from training.field.units import is_unit

# us, within which messages are one row: fine, and where the table would be too large
ROW_DURATIONS = (20_000, 100_000)
SMALLER_UNITS = {"c": 0.01, "d": 0.1}  # of prefixes before a unit that is known
FEWER = "export fewer kinds of messages"


class Series:
    """The numbers of messages of one kind, a column for each field."""

    def __init__(self, times: Sequence[int] | np.ndarray = ()):
        self.times = array("q") if isinstance(times, tuple) else times  # us
        self.fields: dict[str, Sequence[float] | np.ndarray] = {}

    def add(self, time: int, numbers: Iterable[tuple[str, float]]) -> int:
        """Add a message; returns how many numbers it had."""
        n_before = len(self.times)
        self.times.append(time)
        n_numbers = 0
        for name, value in numbers:
            values = self.fields.setdefault(name, array("d"))
            values.extend([np.nan] * (n_before - len(values)))
            values.append(value)
            n_numbers += 1
        return n_numbers


Key = tuple[str, tuple[str, ...]]  # kind and instance of a message
AllSeries = Mapping[Key, Series]


class MessageColumns:
    """The series of all messages of a log."""

    def __init__(self, log: str, mark: str, remedy: str = FEWER):
        self.log = log
        self.mark = mark  # between the name of a message and that of a field
        self.remedy = remedy
        self.series: dict[Key, Series] = {}
        self.units: dict[tuple[str, str], str] = {}  # by message, and field or array
        self.n_numbers = 0

    def add(
        self, kind: str, instance: tuple[str, ...], time: int, numbers: Iterable[tuple[str, float]]
    ) -> None:
        """Add the numbers of a message [us]; refused where all of them would fill the memory.

        The instance tells messages of one kind apart, by sender or by a number in the message.
        """
        series = self.series.setdefault((kind, instance), Series())
        self.n_numbers += series.add(time, numbers)
        if self.n_numbers > limits.LARGEST_TABLE:
            check_table(self.log, self.n_numbers, 1, self.remedy)

    def table(self, remarks: list[str]) -> Table:
        """All columns, and `time` [s] from the first message; a row has the messages of 20 ms.

        Of two messages of one series within a row, the first counts.
        """
        all_series = {key: series for key, series in self.series.items() if series.fields}
        if not all_series:
            allowed = "messages with numbers"
            raise refusal("log", self.log, allowed, "record the messages of the readings")
        starts, row_of = self._rows(all_series, remarks)
        names = ["time"]
        columns = [(starts - starts[0]) * 1e-6]
        units = ["s"]
        prefixes = self._prefixes(all_series)
        for key, series in all_series.items():
            rows, first = np.unique(row_of(series), return_index=True)
            for field, values in series.fields.items():
                unit, factor = _known_unit(self._unit(key[0], field))
                column = np.full(starts.size, np.nan)
                known = first < len(values)
                column[rows[known]] = factor * np.asarray(values)[first[known]]
                names.append(f"{prefixes[key]}{self.mark}{field}")
                columns.append(column)
                units.append(unit)
        labels = unique_labels(names, self.log, remarks)
        known_units = {label: unit for label, unit in zip(labels, units, strict=True) if unit}
        return Table(dict(zip(labels, columns, strict=True)), tuple(remarks), known_units)

    def _unit(self, kind: str, field: str) -> str:
        """The unit of a field, or of the array that it is an element of."""
        array_name = re.split(r"[\[/]", field)[0]
        return self.units.get((kind, array_name), "")

    def _rows(
        self, all_series: AllSeries, remarks: list[str]
    ) -> tuple[np.ndarray, Callable[[Series], np.ndarray]]:
        """The time of each row (n_rows,) [us], and the function from a series to its rows."""
        n_columns = 1 + sum(len(series.fields) for series in all_series.values())
        times = np.concatenate([np.asarray(series.times) for series in all_series.values()])
        for duration in ROW_DURATIONS:
            steps = np.unique(times // duration)
            if steps.size * n_columns <= limits.LARGEST_TABLE:
                break
        check_table(self.log, steps.size, n_columns, self.remedy)
        if duration != ROW_DURATIONS[0]:
            remarks.append(f"time: one row in {duration * 1e-6:g} s, for the log is long")
        starts = np.full(steps.size, np.iinfo(np.int64).max)
        np.minimum.at(starts, np.searchsorted(steps, times // duration), times)
        return starts, lambda series: np.searchsorted(steps, np.asarray(series.times) // duration)

    def _prefixes(self, all_series: AllSeries) -> dict[Key, str]:
        """The name of each series: the kind, and of several the parts in which they differ."""
        instances: dict[str, list[tuple[str, ...]]] = {}
        for kind, instance in all_series:
            instances.setdefault(kind, []).append(instance)
        prefixes = {}
        for kind, instance in all_series:
            parts = zip(*instances[kind], strict=True)
            differing = [
                part for part, others in zip(instance, parts, strict=True) if len(set(others)) > 1
            ]
            label = ":".join(differing)
            prefixes[kind, instance] = f"{kind}[{label}]" if label else kind
        return prefixes


def _known_unit(unit: str) -> tuple[str, float]:
    """The unit, or a larger one that is known, and the factor to it."""
    if unit and not is_unit(unit) and unit[0] in SMALLER_UNITS and is_unit(unit[1:]):
        return unit[1:], SMALLER_UNITS[unit[0]]
    return unit, 1.0
