"""A vehicle's stream: a line in, a line out, at constant memory; a bad line is told on the error stream and left."""

import csv
import json
import math
import os
import re
import sys
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any, BinaryIO, TextIO

import numpy as np

from auv_fault_env.channels import CHANNELS, READINGS
from auv_fault_env.errors import known_name, refusal
from auv_fault_env.parameters import SAMPLE_RATE, SAMPLE_TIME
from diagnosers import Diagnoser
from training.field.diagnosis.diagnosis import TWO_SIDED, diagnoser_for, persistence
from training.field.logs.clock import GAP
from training.field.logs.dialect import MISSING, seconds
from training.field.logs.log import channels_of
from training.field.logs.plausible import IMPOSSIBLE, largest
from training.field.logs.resolution import noise_of, printed_resolution
from training.field.vehicle_file import Column, VehicleFile

LONGEST_LINE = 65536  # bytes; what is longer is no line of a log
SEPARATORS = ",;\t"
DECIMAL_COMMA = re.compile(r"^([+-]?\d+),(\d+)$")
Row = Mapping[str, Any]  # a line's cells by the name of their column


class BadLine(ValueError):
    """A line that cannot be read; it is left out."""


def follow(
    source: BinaryIO,
    sink: TextIO,
    vehicle: VehicleFile,
    name: str,
    threshold: float,
    errors: TextIO = sys.stderr,
) -> bool:
    """Answer every line of the source with one on the sink, until either ends; whether there was an alarm.

    Lines are CSV below a header, or JSON objects, columns as in the vehicle file. An answer is a
    JSON object with time [s], p_normal, class, severity, its 95 % interval, and alarm; class is
    `normal` as long as no alarm stands. A line comes every 0.1 s at best: the answer to one that
    comes sooner is the last one's. Between lines further apart the vehicle is predicted, beyond 5 s
    the diagnoser starts anew. Raises `InputError` if no line can be read.
    """
    stream = None
    number = 0
    with suppress(BrokenPipeError, KeyboardInterrupt):
        for number, row in rows(source, vehicle, errors):
            try:
                stream = stream or Stream(
                    vehicle, diagnoser_for(name, vehicle, printed(row, vehicle)), threshold
                )
                answer = stream.take(row)
            except BadLine as error:
                print(f"line {number}: {error}; left out", file=errors)
                continue
            for remark in stream.remarks:
                print(f"line {number}: {remark}; taken as missing", file=errors)
            print(json.dumps(answer), file=sink, flush=True)
    if stream is None or stream.time is None:
        got = "no row with a reading"
        allowed = "CSV below a header, or JSON objects"
        raise refusal("standard input", got, allowed, "check the columns")
    return stream.alarmed


def rows(source: BinaryIO, vehicle: VehicleFile, errors: TextIO) -> Iterator[tuple[int, Row]]:
    """Number and cells of every line that can be read; a header without the vehicle's columns is refused."""
    header: list[str] | None = None
    separator = ","
    as_json = None
    for number, text in lines(source):
        as_json = text.startswith("{") if as_json is None else as_json
        try:
            if as_json:
                yield number, json_row(text)
            elif header is None:
                separator = max(SEPARATORS, key=text.count)
                header = checked_header(cells(text, separator), vehicle)
            else:
                yield number, csv_row(cells(text, separator), header)
        except BadLine as error:
            print(f"line {number}: {error}; left out", file=errors)


def lines(source: BinaryIO) -> Iterator[tuple[int, str]]:
    """Number and text of every line that is not empty; of one beyond `LONGEST_LINE`, the beginning."""
    number = 0
    while line := source.readline(LONGEST_LINE):
        number = number + 1
        rest = line
        while rest and not rest.endswith(b"\n"):
            rest = source.readline(LONGEST_LINE)
        text = line.decode("utf-8-sig" if number == 1 else "utf-8", "replace").strip()
        if text:
            yield number, text


def cells(text: str, separator: str) -> list[str]:
    """The cells of a CSV line; a comma in a number is a decimal one where it does not separate cells."""
    try:
        found = [cell.strip() for cell in next(csv.reader([text], delimiter=separator))]
    except csv.Error as error:
        raise BadLine(str(error)) from None
    return found if separator == "," else [DECIMAL_COMMA.sub(r"\1.\2", cell) for cell in found]


def checked_header(names: list[str], vehicle: VehicleFile) -> list[str]:
    """The header, if all columns of the vehicle file are in it."""
    for column in columns_of(vehicle).values():
        known_name("column of the vehicle file", column.name, names)
    return names


def columns_of(vehicle: VehicleFile) -> dict[str, Column]:
    """All columns of the vehicle file by channel, that of the time among them if there is one."""
    return dict(vehicle.columns) | ({"time": vehicle.time} if vehicle.time else {})


def csv_row(values: list[str], header: list[str]) -> Row:
    """Cells by column."""
    if len(values) != len(header):
        raise BadLine(f"{len(values)} cells below a header of {len(header)}")
    return dict(zip(header, values, strict=True))


def json_row(text: str) -> Row:
    """Cells by column."""
    try:
        row = json.loads(text)
    except (ValueError, RecursionError):
        raise BadLine("no JSON object") from None
    if not isinstance(row, dict):
        raise BadLine("no JSON object")
    return row


def number_of(cell: Any, column: Column) -> float:
    """A cell in the channel's unit, NaN if it is no finite number."""
    try:
        value = float(cell) * column.scale + column.offset
    except (TypeError, ValueError, OverflowError):
        return math.nan
    return value if math.isfinite(value) else math.nan


def time_of(cell: Any, column: Column) -> float:
    """A cell of the time's column in seconds: a number or an ISO time stamp."""
    time: float | None = number_of(cell, column)
    if math.isnan(time):
        time = seconds(cell) if isinstance(cell, str) else None
    if time is None:
        raise BadLine(f"no time in {column.name!r}: {str(cell)[:40]!r}")
    return time


def printed(row: Row, vehicle: VehicleFile) -> dict[str, float]:
    """Resolution of every reading as a line prints it; 0 where it has none."""
    names = {name: vehicle.columns[name] for name in READINGS if name in vehicle.columns}
    return {
        name: printed_resolution(str(row[column.name]), column.scale, noise_of(name, vehicle))
        for name, column in names.items()
        if not math.isnan(number_of(row.get(column.name), column))
    }


class Stream:
    """What is known of a vehicle after the last line: a diagnoser's state, the time, and for how long p(normal) is low.

    Attributes
    ----------
    time
        Of the last line [s]; None before the first.
    alarmed
        Whether there ever was an alarm.
    remarks
        What of the last line is taken as missing.
    """

    def __init__(self, vehicle: VehicleFile, diagnoser: Diagnoser, threshold: float):
        self._vehicle = vehicle
        self._diagnoser = diagnoser
        self._threshold = threshold
        self._persistence = persistence(vehicle)
        self._silence = np.full((1, len(CHANNELS)), np.nan)
        self._index = 0
        self._low = 0
        self._limits = {
            name: IMPOSSIBLE * limit for name, limit in largest(vehicle.vehicle).items()
        }
        self.time: float | None = None
        self.alarmed = False
        self.remarks: list[str] = []

    def take(self, row: Row) -> dict[str, Any]:
        """The answer to a line."""
        observation = self._observation(row)
        time = self._time(row)
        if self.time is None or not -SAMPLE_TIME <= time - self.time <= GAP:
            self._begin(time)
        self.time = max(self.time, time)
        index = round((self.time - self._start) * SAMPLE_RATE)
        while self._index < index:
            self._index += 1
            self._update(observation if self._index == index else self._silence)
        return self._answer()

    def _begin(self, time: float) -> None:
        self._diagnoser.reset(1)
        self._start = time
        self.time = time
        self._index = -1
        self._low = 0

    def _observation(self, row: Row) -> np.ndarray:
        self.remarks = []
        values = {channel: self._value(channel, row) for channel in self._vehicle.columns}
        if all(math.isnan(values[channel]) for channel in values if channel in READINGS):
            raise BadLine("no reading in it")
        return channels_of({channel: np.array([value]) for channel, value in values.items()})

    def _value(self, channel: str, row: Row) -> float:
        column = self._vehicle.columns[channel]
        limit = self._limits[channel]
        cell = row.get(column.name)
        value = number_of(cell, column)
        unknown = math.isnan(value) and str(cell).lower() not in MISSING
        if unknown or abs(value) > limit:
            self.remarks.append(
                f"{channel}: {str(cell)[:40]!r}" + ("" if unknown else f" is beyond {limit:.3g}")
            )
        return value if abs(value) <= limit else math.nan

    def _time(self, row: Row) -> float:
        if self._vehicle.time is not None:
            return time_of(row.get(self._vehicle.time.name), self._vehicle.time)
        return 0.0 if self.time is None else self.time + 1.0 / self._vehicle.sample_rate

    def _update(self, observation: np.ndarray) -> None:
        self._belief = self._diagnoser.update(observation)
        self._low = self._low + 1 if self._belief.log_probability[0, 0] < self._threshold else 0
        self.alarmed |= self._low >= self._persistence

    def _answer(self) -> dict[str, Any]:
        log_probability, mean, std = (values[0] for values in self._belief)
        alarm = self._low >= self._persistence
        k = 1 + int(log_probability[1:].argmax()) if alarm else 0
        severity = float(mean[k])
        spread = TWO_SIDED * float(std[k])
        return {
            "time": round(self.time, 6),
            "p_normal": math.exp(log_probability[0]),
            "class": self._diagnoser.classes[k],
            "severity": round(severity, 4),
            "severity_95": [
                round(max(severity - spread, 0.0), 4),
                round(min(severity + spread, 1.0), 4),
            ],
            "alarm": alarm,
        }


def close_quietly(sink: TextIO) -> None:
    """Let Python's own flush at the end go nowhere if the reader has left."""
    try:
        sink.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sink.fileno())
