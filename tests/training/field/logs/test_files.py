import bz2
import gzip
import lzma
import re
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest

from auv_fault_env.errors import InputError
from training.field.logs import limits
from training.field.logs.files import read_table
from training.field.logs.table import LONGEST_NAME

EXPECTED = {"t": [0.0, 0.5, 1.0], "u": [0.25, -1.5, 2.0]}
PLAIN = "t,u\n0,0.25\n0.5,-1.5\n1,2\n"

# The same table as people write it, and the remarks on it.
DIALECTS = {
    "plain": (PLAIN, ()),
    "no last line end": (PLAIN.strip(), ()),
    "windows": (PLAIN.replace("\n", "\r\n"), ()),
    "old mac": (PLAIN.replace("\n", "\r"), ()),
    "byte order mark": ("\ufeff" + PLAIN, ()),
    "blanks around": (PLAIN.replace(",", " , "), ()),
    "quotes": ('"t","u"\n"0","0.25"\n"0.5","-1.5"\n"1","2"\n', ()),
    "blank lines": (PLAIN.replace("\n", "\n\n"), ()),
    "comment before the header": ("#" + PLAIN, ()),
    "index": (",t,u\n0,0,0.25\n1,0.5,-1.5\n2,1,2\n", ()),
    "rows end with a comma": ("t,u\n0,0.25,\n0.5,-1.5,\n1,2,\n", ()),
    "all lines end with a comma": (PLAIN.replace("\n", ",\n"), ()),
    "signs and exponents": ("t,u\n+0,25e-2\n5E-1,-1.5\n1.,+2\n", ()),
    "column of text": ("t,u,mode\n0,0.25,auto\n0.5,-1.5,auto\n1,2,off\n", ()),
    "semicolons": (PLAIN.replace(",", ";"), ("cells: separated by semicolons",)),
    "tabs": (PLAIN.replace(",", "\t"), ("cells: separated by tabs",)),
    "bars": (PLAIN.replace(",", "|"), ("cells: separated by bars",)),
    "blanks": ("  t     u\n  0  0.25\n0.5  -1.5\n  1     2\n", ("cells: separated by blanks",)),
    "of R": ("t u\n1 0 0.25\n2 0.5 -1.5\n3 1 2\n", ("cells: separated by blanks",)),
    "decimal commas": (
        PLAIN.replace(",", ";").replace(".", ","),
        ("cells: separated by semicolons", "numbers: read with decimal commas"),
    ),
    "decimal commas in quotes": (
        't,u\n"0","0,25"\n"0,5","-1,5"\n"1","2"\n',
        ("numbers: read with decimal commas",),
    ),
    "preamble": (
        "Otter, mission 12\nsoftware 1.2\n\n" + PLAIN,
        ("header: lines before it left out (2)",),
    ),
    "preamble of a spreadsheet": (
        "Otter,12\ndate,\n" + PLAIN,
        ("header: lines before it left out (2)",),
    ),
    "line of a spreadsheet": (
        "sep=;\n" + PLAIN.replace(",", ";"),
        ("cells: separated by semicolons", "header: lines before it left out (1)"),
    ),
    "units below": (
        PLAIN.replace("u\n", "u\n[s],[m/s]\n"),
        ("units: read from the row under the header",),
    ),
    "comment between": (
        PLAIN + "# event\n",
        ("rows: those without 2 cells, such as '# event', left out (1)",),
    ),
    "last row cut": (PLAIN + "1.5", ("rows: those without 2 cells, such as '1.5', left out (1)",)),
    "zeros at the end": (
        PLAIN + "\0" * 5,
        ("end: zero bytes left out, the log was cut while it was written (5)",),
    ),
    "stray quotation mark": (
        PLAIN.replace("0.25", '0.25"'),
        ("rows: stray quotation marks removed (1)",),
    ),
}


def write(tmp_path, content, name="log.csv"):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def assert_is(table, expected=EXPECTED):
    for name, values in expected.items():
        np.testing.assert_allclose(table.columns[name], values, err_msg=name)


@pytest.mark.parametrize(("text", "remarks"), DIALECTS.values(), ids=DIALECTS)
def test_dialects(tmp_path, text, remarks):
    table = read_table(write(tmp_path, text))
    assert_is(table)
    assert table.remarks == remarks


@pytest.mark.parametrize(
    ("encoding", "remark"),
    [
        ("utf-16", "encoding: read as UTF-16"),
        ("utf-16-le", "encoding: read as UTF-16-LE"),
        ("utf-16-be", "encoding: read as UTF-16-BE"),
        ("latin-1", "encoding: read as LATIN-1"),
    ],
)
def test_encodings(tmp_path, encoding, remark):
    table = read_table(write(tmp_path, PLAIN.replace("u", "Höhe über Grund").encode(encoding)))
    assert_is(table, {"t": EXPECTED["t"], "Höhe über Grund": EXPECTED["u"]})
    assert table.remarks == (remark,)


def test_units_below_the_header(tmp_path):
    table = read_table(write(tmp_path, PLAIN.replace("u\n", "u\ns,kn\n")))
    assert table.units == {"t": "s", "u": "kn"}


def test_words_for_missing_true_and_infinite(tmp_path):
    cells = ["", "-", "nan", "NULL", "n/a", "true", "False", "inf", "-Infinity", "1e999", "bad"]
    table = read_table(
        write(tmp_path, "t,u\n" + "".join(f"{k},{cell}\n" for k, cell in enumerate(cells)))
    )
    np.testing.assert_equal(
        table.columns["u"], [np.nan] * 5 + [1, 0, np.inf, -np.inf, np.inf, np.nan]
    )
    assert table.remarks == ("u: cells without a number, such as 'bad', taken as missing (1)",)


def test_repeated_header_is_left_out(tmp_path):
    table = read_table(write(tmp_path, PLAIN + PLAIN))
    np.testing.assert_equal(table.columns["t"], [0, 0.5, 1, np.nan, 0, 0.5, 1])
    assert table.remarks[0] == "t: cells without a number, such as 't', taken as missing (1)"


def test_repeated_names_get_numbers(tmp_path):
    table = read_table(write(tmp_path, "t,u,u\n0,1,2\n1,3,4\n"))
    assert_is(table, {"t": [0, 1], "u": [1, 3], "u (2)": [2, 4]})
    assert table.remarks == ("header: 'u' occurs more than once; one is called 'u (2)'",)


STAMPS = {
    "ISO": (["2026-03-01T12:00:00Z", "2026-03-01T12:00:00.5Z"], 1772366400.0),
    "a blank between": (["2026-03-01 12:00:00", "2026-03-01 12:00:00.5"], 1772366400.0),
    "with a zone": (
        ["2026-03-01T13:00:00+01:00", "2026-03-01T13:00:00.500000+01:00"],
        1772366400.0,
    ),
    "slashes": (["2026/03/01 12:00:00", "2026/03/01 12:00:00.5"], 1772366400.0),
    "day first": (["01.03.2026 12:00:00", "01.03.2026 12:00:00.5"], 1772366400.0),
    "clock": (["12:00:00", "12:00:00.5"], 43200.0),
}


@pytest.mark.parametrize(("stamps", "first"), STAMPS.values(), ids=STAMPS)
def test_time_stamps_are_seconds(tmp_path, stamps, first):
    table = read_table(write(tmp_path, f"t,u\n{stamps[0]},1\n,2\n{stamps[1]},3\n"))
    np.testing.assert_allclose(table.columns["t"], [first, np.nan, first + 0.5], rtol=0, atol=1e-6)


def test_gzip_whole_and_cut_off(tmp_path):
    packed = gzip.compress(PLAIN.encode()) + gzip.compress(b"1.5,3\n")
    table = read_table(write(tmp_path, packed, "log.csv.gz"))
    assert_is(table, {"t": [0, 0.5, 1, 1.5]})
    assert table.remarks == ()
    rows = "".join(f"{k},{k * 0.37:.3f}\n" for k in range(20_000))
    packed = gzip.compress(("t,u\n" + rows).encode())
    table = read_table(write(tmp_path, packed[: len(packed) // 2], "log.csv.gz"))
    assert 8000 < len(table.columns["t"]) < 12_000
    assert table.columns["u"][100] == 37.0
    assert table.remarks[0].startswith("gzip: breaks off; the ")


@pytest.mark.parametrize("start", [b"\x89MCAP0\r\n", b"SQLite format 3\0"])
def test_bags_are_read_by_the_bag_reader(tmp_path, start):
    with pytest.raises(InputError, match="bag: got"):
        read_table(write(tmp_path, start + b"broken"))


def test_a_file_beyond_the_limit_is_not_read(tmp_path, monkeypatch):
    monkeypatch.setattr(limits, "LARGEST_CONTENT", 100)
    monkeypatch.setattr(Path, "read_bytes", lambda _: pytest.fail("the file was read"))
    with pytest.raises(InputError, match="at most 0 MiB, unpacked; split it"):
        read_table(write(tmp_path, PLAIN * 10))


def test_a_gzip_file_is_refused_before_it_fills_the_memory(tmp_path, monkeypatch):
    monkeypatch.setattr(limits, "LARGEST_CONTENT", 4 << 20)
    path = write(tmp_path, gzip.compress(b"t,u\n" + b"0,1\n" * (16 << 20)))
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match="at most 4 MiB, unpacked; split it"):
            read_table(path)
        assert tracemalloc.get_traced_memory()[1] < 12 << 20
    finally:
        tracemalloc.stop()


FOREIGN = {
    "HDF5": b"\x89HDF\r\n\x1a\n\0",
    "MATLAB": b"MATLAB 5.0 MAT-file" + bytes(200),
    "NumPy (.npy)": b"\x93NUMPY\x01\0",
    "Excel (.xls)": b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1\0",
    "bzip2": bz2.compress(PLAIN.encode()),
    "xz": lzma.compress(PLAIN.encode()),
    "a Python pickle, which is code": b"\x80\x04\x95\0",
}
ZIPPED = {
    "Excel (.xlsx)": ["[Content_Types].xml", "xl/workbook.xml"],
    "NumPy (.npz)": ["speed.npy"],
    "ZIP": ["log.csv"],
}


@pytest.mark.parametrize("kind", FOREIGN)
def test_a_foreign_format_is_refused_by_name(tmp_path, kind):
    with pytest.raises(InputError, match=re.escape(f"log.csv: {kind}")):
        read_table(write(tmp_path, FOREIGN[kind]))


@pytest.mark.parametrize("kind", ZIPPED)
def test_a_foreign_archive_is_refused_by_name(tmp_path, kind):
    with zipfile.ZipFile(tmp_path / "log.csv", "w") as archive:
        for name in ZIPPED[kind]:
            archive.writestr(name, PLAIN)
    with pytest.raises(InputError, match=re.escape(f"log.csv: {kind}")):
        read_table(tmp_path / "log.csv")


@pytest.mark.parametrize("name", ["MATLAB time", "LOGGER", "ORC", "PK", "TDSm"])
def test_a_header_that_begins_like_a_foreign_format_is_text(tmp_path, name):
    assert_is(read_table(write(tmp_path, PLAIN.replace("t,", f"{name},"))), {name: [0, 0.5, 1]})


def test_control_characters_of_a_header_are_escaped_and_long_names_cut(tmp_path):
    header = "\x1b[2Jt," + "u" * 10_000
    table = read_table(write(tmp_path, PLAIN.replace("t,u", header)))
    assert list(table.columns) == ["\\x1b[2Jt", "u" * (LONGEST_NAME - 4) + " ..."]


def test_file_without_permission(tmp_path, monkeypatch):
    def refuse(path, mode):
        raise PermissionError(13, "Permission denied")

    path = write(tmp_path, PLAIN)
    monkeypatch.setattr(type(path), "open", refuse)
    with pytest.raises(InputError, match=r"a readable file; check the path \(Permission denied\)"):
        read_table(path)
