"""Rows above the numbers, and several tables in one file."""

import numpy as np
import pytest

from auv_fault_env.errors import InputError
from training.field.logs.text_table import text_table

NAMES = "time,depth,volume,lat"
ROWS = [f"{k / 10},{k % 7}.5,{k % 5}.25,3.{k % 3}" for k in range(40)]
HEADERS = {
    "units that channels have": (["s,m/s,V,rad"], True),
    "any units": (["s,m,cc,lat"], True),
    "words of a glider": (["timestamp,nodim,cc,lat"], True),
    "brackets": (["[s],[x],[y],[z]"], True),
    "units and types": (["s,m,cc,lat", "float64,float32,float32,float64"], True),
    "units and bytes": (["s,m,cc,lat", "8,4,4,8"], True),
    "types": (["double,float,float,double"], False),
    "kinds of values": (["TS,m,cc,deg", ",Avg,Avg,Smp"], True),
}


@pytest.mark.parametrize("n_before", [0, 3, 700])
@pytest.mark.parametrize(("below", "has_units"), HEADERS.values(), ids=HEADERS)
def test_rows_under_the_header(below, has_units, n_before):
    preamble = [f"key_{k}: value {k}" for k in range(n_before)]
    text = "\n".join([*preamble, NAMES, *below, *ROWS])
    table = text_table(text.encode(), "log.csv")
    assert list(table.columns) == NAMES.split(",")
    assert bool(table.units) == has_units
    np.testing.assert_allclose(table.columns["time"], np.arange(40) / 10)
    assert any(f"({n_before})" in remark for remark in table.remarks) == (n_before > 0)


def test_a_glider_separates_by_blanks():
    lines = ["dbd_label: DBD_ASC", "num_label_lines: 3", "time depth cc_x lat", "s m cc lat"]
    rows = [row.replace(",", " ") + " " for row in ROWS]
    table = text_table("\n".join([*lines, "8 4 4 8", *rows]).encode(), "log.dba")
    assert table.units == {"time": "s", "depth": "m", "cc_x": "cc", "lat": "lat"}
    assert len(table.columns["time"]) == 40


def test_rows_of_a_data_base_above_the_names():
    lines = [
        "#group,false,false,true,false",
        "#datatype,string,dateTime:RFC3339,double,double",
        "#default,_result,,,",
        ",result,time,speed,current",
    ]
    rows = [f",,2024-05-01T10:00:{k:02}Z,0.{k},{k}.5" for k in range(40)]
    table = text_table("\n".join([*lines, *rows]).encode(), "log.csv")
    assert list(table.columns) == ["result", "time", "speed", "current"]
    np.testing.assert_allclose(table.columns["current"], np.arange(40) + 0.5)


def test_names_above_which_a_title_stands_are_the_last_words():
    text = "\n".join(["motor,,battery,", NAMES, *ROWS])
    assert list(text_table(text.encode(), "log.csv").columns) == NAMES.split(",")


SEVERAL = {
    "of the same width": [NAMES, *ROWS, "id,kind,place,weight", *ROWS],
    "of another width": [NAMES, *ROWS, "time,event", *[f"{k},{k}" for k in range(20)]],
    "in turn": [
        NAMES,
        *[line for k, row in enumerate(ROWS) for line in (row, f"GPS,{k},3,1,2,5,6")],
    ],
}


@pytest.mark.parametrize("lines", SEVERAL.values(), ids=SEVERAL)
def test_several_tables_are_refused_by_name(lines):
    words = (
        r"log.csv: (another header in row 41|\d+ rows without|a header of 4 names above rows of 7)"
    )
    with pytest.raises(InputError, match=words):
        text_table("\n".join(lines).encode(), "log.csv")


def test_a_header_that_stands_again_is_no_other_table():
    lines = [NAMES, "s,m,cc,lat", *ROWS, NAMES, "s,m,cc,lat", *ROWS]
    table = text_table("\n".join(lines).encode(), "log.csv")
    assert np.isfinite(table.columns["depth"]).sum() == 80
