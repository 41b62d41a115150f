"""A vehicle's stream: each line is answered with a line, at constant memory.

A line that cannot be read is reported on the error stream and left out.
"""

import csv
import json
import math
import os
import re
import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO, TextIO

import numpy as np

from auv_fault_env.channels import CHANNELS, READINGS
from auv_fault_env.errors import known_name, refusal
from auv_fault_env.parameters import SAMPLE_RATE, SAMPLE_TIME
from diagnosers import Diagnoser
from diagnosers.residuals import Residuals
from training.field.diagnosis.causes import strongest_rule
from training.field.diagnosis.diagnosis import TWO_SIDED, diagnoser_for, persistence
from training.field.diagnosis.stream_notes import Notes
from training.field.logs.cells import (
    COMMENT_MARKS,
    LONGEST_LINE,
    MISSING,
    cells_of,
    matching_names,
    separator_of,
    share_of_values,
    without_stray_quotes,
)
from training.field.logs.clock import GAP
from training.field.logs.encoding import encoding_of
from training.field.logs.header_rows import is_byte_row, is_unit_row
from training.field.logs.plausible import IMPOSSIBLE, largest_magnitudes
from training.field.logs.resolution import printed_resolution
from training.field.logs.stream_cells import PLAIN, Row, StreamClock, StreamNumbers
from training.field.logs.table import unique_labels
from training.field.vehicle_file import Column, VehicleFile
from training.logged_vehicle import observations_of

SOURCE = "standard input"
TRUTH = {"true": 1.0, "false": 0.0}


class BadLine(ValueError):
    """A line that cannot be read; it is left out."""


def follow(
    source: BinaryIO,
    sink: TextIO,
    vehicle: VehicleFile,
    name: str,
    threshold: float,
    errors: TextIO = sys.stderr,
    weights: Path | None = None,
) -> bool:
    """Answer every line of the source with a line on the sink, until either ends.

    An answer is a JSON object with time [s], p_normal, class, severity, its 95 % interval, and
    alarm; class is `normal` as long as no alarm stands. With `residuals` it also has raised_by,
    what is farthest beyond its limit in an alarm. Lines may be 0.1 s apart: the answer to a
    line that comes sooner repeats the last one. Between lines further apart the vehicle is
    predicted; after more than 5 s the diagnoser starts anew.

    The source is CSV below a header, or JSON objects, with columns as in the vehicle file; `name`
    is the diagnoser's, `weights` the file of its own ones, and the threshold that of log p(normal).
    `errors` receives `Notes` on lines and cells that cannot be read. Returns whether there was
    an alarm. `InputError` if the header lacks a column, or if no line can be read.
    """
    stream = None
    notes = Notes(errors)
    with suppress(BrokenPipeError, KeyboardInterrupt):
        for line_number, row in rows(source, vehicle, notes):
            try:
                if stream is None:
                    resolution = printed_resolutions(row, vehicle)
                    diagnoser = diagnoser_for(name, vehicle, resolution, weights)
                    stream = Stream(vehicle, diagnoser, threshold)
                answer = stream.answer(row)
            except BadLine as error:
                leave_out(line_number, error, notes)
                continue
            for kind, remark in stream.remarks.items():
                notes.add(line_number, kind, f"{remark}; taken as missing")
            print(json.dumps(answer), file=sink, flush=True)
    notes.close()
    if stream is None or stream.time is None:
        allowed = "CSV below a header, or JSON objects"
        raise refusal(SOURCE, "no row with a reading", allowed, "check the columns")
    return stream.was_alarmed


def leave_out(line_number: int, error: BadLine, notes: Notes) -> None:
    """Note that a line is left out; its kind is the error without the cell that it shows."""
    notes.add(line_number, str(error).partition(":")[0], f"{error}; left out")


def rows(source: BinaryIO, vehicle: VehicleFile, notes: Notes) -> Iterator[tuple[int, Row]]:
    """Line number and cells of every line that can be read, with plain numbers."""
    reader = None
    for line_number, text in lines(source):
        try:
            if reader is None:
                is_json = text.lstrip().startswith("{")
                reader = JsonRows(vehicle) if is_json else csv_rows(text, vehicle)
                if not is_json:
                    continue
            if reader is not None and (row := reader.row(text)) is not None:
                yield line_number, row
        except BadLine as error:
            leave_out(line_number, error, notes)


def lines(source: BinaryIO) -> Iterator[tuple[int, str]]:
    """Number and text of every line that is not empty; of one beyond `LONGEST_LINE`, the start."""
    line_number = 0
    while line := source.readline(LONGEST_LINE):
        line_number += 1
        rest = line
        while rest and not rest.endswith(b"\n"):
            rest = source.readline(LONGEST_LINE)
        encoding = encoding_of(line) if line_number == 1 else "utf-8"
        if encoding.startswith("utf-16"):
            remedy = "put `iconv -f UTF-16 -t UTF-8` before it"
            raise refusal(SOURCE, "text in UTF-16", "text in UTF-8", remedy)
        text = _decoded(line).removeprefix("\ufeff").rstrip("\r\n")
        if text.strip():
            yield line_number, text


def _decoded(line: bytes) -> str:
    try:
        return line.decode("utf-8")
    except UnicodeDecodeError:
        return line.decode("latin-1")


def csv_rows(header: str, vehicle: VehicleFile) -> "CsvRows | None":
    """The rows below a header; None for the line before it in which a spreadsheet says how."""
    return None if re.fullmatch(r"sep=.", header.strip()) else CsvRows(header, vehicle)


class CsvRows:
    """The rows of a CSV stream below its header, read by the rules for files.

    Where a file shows its layout by many lines, a stream has to show it by the first ones.
    `InputError` if a column of the vehicle file is not in the header.
    """

    def __init__(self, header: str, vehicle: VehicleFile):
        header = header.lstrip(COMMENT_MARKS)
        self._separator = separator_of([header])
        self._names = cells_of(header, self._separator)
        needed = needed_columns(vehicle, self._names)
        if not set(needed) & set(self._names):
            allowed = f"the header as first line, with {', '.join(needed)}"
            remedy = "leave out the lines before it, or diagnose the log as a file"
            raise refusal(SOURCE, header.strip(), allowed, remedy)
        for name in needed:
            known_name("column of the vehicle file", name, self._names)
        self._numbers = StreamNumbers(self._separator, needed)
        self._labels: list[str] | None = None
        self._has_units = False

    def row(self, text: str) -> Row | None:
        """The cells by column; None for a row of units or types under the header."""
        try:
            cells = cells_of(without_stray_quotes(text), self._separator)
        except csv.Error as error:
            raise BadLine(str(error)) from None
        names = self._labels or matching_names(self._names, [cells], self._separator)
        if len(cells) != len(names):
            raise BadLine(f"{len(cells)} cells below a header of {len(names)}")
        if self._labels is None:
            if share_of_values(cells) == 0 or is_unit_row(cells):
                self._has_units = True
                return None
            if self._has_units and is_byte_row(cells):
                return None
            self._labels = unique_labels(names, SOURCE, [])
        return self._numbers.plain(dict(zip(self._labels, cells, strict=True)))


class JsonRows:
    """The rows of a stream of JSON objects."""

    def __init__(self, vehicle: VehicleFile):
        self._numbers = StreamNumbers("", needed_columns(vehicle, ()))

    def row(self, text: str) -> Row:
        """The values of an object by column."""
        try:
            row = json.loads(text)
        except (ValueError, RecursionError):
            raise BadLine("no JSON object") from None
        if not isinstance(row, dict):
            raise BadLine("no JSON object")
        return self._numbers.plain(row)


def needed_columns(vehicle: VehicleFile, names: Iterable[str]) -> list[str]:
    """The columns of a stream with these names that the vehicle file refers to."""
    columns = [name for column in vehicle.columns.values() for name in column.names]
    if vehicle.time is not None:
        columns += StreamClock(vehicle.time, names).columns
    return list(dict.fromkeys(columns))


def value_of(cell: Any, column: Column) -> float:
    """A cell in the channel's unit, NaN if it is no finite number."""
    text = str(cell)
    if not PLAIN.fullmatch(text):
        return TRUTH.get(text.lower(), math.nan) * column.scale + column.offset
    scaled = float(text) * column.scale + column.offset
    return scaled if math.isfinite(scaled) else math.nan


def reading_of(row: Row, column: Column) -> float:
    """The reading of a line in the channel's unit, NaN where a cell is no finite number."""
    value = value_of(row.get(column.name), column)
    if column.times is not None:
        value *= value_of(row.get(column.times), Column(column.times))
    return value


def printed_resolutions(row: Row, vehicle: VehicleFile) -> dict[str, float]:
    """Resolution of every reading as a line prints it, where it has it in one cell."""
    steps = {}
    for name in READINGS:
        column = vehicle.columns.get(name)
        is_printed = column and column.times is None
        if is_printed and not math.isnan(reading_of(row, column)):
            text = str(row[column.name])
            steps[name] = printed_resolution(text, column.scale, vehicle.noise[name])
    return steps


class Stream:
    """The diagnosis of a stream after its last line."""

    def __init__(self, vehicle: VehicleFile, diagnoser: Diagnoser, threshold: float):
        self._vehicle = vehicle
        self._diagnoser = diagnoser
        self._threshold = threshold
        self._persistence = persistence(vehicle)
        self._no_reading = np.full((1, len(CHANNELS)), np.nan)
        self._clock: StreamClock | None = None  # of the columns of the first line
        self._index = 0  # of the last sample since the diagnoser started
        self._n_low = 0  # samples in a row with p(normal) below the threshold
        magnitudes = largest_magnitudes(vehicle.vehicle)
        self._limits = {name: IMPOSSIBLE * magnitude for name, magnitude in magnitudes.items()}
        self.time: float | None = None  # of the last line [s]
        self.was_alarmed = False  # ever
        # why cells of the last line are taken as missing, by kind
        self.remarks: dict[str, str] = {}

    def answer(self, row: Row) -> dict[str, Any]:
        """The answer to a line; `BadLine` if it has no reading or no time."""
        observation = self._observation(row)
        time = self._time(row)
        if self.time is None or not -SAMPLE_TIME <= time - self.time <= GAP:
            self._start_anew(time)
        self.time = max(self.time, time)
        index = round((self.time - self._start) * SAMPLE_RATE)
        while self._index < index:
            self._index += 1
            self._update(observation if self._index == index else self._no_reading)
        return self._last_answer()

    def _start_anew(self, time: float) -> None:
        self._diagnoser.reset(1)
        self._start = time
        self.time = time
        self._index = -1
        self._n_low = 0

    def _observation(self, row: Row) -> np.ndarray:
        self.remarks = {}
        values = {channel: self._value(channel, row) for channel in self._vehicle.columns}
        if all(math.isnan(values[channel]) for channel in values if channel in READINGS):
            raise BadLine("no reading in it")
        return observations_of({channel: np.array([value]) for channel, value in values.items()})

    def _value(self, channel: str, row: Row) -> float:
        column = self._vehicle.columns[channel]
        cell = " * ".join(str(row.get(name)) for name in column.names)
        shown = cell[:40]
        value = reading_of(row, column)
        limit = self._limits[channel]
        if math.isnan(value):
            if cell.lower() not in MISSING:
                self.remarks[f"{channel} that is no number"] = f"{channel}: {shown!r}"
        elif abs(value) > limit:
            unit = CHANNELS[channel].unit
            remark = f"{channel}: {shown!r} is beyond {limit:.3g} {unit}; is its unit right?"
            self.remarks[f"{channel} beyond {limit:.3g} {unit}"] = remark
            value = math.nan
        return value

    def _time(self, row: Row) -> float:
        column = self._vehicle.time
        if column is None:
            return 0.0 if self.time is None else self.time + 1.0 / self._vehicle.sample_rate
        if self._clock is None:
            self._clock = StreamClock(column, row)
        seconds = self._clock.seconds(row)
        if seconds is None:
            raise BadLine(f"no time in {column.name!r}: {str(row.get(column.name))[:40]!r}")
        return seconds

    def _update(self, observation: np.ndarray) -> None:
        self._belief = self._diagnoser.update(observation)
        is_low = self._belief.log_probability[0, 0] < self._threshold
        self._n_low = self._n_low + 1 if is_low else 0
        self.was_alarmed |= self._n_low >= self._persistence

    def _last_answer(self) -> dict[str, Any]:
        log_probability, mean, std = (values[0] for values in self._belief)
        alarm = self._n_low >= self._persistence
        k = 1 + int(log_probability[1:].argmax()) if alarm else 0
        answer: dict[str, Any] = {
            "time": round(self.time, 6),
            "p_normal": math.exp(log_probability[0]),
            "class": self._diagnoser.classes[k],
            "severity": None,
            "severity_95": None,
            "alarm": alarm,
        }
        if isinstance(self._diagnoser, Residuals):
            answer["raised_by"] = strongest_rule(self._diagnoser) if alarm else None
            return answer
        severity = float(mean[k])
        margin = TWO_SIDED * float(std[k])
        low = max(severity - margin, 0.0)
        high = min(severity + margin, 1.0)
        answer["severity"] = round(severity, 4)
        answer["severity_95"] = [round(low, 4), round(high, 4)]
        return answer


def close_quietly(sink: TextIO) -> None:
    """Flush the sink, and redirect it to nowhere if its reader has closed it."""
    try:
        sink.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sink.fileno())
