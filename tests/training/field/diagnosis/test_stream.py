import gc
import io
import json
import subprocess
import sys
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS
from auv_fault_env.errors import InputError
from training.field.diagnosis.diagnosis import THRESHOLDS, beliefs
from training.field.diagnosis.stream import follow, lines, printed_resolutions, reading_of
from training.field.diagnosis.stream_notes import Notes
from training.field.logs.cells import LONGEST_LINE
from training.field.vehicle_file import Column, write_vehicle

from ..fleet_logs import NAMES, VEHICLE, csv_lines, episode, log_of

FAULT = "seal_friction:port"
SHORT = 80


def answers(source, vehicle=VEHICLE, name="filter_bank"):
    sink = io.StringIO()
    errors = io.StringIO()
    alarmed = follow(io.BytesIO(source), sink, vehicle, name, THRESHOLDS[name], errors)
    return (
        [json.loads(line) for line in sink.getvalue().splitlines()],
        errors.getvalue().splitlines(),
        alarmed,
    )


def json_lines(observations):
    rows = [
        {"time": 100.0 + 0.1 * k, **dict(zip(NAMES, row, strict=True))}
        for k, row in enumerate(observations.tolist())
    ]
    return "\n".join(map(json.dumps, rows)).encode()


def p_normal(belief):
    return np.exp(belief.log_probability[:, 0].astype(np.float64))


@pytest.fixture(scope="module")
def faulty():
    return answers(csv_lines(episode(FAULT)))


def test_every_line_is_answered_as_the_log_is_diagnosed(faulty):
    rows, errors, alarmed = faulty
    belief = beliefs(log_of(episode(FAULT)), "filter_bank", VEHICLE)
    assert alarmed and not errors
    np.testing.assert_allclose(
        [row["p_normal"] for row in rows], p_normal(belief), rtol=1e-3, atol=1e-30
    )
    np.testing.assert_allclose([row["time"] for row in rows], 100.0 + 0.1 * np.arange(200))


def test_the_alarm_names_class_and_severity(faulty):
    rows, _, _ = faulty
    first = next(k for k, row in enumerate(rows) if row["alarm"])
    assert first > 50
    assert all(row["class"] == "normal" and row["severity"] == 0.0 for row in rows[:first])
    low, high = rows[-1]["severity_95"]
    assert rows[-1]["class"] == FAULT and low <= 0.9 <= high


def test_a_healthy_stream_raises_no_alarm():
    rows, _, alarmed = answers(csv_lines(episode()))
    assert len(rows) == 200 and not alarmed


def test_json_lines_are_read_as_csv_is(faulty):
    assert answers(json_lines(episode(FAULT)[:SHORT]))[0] == faulty[0][:SHORT]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (b"1,2,3", "3 cells below a header of 13"),
        (b"\xff\xfe\x00garbage", "1 cells below a header"),
        (b"noon" + 12 * b",1", "no time in 'time': 'noon'"),
        (b"109.35" + 12 * b",", "no reading in it"),
        (b'"' + b"x" * 2 * LONGEST_LINE, "cells below a header of 13"),
    ],
    ids=["cut", "binary", "time", "empty", "endless"],
)
def test_a_bad_line_is_reported_in_one_line_and_left_out(faulty, line, words):
    good = csv_lines(episode(FAULT)[:SHORT]).splitlines()
    rows, errors, _ = answers(b"\n".join([*good[:40], line, *good[40:]]))
    assert rows == faulty[0][:SHORT]
    assert (
        words in errors[0]
        and errors[0].startswith("line 41: ")
        and errors[0].endswith("; left out")
    )


@pytest.mark.parametrize(
    "line", [b"{", b"[1]", b"17", b'{"time": {}}', b'{"time": 1e999}', b"{" * 5000]
)
def test_a_bad_json_line_is_left_out(line):
    good = json_lines(episode()[:20]).splitlines()
    rows, errors, _ = answers(b"\n".join([*good[:9], line, *good[9:]]))
    assert len(rows) == 20 and len(errors) == 1


def test_units_are_those_of_the_vehicle_file(faulty):
    feet = replace(VEHICLE, columns=dict(VEHICLE.columns) | {"speed": Column("speed", 0.3048)})
    observations = episode(FAULT)[:SHORT].copy()
    observations[:, NAMES.index("speed")] /= 0.3048
    got = [row["p_normal"] for row in answers(csv_lines(observations), feet)[0]]
    np.testing.assert_allclose(got, [row["p_normal"] for row in faulty[0][:SHORT]], rtol=1e-6)


def test_a_reading_may_be_the_product_of_two_cells():
    column = Column("duty", 0.01, -0.5, "supply")
    assert reading_of({"duty": "80", "supply": "12.5"}, column) == pytest.approx(3.75)
    assert np.isnan(reading_of({"duty": "80", "supply": ""}, column))
    product = replace(VEHICLE, columns=dict(VEHICLE.columns) | {"port_voltage": column})
    assert "port_voltage" not in printed_resolutions(
        {"duty": "80", "supply": "12.5", "port_current": "1.0"}, product
    )


def test_slow_lines_are_diagnosed_as_a_log_with_missing_readings():
    slow = replace(VEHICLE, sample_rate=2.0)
    log = np.full((196, len(NAMES)), np.nan)
    log[::5] = episode(FAULT)[:196:5]
    source = csv_lines(episode(FAULT)).splitlines()
    rows, _, _ = answers(b"\n".join([source[0], *source[1::5]]), slow)
    belief = beliefs(log_of(log), "filter_bank", slow)
    np.testing.assert_allclose(
        [row["p_normal"] for row in rows], p_normal(belief)[::5], rtol=1e-3, atol=1e-30
    )


def test_a_gap_begins_anew():
    one = csv_lines(episode(FAULT)[:SHORT])
    later = csv_lines(episode(FAULT)[:SHORT], first=200.0).split(b"\n", 1)[1]
    rows, _, _ = answers(one + later)
    assert [row["p_normal"] for row in rows[:SHORT]] == [row["p_normal"] for row in rows[SHORT:]]


def test_without_a_time_the_rows_are_a_sample_apart():
    rows, _, _ = answers(csv_lines(episode()[:20]), replace(VEHICLE, time=None))
    np.testing.assert_allclose([row["time"] for row in rows], 0.1 * np.arange(20))


@pytest.mark.parametrize(
    "source", [b"", b"\n\n", csv_lines(episode()[:0]), b"time;speed\n", b"{}\n{}\n"]
)
def test_a_stream_without_a_sample_is_refused(source):
    with pytest.raises(InputError):
        answers(source)


def test_a_header_without_a_column_is_refused_with_the_nearest():
    source = csv_lines(episode()[:5]).replace(b"port_current", b"port_curent", 1)
    with pytest.raises(InputError, match="did you mean 'port_curent'"):
        answers(source)


class Broken(io.StringIO):
    """A reader that leaves after three answers."""

    def write(self, text):
        if self.getvalue().count("\n") == 3:
            raise self.reason
        return super().write(text)


@pytest.mark.parametrize("reason", [BrokenPipeError(), KeyboardInterrupt()])
def test_it_ends_without_an_error_when_the_reader_closes_or_at_ctrl_c(reason):
    sink = Broken()
    sink.reason = reason
    assert (
        follow(io.BytesIO(csv_lines(episode()[:20])), sink, VEHICLE, "filter_bank", -10.0) is False
    )
    assert len(sink.getvalue().splitlines()) == 3


def test_a_line_without_end_is_one_line():
    found = list(lines(io.BytesIO(b"x" * (3 * LONGEST_LINE) + b"\nnext\n")))
    assert [(number, len(text)) for number, text in found] == [(1, LONGEST_LINE), (2, 4)]


def with_ends(content, end):
    return b"".join(line + end for line in content.splitlines())


def with_units(content):
    header, rows = content.split(b"\n", 1)
    units = ",".join(["s", *(CHANNELS[name].unit for name in NAMES)])
    return b"\n".join([header, units.encode(), rows])


LAYOUTS = {
    "bars": lambda content: content.replace(b",", b"|"),
    "blanks": lambda content: content.replace(b",", b"  "),
    "comment mark before the header": lambda content: b"# " + content,
    "separator at the end": lambda content: with_ends(content, b",\n"),
    "separator at the end of rows": lambda content: with_ends(content, b",\n").replace(
        b",\n", b"\n", 1
    ),
    "line ends of Windows": lambda content: with_ends(content, b"\r\n"),
    "row of units": with_units,
    "quotation marks": lambda content: b"\n".join(
        b'"' + line.replace(b",", b'","') + b'"' for line in content.splitlines()
    ),
    "stray quotation mark": lambda content: content.replace(b"100.0,", b'"100.0,'),
}


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_a_stream_is_read_in_the_layouts_of_files(faulty, layout):
    rows, errors, _ = answers(layout(csv_lines(episode(FAULT)[:SHORT])))
    assert rows == faulty[0][:SHORT] and not errors


def test_time_stamps_and_words_are_read_as_in_files():
    lines = csv_lines(episode()[:30]).splitlines()
    stamped = [lines[0]]
    for k, line in enumerate(lines[1:]):
        stamped.append(b"12:00:%04.1f," % (0.1 * k) + line.split(b",", 1)[1])
    rows, errors, _ = answers(b"\n".join(stamped))
    assert not errors
    np.testing.assert_allclose([row["time"] for row in rows], 43200.0 + 0.1 * np.arange(30))


def test_decimal_commas_are_read_where_another_separator_stands(faulty):
    german = csv_lines(episode(FAULT)[:SHORT]).replace(b",", b";").replace(b".", b",")
    rows, errors, _ = answers(german)
    assert rows == faulty[0][:SHORT] and not errors


@pytest.mark.parametrize(("cell", "words"), [(b"1e155", "'1e155' is beyond"), (b"abc", "'abc'")])
def test_an_impossible_cell_is_reported_and_taken_as_missing(cell, words):
    good = csv_lines(episode()[:SHORT]).splitlines()
    place = good[0].split(b",").index(NAMES[4].encode())
    bad = list(good)
    empty = list(good)
    for row, value in ((bad, cell), (empty, b"")):
        cells = row[30].split(b",")
        cells[place] = value
        row[30] = b",".join(cells)
    (rows, errors, _), (blank, silent, _) = (answers(b"\n".join(lines)) for lines in (bad, empty))
    assert rows == blank and not silent
    assert len(errors) == 1 and words in errors[0] and "taken as missing" in errors[0]


def test_a_unit_that_is_wrong_in_every_line_is_said_once():
    run = episode()[:SHORT].copy()
    run[:, NAMES.index("port_voltage")] += 24.0
    run[:, NAMES.index("port_voltage")] *= 1000.0
    rows, errors, _ = answers(csv_lines(run))
    assert len(rows) == SHORT and len(errors) == 2
    assert errors[0].startswith("line 2: port_voltage: '2")
    assert errors[0].endswith(" V; is its unit right?; taken as missing")
    assert errors[1].startswith("port_voltage beyond ")
    assert errors[1].endswith(f": in {SHORT - 1} more lines, the last of them {SHORT + 1}")


def test_lines_that_are_left_out_for_one_reason_are_said_once_and_another_reason_is_said():
    good = csv_lines(episode()[:5]).splitlines()
    bad = [*(b"noon %d" % k + 12 * b",1" for k in range(10)), b"1,2", b"1,2"]
    _, errors, _ = answers(b"\n".join([*good, *bad]))
    assert errors == [
        "line 7: no time in 'time': 'noon 0'; left out",
        "line 17: 2 cells below a header of 13; left out",
        "no time in 'time': in 9 more lines, the last of them 16",
        "2 cells below a header of 13: in one more line, the last of them 18",
    ]


def test_a_kind_of_note_is_said_again_after_lines_without_it():
    errors = io.StringIO()
    notes = Notes(errors)
    for line_number in (1, 2, 90, 191, 192, 193):
        notes.add(line_number, "kind", "text")
    assert errors.getvalue().splitlines() == ["line 1: text", "line 191: text"]


def test_the_last_line_of_a_kind_that_was_not_said_is_none_that_was():
    errors = io.StringIO()
    notes = Notes(errors)
    for line_number in (1, 2, 191):
        notes.add(line_number, "kind", "text")
    notes.close()
    assert errors.getvalue().endswith("kind: in one more line, the last of them 2\n")


def test_a_line_without_a_reading_is_left_out():
    good = csv_lines(episode()[:3]).splitlines()
    row = [b"" if k > 4 else cell for k, cell in enumerate(good[2].split(b","))]
    rows, errors, _ = answers(b"\n".join([*good[:2], b",".join(row), good[3]]))
    assert len(rows) == 2 and errors == ["line 3: no reading in it; left out"]


class Endless:
    """So many lines, made one at a time."""

    def __init__(self, count):
        self.header, *self.rows = csv_lines(episode()).splitlines(keepends=True)
        self.count = count
        self.sent = -1

    def readline(self, limit):
        self.sent += 1
        if self.sent == 0:
            return self.header
        row = self.rows[self.sent % len(self.rows)].split(b",", 1)[1]
        return b"" if self.sent > self.count else b"%.1f," % (0.1 * self.sent) + row


class Counting(io.StringIO):
    """Counts the lines, keeps none, and notes the memory in use after some of them."""

    def __init__(self, *marks):
        super().__init__()
        self.lines = 0
        self.marks = marks
        self.used = []

    def write(self, text):
        self.lines += text.count("\n")
        if "\n" in text and self.lines in self.marks:
            gc.collect()
            self.used.append(tracemalloc.get_traced_memory()[0])
        return len(text)


def test_memory_does_not_grow_with_the_stream():
    sink = Counting(1000, 4000)
    tracemalloc.start()
    follow(Endless(4000), sink, VEHICLE, "filter_bank", THRESHOLDS["filter_bank"])
    tracemalloc.stop()
    assert sink.lines == 4000
    # bytes; an array of each line kept would be 600,000
    assert sink.used[1] - sink.used[0] < 300_000


def test_the_command_follows_a_pipe_until_the_reader_closes_it(tmp_path):
    write_vehicle(tmp_path / "v.toml", VEHICLE)
    command = [
        sys.executable,
        "-m",
        "training.cli",
        "diagnose",
        "--vehicle",
        str(tmp_path / "v.toml"),
        "--follow",
    ]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        header, *rows = csv_lines(episode()).splitlines(keepends=True)
        process.stdin.write(header + rows[0])
        process.stdin.flush()
        # answered while the stream is open
        assert json.loads(process.stdout.readline())["time"] == 100.0
        process.stdout.close()
        try:
            process.stdin.write(b"".join(rows[1:]))
            process.stdin.close()
        except BrokenPipeError:
            pass
        errors = process.stderr.read()
        process.stdin = None
        assert process.wait(30) == 0
    assert errors == b""
