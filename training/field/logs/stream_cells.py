"""The cells of a stream, read by the rules for columns as far as the lines until now decide."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa

from training.field.logs.cells import MISSING
from training.field.logs.numerals import (
    COMMA,
    POINT,
    Evidence,
    decimal_mark,
    evidence_of_number,
    is_grouped,
    plain_number,
    split_number,
)
from training.field.logs.stamp_columns import (
    beside_name,
    is_named_as_time,
    part_labels,
    time_of_parts,
    with_dates,
)
from training.field.logs.stamp_seconds import seconds_of
from training.field.logs.stamps import Stamps, Undecided, is_turn_of_digits, read_stamps
from training.field.logs.table import TIME
from training.field.logs.text_columns import undecided_stamps
from training.field.units import spelt
from training.field.vehicle_file import Column

Row = Mapping[str, Any]  # the cells of a line by the name of their column
PLAIN = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
UNDECIDED = "a decimal number or thousands?"
POINT_AMONG_COMMAS = "a decimal point among commas"
WHOLE = re.compile(r"[+-]?\d+")
SECONDS_OR_CLOCK = "seconds, or hours, minutes and seconds"
CLOCK_DIGITS = re.compile(r"[0-2]\d[0-5]\d[0-5]\d(?:\.\d+)?")


class StreamNumbers:
    """The numbers of a stream with a decimal point, without thousands and units.

    A cell that may be a decimal number or thousands is no number before a line has shown which.
    """

    def __init__(self, separator: str, labels: Iterable[str]):
        self._separator = separator
        self._labels = tuple(labels)
        self._evidence: dict[str, Evidence] = {}
        self._lines = Evidence()  # of all columns
        self._marks: dict[str, str] = {}  # by column that has shown its decimal mark
        self._units: dict[str, str] = {}  # behind the numbers

    def plain(self, row: Row) -> dict[str, Any]:
        """The row with plain numbers in the columns of the vehicle; other cells as they are."""
        cells = {label: row[label] for label in self._labels if isinstance(row.get(label), str)}
        shown = cells if self._lines.point or self._lines.comma else row
        for label, cell in shown.items():
            if label not in self._marks and isinstance(cell, str):
                self._add_evidence(label, cell)
        return {**row, **{label: self._plain(label, cell) for label, cell in cells.items()}}

    def _add_evidence(self, label: str, cell: str) -> None:
        number, _ = split_number(cell)
        if number is None:
            return
        evidence = Evidence(whole=1) if WHOLE.fullmatch(number) else evidence_of_number(number)
        self._lines += evidence
        own = self._evidence.get(label, Evidence()) + evidence
        self._evidence[label] = own
        if own.point or own.comma:
            self._marks[label] = POINT if own.point else COMMA

    def _plain(self, label: str, cell: str) -> str:
        mark = self._marks.get(label) or self._mark(label)
        if WHOLE.fullmatch(cell) or (mark == POINT and PLAIN.fullmatch(cell)):
            return cell
        if mark is None:
            return f"{cell} ({UNDECIDED})" if is_grouped(cell) else cell
        number, unit = split_number(cell)
        is_of_unit = not unit or self._units.setdefault(label, unit) == unit
        if number is None or not is_of_unit or cell.lower() in MISSING:
            return cell
        plain = plain_number(number, mark)
        is_point = plain is None and PLAIN.fullmatch(cell)
        return f"{cell} ({POINT_AMONG_COMMAS})" if is_point else plain or cell

    def _mark(self, label: str) -> str | None:
        """The decimal mark of a column that has not shown its own."""
        own = self._evidence.get(label, Evidence())
        if own.is_open and not (self._lines.point or self._lines.comma):
            return POINT if self._separator == COMMA and own.grouped_by_point else None
        return decimal_mark(own, self._lines, self._separator)


class StreamClock:
    """The time of a stream in seconds, from numbers or time stamps in one or several columns."""

    def __init__(self, column: Column, names: Iterable[str]):
        self._column = column
        self._hint = beside_name(column.name)
        self._names = list(names)
        is_of_parts = column.name == TIME and TIME not in self._names
        # columns of hour, minute and second in place of a time
        self._parts = list(part_labels(self._names).values()) if is_of_parts else []
        self._labels: list[str] | None = None  # of the stamps, once a line has shown them
        self._is_of_digits = False
        self._last_number = np.float64(np.nan)  # of a column of numbers
        self._cells: dict[str, str] | None = None  # of the last line with a time
        self._seconds = 0.0  # of that line

    @property
    def columns(self) -> list[str]:
        """The columns that every line must have."""
        return self._parts or [self._column.name]

    def seconds(self, row: Row) -> float | None:
        """The time of a line; None if it has none that can be read.

        `InputError` for stamps that can be read in two ways.
        """
        try:
            if self._labels is None:
                self._labels = self._labels_of_stamps(row)
            if not self._labels:
                return self._number(row)
            return self._of_stamps({label: str(row.get(label)) for label in self._labels})
        except Undecided as error:
            example = str(row.get(self._column.name))
            raise undecided_stamps(self._column.name, example, error) from None

    def _labels_of_stamps(self, row: Row) -> list[str] | None:
        """The columns of time stamps; none for a number, None where the line does not show it."""
        if self._parts:
            return self._parts
        cell = str(row.get(self._column.name))
        if PLAIN.fullmatch(cell):
            self._is_of_digits = self._are_digits_a_stamp(cell)
            return [self._column.name] if self._is_of_digits else []
        times = {
            label: self._stamps(label, [str(row.get(label))])
            for label in self._names or [self._column.name]
            if label == self._column.name or is_named_as_time(label)
        }
        known = {label: stamps for label, stamps in times.items() if stamps}
        if self._column.name not in known:
            return None
        _, pairs = with_dates(known, list(known))
        pair = next((pair for pair in pairs if self._column.name in pair), None)
        return list(pair) if pair else [self._column.name]

    def _are_digits_a_stamp(self, cell: str) -> bool:
        """Whether a number of digits is date and time, or a time of the day."""
        if not is_named_as_time(self._column.name) or spelt(self._hint, "s"):
            return False
        if CLOCK_DIGITS.fullmatch(cell) and not cell.startswith("0"):
            raise Undecided(SECONDS_OR_CLOCK)
        return read_stamps(pa.array([cell]), only_digits=True) is not None

    def _number(self, row: Row) -> float | None:
        cell = str(row.get(self._column.name))
        if not PLAIN.fullmatch(cell):
            return None
        number = np.float64(cell)
        is_named = spelt(self._hint, "s") or self._column.scale != 1.0
        if not is_named and is_turn_of_digits(self._last_number, number):
            raise Undecided(SECONDS_OR_CLOCK)
        self._last_number = number
        seconds = float(number) * self._column.scale + self._column.offset
        return seconds if math.isfinite(seconds) else None

    def _of_stamps(self, cells: dict[str, str]) -> float | None:
        """The time of stamps, with the turns of the clock since the first line."""
        lines = [cells] if self._cells is None else [self._cells, cells]
        stamps = self._read(lines)
        if stamps is None:
            return None
        seconds, _ = seconds_of(stamps, is_whole=False)
        if np.isnan(seconds).any():
            return None
        self._seconds += float(seconds[-1] - (0.0 if self._cells is None else seconds[0]))
        self._cells = cells
        return self._seconds

    def _read(self, lines: Sequence[Mapping[str, str]]) -> Stamps | None:
        if self._parts:
            texts = {label: [line[label] for line in lines] for label in self._parts}
            if not all(PLAIN.fullmatch(cell) for cells in texts.values() for cell in cells):
                return None
            return time_of_parts({label: np.array(cells, float) for label, cells in texts.items()})
        stamps = {
            label: self._stamps(label, [line[label] for line in lines]) for label in self._labels
        }
        if not all(stamps.values()):
            return None
        return with_dates(stamps, self._labels)[0][self._column.name]

    def _stamps(self, label: str, cells: list[str]) -> Stamps | None:
        hint = beside_name(label)
        digits = self._is_of_digits
        return read_stamps(pa.array(cells), hint, only_digits=digits, is_whole=False)
