"""Tables from log files as they come, each by the reader of its format."""

import gzip
import io
import re
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from auv_fault_env.errors import InputError, refusal
from auv_fault_env.printable import printable
from training.field.logs import dataflash_table, mcap_table, ulog_table
from training.field.logs.bags import read_bag
from training.field.logs.foreign import START, foreign_format
from training.field.logs.limits import check_content
from training.field.logs.mavlink_table import is_tlog, tlog_table
from training.field.logs.parquet_table import parquet_table
from training.field.logs.table import Table
from training.field.logs.text_table import text_table

# readers of files that are read piece by piece, by the first bytes
READERS: dict[bytes, Callable[[Path], Table]] = {
    mcap_table.START: mcap_table.mcap_table,
    dataflash_table.START: dataflash_table.dataflash_table,
    b"SQLite format 3\0": read_bag,
    b"#ROSBAG": read_bag,
}
# readers of the content of a file; text has no first bytes of its own
CONTENT_READERS: dict[bytes, Callable[[bytes, str], Table]] = {
    b"PAR1": parquet_table,
    ulog_table.START: ulog_table.ulog_table,
    b"": text_table,
}
GZIP_START = b"\x1f\x8b"
CHUNK = 1 << 20  # bytes that are unpacked at once


def read_table(path: Path) -> Table:
    """Read a log and repair what can be repaired; `InputError` if it holds no table of numbers."""
    path = Path(path)
    log = printable(path.name)
    start = first_bytes(path)
    reader = read_bag if start is None else _file_reader(start)
    if reader:
        return reader(path)
    content, remarks = _content(path, log)
    if not re.search(rb"[^\0 \t\r\n]", content):
        allowed = "a table with a header and rows of numbers"
        raise refusal("log", log, allowed, "the file is empty")
    if foreign := foreign_format(content[:START], log):
        raise foreign
    if _file_reader(content[:START]):
        raise refusal("log", f"{log}: gzip", "text, Parquet or ULog in it", "unpack it with gunzip")
    reader = _reader(CONTENT_READERS, content)
    contents = [content]
    del content  # only the reader holds it, and lets it go when it has the cells
    table = reader(contents.pop(), log)
    if not any(np.isfinite(values).any() for values in table.columns.values()):
        allowed = "a table with at least one column of numbers"
        raise refusal("log", log, allowed, "check what was exported")
    return table._replace(remarks=(*remarks, *table.remarks))


def _file_reader(start: bytes) -> Callable[[Path], Table] | None:
    return tlog_table if is_tlog(start) else _reader(READERS, start)


def _reader(readers: dict[bytes, Callable], start: bytes) -> Callable | None:
    return next((readers[known] for known in readers if start.startswith(known)), None)


def first_bytes(path: Path) -> bytes | None:
    """The first bytes of a log; None for a folder that is a bag, `InputError` for what is none."""
    try:
        if (path / "metadata.yaml").is_file():
            return None
        if path.exists() and not path.is_file():
            raise refusal("log", str(path), "a file or a rosbag2 folder", "name the file")
        with path.open("rb") as file:
            return file.read(START)
    except InputError:
        raise
    except (OSError, ValueError) as error:
        raise _unreadable(path, error) from None


def _unreadable(path: Path, error: OSError | ValueError) -> InputError:
    reason = getattr(error, "strerror", None) or str(error)
    return refusal("log", str(path), "a readable file", f"check the path ({reason})")


def _content(path: Path, log: str) -> tuple[bytes, list[str]]:
    """The bytes of a file, unpacked, and remarks."""
    try:
        check_content(log, path.stat().st_size)
        content = path.read_bytes()
    except OSError as error:
        raise _unreadable(path, error) from None
    return _unpacked(content, log) if content.startswith(GZIP_START) else (content, [])


def _unpacked(content: bytes, log: str) -> tuple[bytes, list[str]]:
    """What can be read of a gzip file, and remarks."""
    stream = gzip.GzipFile(fileobj=io.BytesIO(content))
    unpacked = io.BytesIO()
    try:
        while chunk := stream.read1(CHUNK):
            unpacked.write(chunk)
            check_content(log, unpacked.tell())
    except (EOFError, zlib.error, gzip.BadGzipFile):
        remark = f"gzip: breaks off; the {unpacked.tell()} bytes before are read"
        return unpacked.getvalue(), [remark]
    return unpacked.getvalue(), []
