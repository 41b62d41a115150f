"""Parquet: every type becomes numbers, or the column is left out by name; no value is lost."""

import datetime as dt
import io
from decimal import Decimal

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest

from auv_fault_env.errors import InputError
from training.field.logs import limits
from training.field.logs.parquet_table import parquet_table

NAN = np.nan
STAMP = dt.datetime(1970, 1, 1, 0, 0, 1)
WORDS = ["1970-01-01T00:00:01", None, "1970-01-01T00:00:01.5"]

# columns of three rows, and their numbers
COLUMNS = {
    "16 bit": (pa.array([1, 2, None], pa.int16()), [1, 2, NAN]),
    "truth values": (pa.array([True, False, None]), [1, 0, NAN]),
    "half precision": (pa.array(np.array([1, 2.5, -1], np.float16)), [1, 2.5, -1]),
    "decimal": (
        pa.array([Decimal("1.5"), None, Decimal("-2")], pa.decimal128(9, 3)),
        [1.5, NAN, -2],
    ),
    "long decimal": (pa.array([Decimal("1.5")] * 3, pa.decimal256(50, 3)), [1.5] * 3),
    "text": (pa.array(["1.5", "-", None]), [1.5, NAN, NAN]),
    "large text": (pa.array(["1.5", "-", None], pa.large_string()), [1.5, NAN, NAN]),
    "view of text": (pa.array(["1.5", "-", None], pa.string_view()), [1.5, NAN, NAN]),
    "bytes of text": (pa.array([b"1.5", b"-", None]), [1.5, NAN, NAN]),
    "dictionary of numbers": (pa.array([2.5, None, 2.5]).dictionary_encode(), [2.5, NAN, 2.5]),
}
# the same, whose numbers are seconds
TIMES = {
    "words": (pa.array(WORDS).dictionary_encode(), [1, NAN, 1.5]),
    "stamps as text": (pa.array(WORDS), [1, NAN, 1.5]),
    "dictionary of stamps": (pa.array([STAMP, None, STAMP]).dictionary_encode(), [1, NAN, 1]),
    "stamps": (pa.array([STAMP, None, STAMP], pa.timestamp("us")), [1, NAN, 1]),
    "stamps in ns": (pa.array([STAMP] * 3, pa.timestamp("ns")), [1, 1, 1]),
    "stamps in a zone": (pa.array([STAMP] * 3, pa.timestamp("ms", "Europe/Berlin")), [1, 1, 1]),
    "days": (pa.array([dt.date(1970, 1, 2)] * 3, pa.date32()), [86_400] * 3),
    "days in ms": (pa.array([dt.date(1970, 1, 2)] * 3, pa.date64()), [86_400] * 3),
    "duration in s": (pa.array([1, None, 3], pa.duration("s")), [1, NAN, 3]),
    "duration in ns": (pa.array([10**8, None, 3 * 10**8], pa.duration("ns")), [0.1, NAN, 0.3]),
    "time of day": (pa.array([1500, None, 2500], pa.time32("ms")), [1.5, NAN, 2.5]),
    "time of day in us": (pa.array([100_000, None, 10**6], pa.time64("us")), [0.1, NAN, 1]),
}
LEFT_OUT = {
    "list": pa.array([[1.0], [2.0], None]),
    "struct": pa.array([{"x": 1.0}] * 3),
    "bytes": pa.array([b"\xff", b"\xfe", None]),
    "bytes of one length": pa.array([b"12", b"13", None], pa.binary(2)),
}


def written(columns, **options):
    buffer = io.BytesIO()
    pyarrow.parquet.write_table(pa.table(columns), buffer, **options)
    return buffer.getvalue()


@pytest.mark.parametrize("kind", COLUMNS | TIMES)
def test_a_type_that_holds_numbers(kind):
    values, expected = (COLUMNS | TIMES)[kind]
    table = parquet_table(written({"t": values}), "log.parquet")
    np.testing.assert_allclose(table.columns["t"], expected, rtol=0, atol=1e-9)
    assert dict(table.units) == ({"t": "s"} if kind in TIMES else {})
    assert table.stamps == ({"t"} if kind in TIMES else set())
    assert table.remarks == ()


def test_the_index_of_pandas_without_a_name_is_the_time():
    content = written({"u": pa.array([1.0] * 3), "__index_level_0__": TIMES["stamps"][0]})
    table = parquet_table(content, "log.parquet")
    assert set(table.columns) == {"u", "time"}
    assert table.stamps >= {"time"}


def test_words_in_several_row_groups():
    content = written({"t": pa.array(["1", "2", "1", "3"]).dictionary_encode()}, row_group_size=2)
    np.testing.assert_array_equal(parquet_table(content, "log").columns["t"], [1, 2, 1, 3])


@pytest.mark.parametrize("kind", LEFT_OUT)
def test_a_type_that_holds_none_is_left_out_by_name(kind):
    table = parquet_table(written({"u": [1.0, 2.0, 3.0], "x": LEFT_OUT[kind]}), "log.parquet")
    assert list(table.columns) == ["u"]
    (remark,) = table.remarks
    assert remark.startswith("x: ") and remark.endswith("the column is left out")


def test_text_between_numbers_is_remarked():
    table = parquet_table(written({"u": ["1.5", "fast", "2"]}), "log.parquet")
    np.testing.assert_array_equal(table.columns["u"], [1.5, NAN, 2])
    assert table.remarks == ("u: cells without a number, such as 'fast', taken as missing (1)",)


def test_repeated_names():
    names = ["u", "u"]
    table = pa.Table.from_arrays([pa.array([1.0]), pa.array([2.0])], names=names)
    buffer = io.BytesIO()
    pyarrow.parquet.write_table(table, buffer)
    columns = parquet_table(buffer.getvalue(), "log.parquet").columns
    assert {name: values[0] for name, values in columns.items()} == {"u": 1, "u (2)": 2}


@pytest.mark.parametrize(
    ("limit", "value", "allowed"),
    [
        ("LARGEST_TABLE", 1000, "at most 1000 numbers; split it"),
        ("LARGEST_CONTENT", 1000, "at most 0 MiB, unpacked; split it"),
    ],
)
def test_a_file_that_would_fill_the_memory_is_not_unpacked(monkeypatch, limit, value, allowed):
    content = written({"u": np.arange(100_000.0)})
    monkeypatch.setattr(limits, limit, value)
    monkeypatch.setattr(pyarrow.parquet, "ParquetFile", lambda *_, **__: pytest.fail("unpacked"))
    with pytest.raises(InputError, match=allowed):
        parquet_table(content, "log.parquet")


def test_a_text_stands_once_in_memory_however_many_rows_have_it():
    content = written({"u": np.arange(1000.0), "note": ["x" * 1_000_000] * 1000})
    before = pa.default_memory_pool().max_memory()
    table = parquet_table(content, "log.parquet")
    assert list(table.columns) == ["u"]
    assert pa.default_memory_pool().max_memory() - before < 100 << 20


def test_a_damaged_file_is_refused():
    with pytest.raises(InputError, match="allowed is a whole Parquet file; write it again"):
        parquet_table(b"PAR1" + bytes(100), "log.parquet")
