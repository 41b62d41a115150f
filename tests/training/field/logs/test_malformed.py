"""Logs as bad as they come: each is refused in one line, or read with a remark for each repair."""

import gzip
import os
import random
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from auv_fault_env import CHANNELS, PRESETS
from auv_fault_env.channels import INDEX
from auv_fault_env.errors import InputError
from training.field.logs.files import read_table
from training.field.logs.log import Log, read_log
from training.field.proposal.proposal import propose
from training.field.vehicle_file import Column, VehicleFile

NAMES = ["t", "u", "V", "I", "n"]
CHANNEL = dict(zip(["speed", "port_voltage", "port_current", "port_rpm"], NAMES[1:], strict=True))
VEHICLE = VehicleFile(
    replace(PRESETS["thesis1992"], shafts=1),
    {channel: Column(name) for channel, name in CHANNEL.items()},
    Column("t"),
)
# 20 s of the thesis' vehicle at 0.4 m/s
ROWS = [
    [
        f"{k / 10:.1f}",
        f"{0.4 + k % 7 / 1000:.3f}",
        f"2.{60 + k % 5}",
        f"0.{34 + k % 3}",
        f"{350 + k % 9}.0",
    ]
    for k in range(200)
]


def text(rows=ROWS, names=NAMES, mark=",", end="\n"):
    return end.join(mark.join(row) for row in [names, *rows]) + end


def changed(column, cell, rows=slice(None)):
    """The table with a column's cells replaced in some rows; `cell` is a text or a function of the
    number.
    """
    k = NAMES.index(column)
    new = [list(row) for row in ROWS]
    for number in range(200)[rows]:
        new[number][k] = cell(float(new[number][k])) if callable(cell) else cell
    return text(new)


def scaled(column, factor, rows=slice(None)):
    return changed(column, lambda value: f"{value * factor:.6g}", rows)


def reordered(order):
    return text([ROWS[k] for k in order])


REPAIRED = {
    "semicolons": (text(mark=";"), ["cells: separated by semicolons"]),
    "tabs": (text(mark="\t"), ["cells: separated by tabs"]),
    "blanks": (text(mark="   "), ["cells: separated by blanks"]),
    "decimal comma": (
        text(mark=";").replace(".", ","),
        ["cells: separated by semicolons", "read with decimal commas"],
    ),
    "decimal comma in quotes": (
        text([['"' + cell.replace(".", ",") + '"' for cell in row] for row in ROWS]),
        ["numbers: read with decimal commas"],
    ),
    "UTF-16": (text().encode("utf-16"), ["encoding: read as UTF-16"]),
    "UTF-16 without a mark": (text().encode("utf-16-le"), ["encoding: read as UTF-16-LE"]),
    "Latin-1": (text().encode() + b"# \xfcber\n", ["LATIN-1", "such as '# über'"]),
    "gzip broken off": (gzip.compress(text().encode())[:-300], ["gzip: breaks off; the"]),
    "preamble": ("Otter\nmission 12\n" + text(), ["header: lines before it left out (2)"]),
    "units below the header": (
        text([["s", "m/s", "V", "A", "rpm"], *ROWS]),
        ["units: read from the row under"],
    ),
    "a name twice": (
        text([[*row, "0"] for row in ROWS], [*NAMES, "I"]),
        ["'I' occurs more than once", "'I (2)'"],
    ),
    "last row cut": (text()[:-9], ["rows: those without 5 cells, such as"]),
    "comments between": (
        text().replace("\n5.0,", "\n# turn\n5.0,"),
        ["such as '# turn', left out (1)"],
    ),
    "header again": (
        text() + text().replace("\n", "\n2", 1),
        ["t: cells without a number, such as 't'"],
    ),
    "stray quotation mark": (
        text().replace("0.402", '"0.402', 1),
        ["stray quotation marks removed (1)"],
    ),
    "zeros at the end": (text() + "\0" * 512, ["end: zero bytes left out", "(512)"]),
    "run of NaN": (changed("n", "nan", slice(50, 150)), ["port_rpm: missing in 100 of 200 rows"]),
    "run of nothing": (changed("n", "", slice(50, 150)), ["port_rpm: missing in 100 of 200 rows"]),
    "infinite": (
        changed("u", "inf", slice(10, 12)),
        ["speed: infinite values taken as missing (2)"],
    ),
    "beyond any number": (
        changed("u", "1e999", slice(10, 12)),
        ["speed: infinite values taken as missing (2)"],
    ),
    "words for numbers": (
        changed("u", "ERR", slice(10, 12)),
        ["u: cells without a number, such as 'ERR'", "(2)"],
    ),
    "never read": (changed("V", "-"), ["port_voltage: never read"]),
    "constant": (changed("u", "0.4"), ["speed: constant at 0.4 m/s throughout"]),
    "number for missing": (
        changed("u", "-9999", slice(0, 80)),
        ["such as -9999 m/s, taken as missing (80)"],
    ),
    "single wild value": (
        changed("n", "1e7", slice(7, 8)),
        ["such as 1e+07 rpm, taken as missing (1)"],
    ),
    "beyond full scale": (
        changed("u", "6", slice(7, 9)),
        ["speed: values beyond 5 m/s, up to 6, kept (2)"],
    ),
    "rev/s for rpm": (scaled("n", 1 / 60), ["speed is 6", "as if with shaft speed in rev/s"]),
    "stamps twice": (
        reordered(np.repeat(range(200), 2)),
        ["rows with the stamp of a later row left out (200)"],
    ),
    "one row out of order": (
        reordered([*range(50), 51, 50, *range(52, 200)]),
        ["rows out of order sorted in (1)"],
    ),
    "backwards": (reordered(range(199, -1, -1)), ["the rows are in no order; sorted"]),
    "clock set back": (
        text([*ROWS, *ROWS]),
        ["time: the clock is set back and a new segment begins (1)"],
    ),
    "clock set to the date": (
        changed("t", lambda value: f"{value + 1.8e9:.1f}", slice(100, 200)),
        ["time: the clock jumps by more than a day"],
    ),
    "one wild stamp": (
        changed("t", "4e6", slice(77, 78)),
        ["a stamp far from those around it left out (1)"],
    ),
    "stamps missing": (
        changed("t", "", slice(77, 80)),
        ["time: rows without a stamp left out (3)"],
    ),
    "clock of whole seconds": (
        changed("t", lambda value: f"{int(value)}"),
        ["the clock ticks every 1 s only"],
    ),
    "gap": (
        changed("t", lambda value: f"{value + 60:.1f}", slice(100, 200)),
        ["gaps of more than 5 s, after which a new segment begins (1)"],
    ),
    "stretch too short": (
        text([*ROWS[:150], ["99", *ROWS[0][1:]]]),
        ["segments shorter than 10 s left out (1)"],
    ),
    "slower than it should be": (
        changed("t", lambda value: f"{2 * value}"),
        ["rows are 0.2 s apart, not 0.1 s"],
    ),
    "faster than it should be": (
        text([[f"{k / 50}", *ROWS[k % 200][1:]] for k in range(600)]),
        ["rows are 0.02 s apart, not 0.1 s", "the nearest to each 0.1 s is kept"],
    ),
}
AS_IT_IS = {
    "CRLF": text(end="\r\n"),
    "CR": text(end="\r"),
    "byte order mark": "\ufeff" + text(),
    "header behind a hash": "# " + text(),
    "gzip": gzip.compress(text().encode()),
    "index": text([[str(k), *row] for k, row in enumerate(ROWS)], ["", *NAMES]),
    "empty last column": text(end=",\n"),
    "text beside": text([[*row, "auto"] for row in ROWS], [*NAMES, "mode"]),
    "ISO time stamps": changed("t", lambda value: f"2026-03-01T12:00:{value:06.3f}Z"),
}
REFUSED = {
    "empty": (b"", "the file is empty"),
    "blank": ("\n \n\n", "the file is empty"),
    "empty gzip": (gzip.compress(b""), "the file is empty"),
    "zeros": (b"\0" * 1000, "the file is empty"),
    "header only": (text(rows=[]), "a header with rows of numbers below"),
    "one row": (text(ROWS[:1]), "at least 10 s without a break"),
    "rows only": (text().split("\n", 1)[1], "a header of 0 names above rows of 5 cells"),
    "text only": ("a,b\nred,green\n" * 20, "a header with rows of numbers below"),
    "prose": (
        "To be or not to be, that is the question.\n" * 20,
        "a header with rows of numbers below",
    ),
    "binary": (
        random.Random(1).randbytes(5000),
        "a table as text, Parquet, MCAP or a rosbag2 folder",
    ),
    "picture": (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + bytes(range(256)), "a table as text"),
    "zeros within": (text().replace("\n5.0,", "\n\0\0\0\0\n5.0,"), "a table as text"),
    "broken Parquet": (b"PAR1" + b"x" * 100, "a whole Parquet file"),
    "gzip of noise": (b"\x1f\x8b" + b"\xff" * 100, "the file is empty"),
    "decimal comma between commas": (
        text().replace(".", ","),
        "a header of 5 names above rows of 10 cells",
    ),
    "wrong separator": (text(mark=":"), "a header with rows of numbers below"),
    "one line of everything": (text(end=","), "a header"),
    "line of a million": ("t,u\n" + "1" * 1_000_000, "lines of at most 100000 characters"),
    "thousands of columns": (text([["1"] * 9000] * 3, ["x"] * 9000), "at most 4096"),
    "column missing": (
        text([row[:4] for row in ROWS], NAMES[:4]),
        "column of port_rpm: got 'n'; allowed is one of t, u",
    ),
    "column misnamed": (text(names=["t", "u", "V", "I", "n1"]), "did you mean 'n1'"),
    "no stamp": (changed("t", "nan"), "time: got 'no stamp'"),
    "too short": (text(ROWS[:50]), "log.csv: 5 s'; allowed is at least 10 s without a break"),
    "time in milliseconds": (scaled("t", 1000), "correct the unit (ms?) or sample_rate"),
    "millivolt for volt": (
        scaled("V", 1000),
        r"correct unit or scale of [channels.port_voltage] (mV?)",
    ),
    "millimetres per second": (scaled("u", 1000), "[channels.speed], or [parameters]"),
    "nothing read": (text([[row[0], "", "-", "nan", "inf"] for row in ROWS]), "no reading"),
    "no number at all": (
        text([["", "", "", "", "NaN"] for row in ROWS]),
        "at least one column of numbers",
    ),
}


@pytest.fixture(scope="module")
def path(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("logs") / "log.csv"


def read(path, content) -> Log:
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_log(path, VEHICLE)


def assert_sound(log: Log) -> None:
    """A log is a grid within its segments, which follow on each other, and names each repair in one
    line.
    """
    assert log.observation.shape == (len(log.time), len(CHANNELS))
    assert [part.start for part in log.segments] == [0, *(part.stop for part in log.segments[:-1])]
    assert log.segments[-1].stop == len(log.time)
    assert not np.isinf(log.observation).any()
    for part in log.segments:
        np.testing.assert_allclose(np.diff(log.time[part]), 0.1, atol=1e-6)
        assert len(log.time[part]) >= 99
    assert all(line and "\n" not in line for line in log.remarks)


@pytest.mark.parametrize(("content", "words"), REPAIRED.values(), ids=REPAIRED)
def test_repairs_are_reported(path, content, words):
    log = read(path, content)
    assert_sound(log)
    for word in words:
        assert any(word in line for line in log.remarks), log.remarks
    values = log.observation[:, INDEX["speed"]]
    assert np.nanmedian(values) == pytest.approx(0.4, abs=0.01)


@pytest.mark.parametrize("content", AS_IT_IS.values(), ids=AS_IT_IS)
def test_variants_are_read_without_a_remark(path, content):
    log = read(path, content)
    assert log.remarks == ()
    np.testing.assert_array_equal(log.observation, read(path, text()).observation)


@pytest.mark.parametrize(("content", "words"), REFUSED.values(), ids=REFUSED)
def test_refused_in_one_line(path, content, words):
    with pytest.raises(InputError) as caught:
        read(path, content)
    assert "\n" not in str(caught.value)
    assert words in str(caught.value)


@pytest.mark.parametrize("name", ["nowhere.csv", ".", "pipe", "name\0.csv"])
def test_a_path_without_a_file_is_refused(tmp_path, name):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match=r"log: got '.*'; allowed is a (readable )?file"):
        read_log(tmp_path / name, VEHICLE)


def refused_or_sound(path: Path, content: bytes) -> None:
    """Reading the log, and proposing a vehicle file from it, end well or in one line."""
    try:
        assert_sound(read(path, content))
        propose(read_table(path), "otter")
    except InputError as error:
        assert "\n" not in str(error)


@settings(max_examples=100, derandomize=True, deadline=None)
@given(
    before=st.sampled_from([b"", b"\x1f\x8b", b"\xff\xfe", b"PAR1", text().encode()[:3000]]),
    content=st.binary(max_size=300),
)
def test_no_bytes_end_in_a_traceback(path, before, content):
    refused_or_sound(path, before + content)


CELLS = st.sampled_from(
    [
        "",
        "nan",
        "inf",
        "-inf",
        "1e308",
        "-1e308",
        "1e999",
        "0",
        "-1",
        "1,5",
        '"',
        "x",
        "a,b",
        "\n",
        "\0",
        "#",
        "ü",
        "12:00",
    ]
) | st.floats().map(repr)
ROW = st.integers(0, 120)
CHANGES = st.one_of(
    st.tuples(st.just("cell"), ROW, st.integers(0, 4), CELLS),
    st.tuples(st.just("column"), ROW, st.integers(0, 4), CELLS),
    st.tuples(st.just("drop"), ROW, ROW),
    st.tuples(st.just("repeat"), ROW, ROW),
    st.tuples(st.just("turn"), ROW, ROW),
    st.tuples(st.just("cut"), st.integers(0, 3500)),
    st.tuples(st.just("replace"), st.sampled_from(",.\n0"), st.sampled_from(";, \t|\r")),
)


def mutated(content: str, change: tuple) -> str:
    lines = content.split("\n")
    match change:
        case "cell" | "column" as kind, row, column, cell:
            for k in range(row, len(lines) if kind == "column" else min(row + 1, len(lines))):
                cells = lines[k].split(",")
                cells[column % len(cells)] = cell
                lines[k] = ",".join(cells)
        case "drop", first, last:
            lines[first:last] = []
        case "repeat", first, last:
            lines[last:last] = lines[first:last]
        case "turn", first, last:
            lines[first:last] = lines[first:last][::-1]
        case "cut", end:
            return content[:end]
        case "replace", old, new:
            return content.replace(old, new)
    return "\n".join(lines)


@settings(max_examples=150, derandomize=True, deadline=None)
@given(changes=st.lists(CHANGES, max_size=6))
def test_no_mutated_log_ends_in_a_traceback(path, changes):
    content = text(ROWS[:120])
    for change in changes:
        content = mutated(content, change)
    refused_or_sound(path, content.encode())
