"""A table reads back the same however it is written, from a file and from a stream."""

import datetime as dt
import io
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from auv_fault_env.errors import InputError
from training.field.diagnosis.stream import reading_of, rows
from training.field.logs.stream_cells import StreamClock
from training.field.logs.text_table import text_table
from training.field.vehicle_file import Column, VehicleFile

from ..fleet_logs import VEHICLE

FIRST = dt.datetime(2024, 5, 1, 9, 59, 50)
NAMES = {"speed": "u", "port_rpm": "n"}


def tenths(moment):
    return moment.microsecond // 100_000


# notations of a moment; those of the second table need more than a line to be decided
STAMPS = {
    "seconds": lambda m: f"{90 + (m - FIRST).total_seconds():.1f}",
    "milliseconds": lambda m: f"{(m - FIRST) / dt.timedelta(milliseconds=1):.0f}",
    "ISO": lambda m: f"{m:%Y-%m-%d %H:%M:%S}.{tenths(m)}",
    "ISO in a zone": lambda m: f"{m:%Y-%m-%dT%H:%M:%S}.{tenths(m)}+02:00",
    "German": lambda m: f"{m:%d.%m.%Y %H:%M:%S}.{tenths(m)}",
    "American": lambda m: f"{m:%m/%d/%Y %I:%M:%S}.{tenths(m)} {m:%p}",
    "MATLAB": lambda m: f"{m:%d-%b-%Y %H:%M:%S}.{tenths(m)}",
    "clock": lambda m: f"{m:%H:%M:%S}.{tenths(m)}",
    "minutes and seconds": lambda m: f"{m:%M:%S}.{tenths(m)}",
    "pandas": lambda m: f"{m.day} days {m:%H:%M:%S}.{m.microsecond:06}",
    "two columns": lambda m: f"{m:%Y-%m-%d}\0{m:%H:%M:%S}.{tenths(m)}",
    "three columns": lambda m: f"{m:%H}\0{m:%M}\0{m:%S}.{tenths(m)}",
}
OF_WHOLE_COLUMNS = {
    "day or month first": lambda m: f"{m:%d/%m/%Y %H:%M:%S}.{tenths(m)}",
    "whole seconds": lambda m: f"{m:%M:%S}",
    "digits": lambda m: f"{m:%H%M%S}.{tenths(m)}",
}
NAMES_OF_TIME = {"two columns": "Date\0Time", "three columns": "Hour\0Minute\0Second"}
SCALES = {"milliseconds": 1e-3}


class Dialect(NamedTuple):
    """How a table is written."""

    separator: str
    comma: bool
    thousands: bool
    unit: str  # behind the speeds
    units: str  # rows under the header
    stamp: str
    end: str
    quotes: bool
    bom: bool
    first: dt.datetime


def written(dialect, steps, speeds, rpms, stamps, preamble=""):
    """The table, with the time of each row after the first."""
    mark = "," if dialect.comma else "."
    group = "." if dialect.comma else ","
    lines = [[*NAMES_OF_TIME.get(dialect.stamp, "Time").split("\0"), "u", "n"]]
    n_times = len(lines[0]) - 2
    if dialect.units:
        lines.append([*["s"] * n_times, "m/s", "rpm"])
    if dialect.units == "types":
        lines.append([*["float64"] * n_times, "float32", "float32"])
    for step, speed, rpm in zip(steps, speeds, rpms, strict=True):
        stamp = stamps[dialect.stamp](dialect.first + dt.timedelta(seconds=float(step)))
        if dialect.stamp in ("seconds", "three columns"):
            stamp = stamp.replace(".", mark)
        whole = f"{rpm:,}".replace(",", group) if dialect.thousands else str(rpm)
        cells = [*stamp.split("\0"), f"{speed:.4f}".replace(".", mark) + dialect.unit, whole]
        lines.append(cells)
    if dialect.quotes:
        lines = [[f'"{cell}"' for cell in line] for line in lines]
    text = "".join(dialect.separator.join(line) + dialect.end for line in lines)
    return ("\ufeff" if dialect.bom else "") + preamble + text


def is_possible(dialect):
    """Whether a table can be read at all: its separator is not within its cells."""
    has_comma = dialect.comma or dialect.thousands
    return dialect.quotes or dialect.separator != "," or not has_comma


def dialects(stamps):
    return st.builds(
        Dialect,
        separator=st.sampled_from(",;\t|"),
        comma=st.booleans(),
        thousands=st.booleans(),
        unit=st.sampled_from(["", " m/s", "m/s"]),
        units=st.sampled_from(["", "units", "types"]),
        stamp=st.sampled_from(list(stamps)),
        end=st.sampled_from(["\n", "\r\n"]),
        quotes=st.booleans(),
        bom=st.booleans(),
        first=st.sampled_from([FIRST, FIRST.replace(hour=23)]),
    ).filter(is_possible)


STEPS = st.lists(st.integers(1, 9), min_size=11, max_size=40)
SPEED = st.integers(-30_000, 30_000)
RPM = st.integers(-2500, 2500)


@st.composite
def tables(draw):
    steps = np.cumsum([0, *draw(STEPS)]) / 10
    n_rows = len(steps)
    speeds = draw(st.lists(SPEED, min_size=n_rows, max_size=n_rows))
    rpms = draw(st.lists(RPM, min_size=n_rows, max_size=n_rows))
    return steps, np.array(speeds) / 1e4, np.array(rpms)


def time_column(dialect):
    name = "time" if dialect.stamp == "three columns" else "Time"
    return Column(name, SCALES.get(dialect.stamp, 1.0))


def from_file(content, dialect):
    table = text_table(content, "log.csv")
    assert not table.refusals
    column = time_column(dialect)
    time = column.scale * table.columns[column.name]
    return time - time[0], table.columns["u"], table.columns["n"]


def from_stream(content, dialect):
    columns = {channel: Column(name) for channel, name in NAMES.items()}
    vehicle = VehicleFile(VEHICLE.vehicle, columns, time_column(dialect))
    errors = io.StringIO()
    clock = None
    read = []
    for _, row in rows(io.BytesIO(content), vehicle, errors):
        clock = clock or StreamClock(vehicle.time, row)
        values = [reading_of(row, column) for column in columns.values()]
        read.append([clock.seconds(row), *values])
    assert not errors.getvalue()
    time, speeds, rpms = np.array(read, float).T
    return time - time[0], speeds, rpms


def assert_is(read, table):
    steps, speeds, rpms = table
    np.testing.assert_allclose(read[0], steps, atol=1e-5)
    np.testing.assert_array_equal(read[1], speeds)
    np.testing.assert_array_equal(read[2], rpms)


@settings(max_examples=120, derandomize=True, deadline=None)
@given(
    dialect=dialects(STAMPS | OF_WHOLE_COLUMNS),
    table=tables(),
    n_before=st.sampled_from([0, 2, 300]),
    encoding=st.sampled_from(["utf-8", "utf-16", "latin-1"]),
)
def test_a_file_reads_back(dialect, table, n_before, encoding):
    if dialect.stamp == "whole seconds":
        table = (np.arange(len(table[0])), *table[1:])
    lines = (f"Größe {k} = a{k}" for k in range(n_before))
    preamble = "".join(line + dialect.end for line in lines)
    if encoding == "latin-1":
        dialect = dialect._replace(bom=False)
    text = written(dialect, *table, STAMPS | OF_WHOLE_COLUMNS, preamble)
    assert_is(from_file(text.encode(encoding), dialect), table)


@settings(max_examples=120, derandomize=True, deadline=None)
@given(dialect=dialects(STAMPS), table=tables())
def test_a_stream_and_a_file_agree_on_every_sample(dialect, table):
    content = written(dialect, *table, STAMPS).encode()
    assert_is(from_stream(content, dialect), table)
    assert_is(from_file(content, dialect), table)


@pytest.mark.parametrize("stamp", OF_WHOLE_COLUMNS)
def test_a_stream_refuses_stamps_that_need_the_whole_column(stamp):
    dialect = Dialect(",", False, False, "", "", stamp, "\n", False, False, FIRST.replace(hour=10))
    steps = np.arange(20)
    content = written(dialect, steps, np.full(20, 0.4), np.full(20, 350), OF_WHOLE_COLUMNS)
    with pytest.raises(
        InputError, match=r"column 'Time': got .* allowed is stamps with one meaning"
    ):
        from_stream(content.encode(), dialect)


@pytest.mark.parametrize("hour", [9, 10])
def test_a_stream_refuses_digits_that_turn_as_a_clock_does(hour):
    content = "HHMMSS,u,n\n" + "".join(
        f"{moment:%-H%M%S}.0,0.4,350\n"
        for moment in (FIRST.replace(hour=hour) + dt.timedelta(seconds=k) for k in range(40))
    )
    columns = {channel: Column(name) for channel, name in NAMES.items()}
    vehicle = VehicleFile(VEHICLE.vehicle, columns, Column("HHMMSS"))
    clock = StreamClock(vehicle.time, ["HHMMSS", "u", "n"])
    with pytest.raises(InputError, match="seconds, or hours, minutes and seconds"):
        for _, row in rows(io.BytesIO(content.encode()), vehicle, io.StringIO()):
            clock.seconds(row)


def test_a_stream_of_seconds_goes_on_after_a_hundred():
    clock = StreamClock(Column("Time"), ["Time", "u"])
    stamps = np.arange(95.0, 205.0, 0.5)
    read = [clock.seconds({"Time": f"{stamp:.1f}", "u": "0.4"}) for stamp in stamps]
    np.testing.assert_array_equal(read, stamps)


REFUSED = {
    "UTF-16": ("Time,u,n\n0.0,0.4,350\n".encode("utf-16"), "text in UTF-16"),
    "a preamble": (b"Otter\nTime,u,n\n0.0,0.4,350\n", "the header as first line"),
}


@pytest.mark.parametrize(("content", "words"), REFUSED.values(), ids=REFUSED)
def test_what_a_stream_cannot_read_is_refused_in_one_line(content, words):
    dialect = Dialect(",", False, False, "", "", "seconds", "\n", False, False, FIRST)
    with pytest.raises(InputError, match=words) as caught:
        from_stream(content, dialect)
    assert "\n" not in str(caught.value)


def test_in_a_stream_a_number_is_missing_until_a_line_shows_the_decimal_mark():
    content = b"Time;u;n\n0;1.017;990\n1;0,5;1.017\n2;1.017;1.018\n"
    columns = {channel: Column(name) for channel, name in NAMES.items()}
    vehicle = VehicleFile(VEHICLE.vehicle, columns, Column("Time"))
    lines = [row for _, row in rows(io.BytesIO(content), vehicle, io.StringIO())]
    assert lines[0]["u"] == "1.017 (a decimal number or thousands?)"
    read = [[reading_of(row, column) for column in columns.values()] for row in lines]
    np.testing.assert_equal(read, [[np.nan, 990], [0.5, 1017], [1017, 1018]])
