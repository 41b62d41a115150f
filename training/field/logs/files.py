"""Tables from log files as they come: CSV of any dialect, gzip, Parquet, MCAP and rosbag2."""

import gzip
import io
import zlib
from pathlib import Path

import numpy as np

from auv_fault_env.errors import InputError, refusal
from training.field.logs.bags import read_bag
from training.field.logs.parquet_table import parquet_table
from training.field.logs.table import Table
from training.field.logs.text_table import text_table

BAG_STARTS = (b"\x89MCAP", b"SQLite format 3\0", b"#ROSBAG")
GZIP_START = b"\x1f\x8b"
PARQUET_START = b"PAR1"
LARGEST = 1 << 30  # bytes of a log, unpacked


def read_table(path: Path) -> Table:
    """Read a log and repair what can be repaired; `InputError` if it holds no table of numbers."""
    path = Path(path)
    content = _content(path)
    if content is None:
        return read_bag(path)
    content, remarks = _unpacked(content, path.name)
    if not content.strip(b"\0 \t\r\n"):
        allowed = "a table with a header and rows of numbers"
        raise refusal("log", path.name, allowed, "the file is empty")
    read = parquet_table if content.startswith(PARQUET_START) else text_table
    table = read(content, path.name)
    if not any(np.isfinite(values).any() for values in table.columns.values()):
        allowed = "a table with at least one column of numbers"
        raise refusal("log", path.name, allowed, "check what was exported")
    return table._replace(remarks=(*remarks, *table.remarks))


def _content(path: Path) -> bytes | None:
    """The bytes of a file; None if it is a bag."""
    try:
        if (path / "metadata.yaml").is_file():
            return None
        if path.exists() and not path.is_file():
            raise refusal("log", str(path), "a file or a rosbag2 folder", "name the file")
        with path.open("rb") as file:
            start = file.read(16)
            content = None if start.startswith(BAG_STARTS) else start + file.read(LARGEST)
    except InputError:
        raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise refusal("log", str(path), "a readable file", f"check the path ({reason})") from None
    if content and len(content) > LARGEST:
        raise refusal("log", str(path), f"a file of at most {LARGEST >> 20} MiB", "split it")
    return content


def _unpacked(content: bytes, log: str) -> tuple[bytes, list[str]]:
    """The content itself, or what can be read of a gzip file, and remarks."""
    if not content.startswith(GZIP_START):
        return content, []
    stream = gzip.GzipFile(fileobj=io.BytesIO(content))
    chunks = []
    size = 0
    try:
        while chunk := stream.read1(1 << 20):
            chunks.append(chunk)
            size += len(chunk)
            if size > LARGEST:
                raise refusal("log", log, f"at most {LARGEST >> 20} MiB unpacked", "split it")
    except (EOFError, zlib.error, gzip.BadGzipFile):
        return b"".join(chunks), [f"gzip: breaks off; the {size} bytes before are read"]
    return b"".join(chunks), []
