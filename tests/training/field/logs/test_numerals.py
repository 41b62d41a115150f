"""Numbers as text: decimal marks, thousands, units, and columns that lose cells."""

import numpy as np
import pytest

from auv_fault_env.errors import InputError
from training.field.logs.log import read_log
from training.field.logs.text_table import text_table
from training.field.vehicle_file import Column, VehicleFile

from ..fleet_logs import VEHICLE


def table_of(cells, beside=None, separator=";"):
    beside = beside or ["0"] * len(cells)
    rows = (f"{one}{separator}{other}" for one, other in zip(cells, beside, strict=True))
    return text_table("\n".join([f"n{separator}x", *rows]).encode(), "log.csv")


REST = ["0"] * 240
READ = {
    "thousands late": ([*map(str, range(700, 950)), "1.017"], ["0,5"], 1017),
    "thousands in quotes": (["990", '"1,136"'], ["0.5"], 1136),
    "decimal comma after a rest": ([*REST, "0,403"], None, 0.403),
    "decimal comma with exponent": (["0", "3,5E-01"], None, 0.35),
    "decimal comma and thousands": (["0,5", "1.234,5"], None, 1234.5),
    "decimal point and thousands": (["0.5", "1,234.5"], None, 1234.5),
    "groups of thousands": (["5", "1.234.567"], None, 1234567),
    "Swiss thousands": (["990", "1'136"], None, 1136),
    "French": (["990,5", "1\u202f136,5"], None, 1136.5),
    "three decimals": (["0.998", "1.017"], None, 1.017),
    "three decimals only": (["1.016", "1.017"], None, 1.017),
    "three decimals after a comma": (["1,016", "1,017"], None, 1.017),
    "minus sign": (["1.5", "\u22122.5"], None, -2.5),
    "unit": (["11.9 V", "12.3 V"], None, 12.3),
    "unit without a blank": (["352.7rpm", "12.3rpm"], None, 12.3),
    "unit behind a decimal comma": (["11,9 m/s²", "12,3 m/s²"], None, 12.3),
    "point in one column, comma in the other": (["0.5", "12.5"], ["0,5"], 12.5),
}


@pytest.mark.parametrize(("cells", "beside", "last"), READ.values(), ids=READ)
def test_the_whole_column_decides(cells, beside, last):
    others = beside and [*beside, *["7"] * (len(cells) - 1)]
    separator = "," if "," not in "".join(others or "") and '"' in cells[-1] else ";"
    table = table_of(cells, others, separator)
    assert not table.refusals
    assert table.columns["n"][-1] == last
    assert np.isfinite(table.columns["n"]).all()


def test_thousands_and_units_are_remarked():
    table = table_of(["0,5", "1.234"])
    assert "n: '1.234' read as 1234" in table.remarks
    table = table_of(["1.5 V", "2.5 V"])
    assert table.units["n"] == "V" and "n: in V, as behind the numbers" in table.remarks


AMBIGUOUS = {
    "no other column shows the mark": (["990", "1.017"], None),
    "a comma": (["990", "1,017"], None),
    "thousands beside decimal points": ([str(k) for k in range(990, 1000)] + ["1.010"], ["0.5"]),
    "either mark": (["1.017", "1,017"], None),
}


@pytest.mark.parametrize(("cells", "beside"), AMBIGUOUS.values(), ids=AMBIGUOUS)
def test_what_may_be_decimal_or_thousands_is_refused_by_name(cells, beside):
    table = table_of(cells, beside and [*beside, *["7"] * (len(cells) - 1)])
    assert "it may be a decimal number or thousands" in str(table.refusals["n"])
    assert np.isnan(table.columns["n"]).all()


LOST = {
    "words": ["0.4", "fast"],
    "two units": ["12.3 V", "450 mV"],
    "two decimal marks": ["0.5", "0,6"],
    "hexadecimal": ["0x1F", "0x20"],
    "addresses": ["10.0.0.1", "10.0.0.2"],
}


def log_of(tmp_path, cells):
    rows = [f"{k / 10};{cell};350" for k, cell in enumerate(cells)]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["t;u;n", *rows]))
    columns = {"speed": Column("u"), "port_rpm": Column("n")}
    return read_log(path, VehicleFile(VEHICLE.vehicle, columns, Column("t")))


@pytest.mark.parametrize("pair", LOST.values(), ids=LOST)
def test_a_channel_that_loses_more_than_a_tenth_is_refused(tmp_path, pair):
    good, bad = pair
    with pytest.raises(InputError, match=r"column 'u': got '.*' ?; allowed is numbers: \d+ of 200"):
        log_of(tmp_path, [bad if k % 5 == 0 else good for k in range(200)])


@pytest.mark.parametrize("pair", list(LOST.values())[:3], ids=list(LOST)[:3])
def test_few_lost_cells_are_missing_and_remarked(tmp_path, pair):
    good, bad = pair
    log = log_of(tmp_path, [bad if k % 50 == 7 else "0.4" + good[3:] for k in range(200)])
    assert any(f"such as {bad!r}, taken as missing (4)" in remark for remark in log.remarks)


def test_words_of_spreadsheets_for_missing_are_no_loss(tmp_path):
    log = log_of(tmp_path, ["#N/A" if k % 2 else f"0.4{k % 7}" for k in range(200)])
    assert "speed: missing in 100 of 200 rows" in log.remarks


def test_a_unit_of_the_log_that_is_not_that_of_the_vehicle_file_is_remarked(tmp_path):
    log = log_of(tmp_path, [f"0.4{k % 7} kn" for k in range(200)])
    assert "speed: in kn by the log, read in m/s by the vehicle file" in log.remarks
    log = log_of(tmp_path, [f"0.4{k % 7} m/s" for k in range(200)])
    assert not any("vehicle file" in remark for remark in log.remarks)
