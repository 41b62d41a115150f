"""Time stamps in the notations of loggers, spreadsheets and libraries."""

import datetime as dt

import numpy as np
import pytest

from auv_fault_env.errors import InputError
from training.field.logs.log import read_log
from training.field.logs.text_table import text_table
from training.field.vehicle_file import Column, VehicleFile

from ..fleet_logs import VEHICLE

FIRST = dt.datetime(2024, 5, 1, 9, 59, 59, 500_000)
HALF_SECONDS = np.arange(6) / 2


def table_of(stamps, name="Time", separator=";"):
    rows = (f"{stamp}{separator}{k}" for k, stamp in enumerate(stamps))
    return text_table("\n".join([f"{name}{separator}u", *rows]).encode(), "log.csv")


def elapsed(stamps, name="Time"):
    table = table_of(stamps, name)
    assert not table.refusals
    return table.columns[name] - table.columns[name][0]


def moments(first=FIRST, n=6, step=0.5):
    return [first + dt.timedelta(seconds=k * step) for k in range(n)]


def tenths(moment):
    return moment.microsecond // 100_000


NOTATIONS = {
    "ISO": lambda m: m.isoformat(" "),
    "ISO with Z": lambda m: m.isoformat() + "Z",
    "ISO in a zone": lambda m: m.isoformat() + "+05:30",
    "zone without colon": lambda m: m.isoformat() + "-0300",
    "zone by its letters": lambda m: f"{m:%Y-%m-%d %H:%M:%S}.{tenths(m)} CEST",
    "ISO basic": lambda m: f"{m:%Y%m%dT%H%M%S}.{tenths(m)}Z",
    "digits": lambda m: f"{m:%Y%m%d%H%M%S}.{tenths(m)}",
    "slashes": lambda m: f"{m:%Y/%m/%d %H:%M:%S}.{tenths(m)}",
    "German": lambda m: f"{m:%d.%m.%Y %H:%M:%S},{tenths(m)}",
    "German, short": lambda m: f"{m:%d.%m.%y %H.%M.%S},{tenths(m)}",
    "milliseconds behind a colon": lambda m: f"{m:%Y-%m-%d %H:%M:%S}:{m.microsecond // 1000:03}",
    "AM and PM": lambda m: f"{m:%m/%d/%Y %I:%M:%S}.{tenths(m)} {m:%p}",
    "MATLAB": lambda m: f"{m:%d-%b-%Y %H:%M:%S}.{tenths(m)}",
    "month in words": lambda m: f"{m:%b %d, %Y %I:%M:%S}.{tenths(m)} {m:%p}",
    "of C": lambda m: f"{m:%a %b %d %H:%M:%S}.{tenths(m)} {m:%Y}",
    "of a browser": lambda m: f"{m:%a %b %d %Y %H:%M:%S}.{tenths(m)} GMT+0200 (CEST)",
    "day of the year": lambda m: f"{m:%Y-%jT%H:%M:%S}.{tenths(m)}",
    "clock": lambda m: f"{m:%H:%M:%S}.{tenths(m)}",
    "clock with one digit": lambda m: f"{m.hour}:{m:%M:%S}.{tenths(m)}",
    "clock of twelve hours": lambda m: f"{m:%I:%M:%S}.{tenths(m)} {m:%p}",
    "minutes and seconds": lambda m: f"{m:%M:%S}.{tenths(m)}",
    "NMEA": lambda m: f"{m:%H%M%S}.{tenths(m)}",
}
MOMENTS = {
    "an hour": FIRST,
    "noon": dt.datetime(2024, 5, 1, 11, 59, 59, 500_000),
    "midnight": dt.datetime(2024, 5, 31, 23, 59, 58, 500_000),
    "a year": dt.datetime(2023, 12, 31, 23, 59, 59),
}


@pytest.mark.parametrize("first", MOMENTS.values(), ids=MOMENTS)
@pytest.mark.parametrize("written", NOTATIONS.values(), ids=NOTATIONS)
def test_time_goes_on_in_every_notation(written, first):
    np.testing.assert_allclose(elapsed(map(written, moments(first))), HALF_SECONDS, atol=1e-5)


PASSED = {
    "pandas": "0 days 00:00:{:09.6f}",
    "pandas, before zero": "-1 days +23:59:{:09.6f}",
    "Python": "1 day, 0:00:{:09.6f}",
    "ISO": "PT1M{:.1f}S",
    "letters": "1m{:.1f}s",
    "hours beyond a day": "30:00:{:04.1f}",
    "minutes beyond an hour": "75:{:04.1f}",
    "points": "1.00:00:{:04.1f}",
}


@pytest.mark.parametrize("form", PASSED.values(), ids=PASSED)
def test_time_that_has_passed(form):
    np.testing.assert_allclose(elapsed(map(form.format, HALF_SECONDS)), HALF_SECONDS, atol=1e-6)


def test_seconds_of_letters_go_on_in_minutes():
    np.testing.assert_allclose(elapsed(["59.5s", "1m0s", "1m0.5s"]), [0, 0.5, 1])


@pytest.mark.parametrize(
    ("stamps", "seconds"),
    [
        (["13/05/2024 10:00:00", "13/05/2024 10:00:01"], 1715594400),
        (["05/13/2024 10:00:00", "05/13/2024 10:00:01"], 1715594400),
        (["31/12/23 23:59:59", "01/01/24 00:00:00"], 1704067199),
        (["05/31/2024 23:59:59", "06/01/2024 00:00:00"], 1717199999),
    ],
)
def test_day_and_month_are_decided_by_the_whole_column(stamps, seconds):
    table = table_of(stamps)
    np.testing.assert_allclose(table.columns["Time"], [seconds, seconds + 1])


def test_the_day_of_the_week_of_a_midnight_decides():
    table = table_of(["05/06/2024 23:59:59", "06/06/2024 00:00:00"])
    assert np.diff(table.columns["Time"]) == [1]
    assert "day first" in table.remarks[-1]


def test_of_one_date_day_and_month_do_not_matter_and_this_is_remarked():
    table = table_of(["05/06/2024 10:00:00", "05/06/2024 10:00:01"])
    assert np.diff(table.columns["Time"]) == [1] and not table.refusals
    assert "may be day first or month first" in table.remarks[-1]


AMBIGUOUS = {
    "days apart": (["05/06/2024 10:00:00", "08/07/2024 10:00:00"], "day first, or month first"),
    "many rows a minute": (["10:01"] * 60 + ["10:02"] * 60, "hours and minutes"),
}


@pytest.mark.parametrize(("stamps", "words"), AMBIGUOUS.values(), ids=AMBIGUOUS)
def test_stamps_with_two_meanings_are_refused_by_name(stamps, words):
    table = table_of(stamps)
    message = str(table.refusals["Time"])
    assert message.startswith(f"column 'Time': got {stamps[0]!r}") and words in message
    assert np.isnan(table.columns["Time"]).all()


def test_the_header_decides():
    stamps = ["10:01"] * 60 + ["10:02"] * 60
    assert np.ptp(elapsed(stamps, "Time [hh:mm]")) == 60
    assert np.ptp(elapsed(stamps, "Time (mm:ss)")) == 1
    apart = ["05/06/2024 10:00:00", "05/07/2024 10:00:00"]
    assert np.ptp(elapsed(apart, "Date (dd/mm/yyyy)")) == 30 * 86_400
    assert np.ptp(elapsed(apart, "Date (mm/dd/yyyy)")) == 86_400


def test_minutes_and_seconds_without_a_fraction_are_read_and_remarked():
    table = table_of([f"{k // 60:02}:{k % 60:02}" for k in range(600)])
    np.testing.assert_array_equal(table.columns["Time"], np.arange(600))
    assert table.remarks[-1] == "Time: read as minutes and seconds"


@pytest.mark.parametrize(
    "stamps",
    [
        ["2024-03-31 01:59:59.9", "2024-03-31 03:00:00.0", "2024-03-31 03:00:00.1"],
        ["2024-10-27 02:59:59.9", "2024-10-27 02:00:00.0", "2024-10-27 02:00:00.1"],
    ],
)
def test_summer_time_does_not_set_the_time(stamps):
    before = [stamps[0][:-1] + str(k) for k in range(9)]
    np.testing.assert_allclose(np.diff(elapsed([*before, *stamps])), 0.1, atol=1e-5)


def test_one_zone_that_is_not_known_does_not_matter():
    table = table_of(["10:00:00 AEST", "10:00:01 AEST"])
    np.testing.assert_array_equal(table.columns["Time"], [36_000, 36_001])
    assert "Time: zone 'AEST' taken for universal time" in table.remarks
    assert "Time" in table_of(["10:00:00 AEST", "10:00:01 AEDT"]).refusals


def test_summer_time_of_a_clock_of_whole_seconds():
    stamps = [f"2024-03-31 01:59:{50 + k // 10}" for k in range(100)]
    stamps += [f"2024-03-31 03:00:0{k // 10}" for k in range(100)]
    np.testing.assert_array_equal(elapsed(stamps), np.arange(200) // 10)


def test_impossible_stamps_are_refused_by_name():
    for stamps in (["10:75", "10:76"], ["10:61:00"] * 2, ["2024-02-30 10:00:00"] * 2):
        assert "2 of 2 cells are none" in str(table_of(stamps).refusals["Time"])


def test_an_hour_without_rows_is_no_summer_time():
    stamps = [f"2024-05-01 01:59:59.{k}" for k in range(10)] + ["2024-05-01 03:00:00.0"]
    assert elapsed(stamps)[-1] == pytest.approx(3601, abs=0.1)


def test_digits_are_a_date_only_where_the_name_says_so_and_all_are_one():
    table = table_of(["20240501100059", "20240501100100"], "pressure")
    assert table.columns["pressure"][0] == 20240501100059
    table = table_of(["20240501100059", "20240501100160"])
    assert table.columns["Time"][1] == 20240501100160
    assert table_of(["100059.5", "100100.0"], "t [s]").columns["t [s]"][0] == 100059.5


@pytest.mark.parametrize("name", ["UTC", "logtime", "HHMMSS", "Zeit"])
@pytest.mark.parametrize("hour", [0, 9, 10, 23])
def test_digits_that_turn_as_a_clock_does_are_one_under_any_name(name, hour):
    stamps = moments(FIRST.replace(hour=hour, second=50), n=40)
    cells = [f"{float(f'{m:%H%M%S}.{tenths(m)}'):.1f}" for m in stamps]
    np.testing.assert_allclose(elapsed(cells, name), np.arange(40) / 2)


NO_CLOCK = {
    "seconds": np.arange(90_000, 90_300) / 1.0,
    "seconds with a gap": np.r_[90_000:90_055, 90_065:90_300] / 1.0,
    "a command": np.repeat([1455.0, 1500.0, 1455.0, 1500.0], 30),
    "tens": 10.0 * np.arange(60),
    "thousands": 1e3 * np.arange(60),
}


@pytest.mark.parametrize("numbers", NO_CLOCK.values(), ids=NO_CLOCK)
def test_other_numbers_are_no_clock(numbers):
    table = table_of(numbers.astype(str), "n")
    np.testing.assert_array_equal(table.columns["n"], numbers)


def test_a_clock_goes_on_after_midnight_beside_the_date_of_the_start():
    stamps = moments(FIRST.replace(hour=23))
    rows = "\n".join(f"2024-05-01,{m:%H:%M:%S}.{tenths(m)},{k}" for k, m in enumerate(stamps))
    time = text_table(f"Date,Time,u\n{rows}\n".encode(), "log.csv").columns["Time"]
    np.testing.assert_allclose(time - time[0], HALF_SECONDS, atol=1e-5)


@pytest.mark.parametrize("names", [",u,n", "u,n,"])
def test_time_stamps_without_a_name_are_the_time(names):
    place = names.split(",").index("")
    lines = [[str(k), str(k)] for k in range(6)]
    for line, moment in zip(lines, moments(), strict=True):
        line.insert(place, moment.isoformat(" "))
    rows = "\n".join(",".join(line) for line in lines)
    table = text_table(f"{names}\n{rows}\n".encode(), "log.csv")
    np.testing.assert_allclose(table.columns["time"] - table.columns["time"][0], HALF_SECONDS)
    assert "time" in table.stamps
    assert "time: read from the column without a name" in table.remarks


COLUMNS = {
    "date and clock": ("Date,Time", lambda m: f"{m:%Y-%m-%d},{m:%H:%M:%S}.{tenths(m)}"),
    "clock and date": ("Time,Date", lambda m: f"{m:%H:%M:%S}.{tenths(m)},{m:%d/%m/%Y}"),
    "digits": ("date,time", lambda m: f"{m:%Y%m%d},{m:%H%M%S}.{tenths(m)}"),
    "halves of a day": ("Date,Time", lambda m: f"{m:%m/%d/%Y},{m:%I:%M:%S}.{tenths(m)} {m:%p}"),
    "parts of the clock": ("hour,minute,second", lambda m: f"{m.hour},{m.minute},{m:%S.%f}"),
    "date and parts": ("Date,HH,MM,SS", lambda m: f"{m:%d.%m.%Y},{m:%H,%M,%S.%f}"),
    "all parts": (
        "Year,Month,Day,Hour,Min,Sec",
        lambda m: f"{m.year},{m.month},{m.day},{m.hour},{m.minute},{m:%S.%f}",
    ),
}


@pytest.mark.parametrize("first", MOMENTS.values(), ids=MOMENTS)
@pytest.mark.parametrize(("names", "written"), COLUMNS.values(), ids=COLUMNS)
def test_time_in_several_columns(names, written, first):
    rows = "\n".join(f"{written(moment)},{k}" for k, moment in enumerate(moments(first)))
    table = text_table(f"{names},u\n{rows}\n".encode(), "log.csv")
    name = next((name for name in table.columns if name.lower() == "time"), "Date")
    time = table.columns[name]
    np.testing.assert_allclose(time - time[0], HALF_SECONDS, atol=1e-5)
    assert table.units[name] == "s" and name in table.stamps


def read(tmp_path, header, rows, time, rate=10.0):
    path = tmp_path / "log.csv"
    path.write_text("\n".join([header, *rows]))
    columns = {"speed": Column("u"), "port_rpm": Column("n")}
    return read_log(path, VehicleFile(VEHICLE.vehicle, columns, time, rate))


def test_a_time_that_cannot_be_read_is_refused_with_a_cell(tmp_path):
    rows = [f"day{k},{0.4 + k % 7 / 1000},{350 + k % 9}" for k in range(200)]
    words = "column 'Time': got 'day0'; allowed is time stamps: 200 of 200 cells are none"
    with pytest.raises(InputError, match=words):
        read(tmp_path, "Time,u,n", rows, Column("Time"))


def test_no_time_in_the_vehicle_file_is_remarked(tmp_path):
    rows = [f"{0.4 + k % 7 / 1000},{350 + k % 9}" for k in range(200)]
    log = read(tmp_path, "u,n", rows, None)
    assert log.remarks == ("time: the vehicle file names no column; rows are taken 0.1 s apart",)


def test_stamps_carry_their_unit(tmp_path):
    rows = [f"00:{k / 10:04.1f},{0.4 + k % 7 / 1000},{350 + k % 9}" for k in range(200)]
    log = read(tmp_path, "Time,u,n", rows, Column("Time", 60.0))
    assert log.time[-1] == pytest.approx(19.9)


NUMBERS = {
    "hours": ("h", 12.0 + np.arange(200) / 36_000),
    "days of a spreadsheet": ("d", 45_413.4166667 + np.arange(200) / 864_000),
    "days of MATLAB": ("d", 739_373.4166667 + np.arange(200) / 864_000),
    "milliseconds": ("ms", 1_714_557_570_000.0 + 100 * np.arange(200)),
    "microseconds": ("us", 1_714_557_570_000_000.0 + 100_000 * np.arange(200)),
    "nanoseconds": ("ns", 1_714_557_570e9 + 1e8 * np.arange(200)),
    "seconds of a week": ("s", (604_790.0 + np.arange(200) / 10) % 604_800),
    "seconds of a day": ("s", (86_390.0 + np.arange(200) / 10) % 86_400),
}


@pytest.mark.parametrize(("unit", "stamps"), NUMBERS.values(), ids=NUMBERS)
def test_numbers_are_times_in_the_unit_of_the_vehicle_file(tmp_path, unit, stamps):
    factor = {"h": 3600.0, "d": 86_400.0, "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[unit]
    rows = [f"{t:.10f},{0.4 + k % 7 / 1000},{350 + k % 9}" for k, t in enumerate(stamps.tolist())]
    log = read(tmp_path, "Time,u,n", rows, Column("Time", factor))
    assert len(log.time) == 200 and log.remarks == ()
    if factor != 1.0:
        with pytest.raises(InputError, match=r"correct the unit|without a break"):
            read(tmp_path, "Time,u,n", rows, Column("Time"))
