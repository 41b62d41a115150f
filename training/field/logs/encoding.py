"""The text of a log file, whatever its encoding, as UTF-8."""

import codecs
import re

import numpy as np

from auv_fault_env.errors import refusal

UNPRINTABLE = re.compile(rb"[\x00-\x08\x0e-\x19\x1b-\x1f]")
SHOWN = 10_000  # bytes in which unprintable characters are counted


def as_utf8(content: bytes, log: str) -> tuple[bytes, list[str]]:
    """The text of a file with the line ends of Unix, and remarks; `InputError` if it is no text."""
    encoding = encoding_of(content)
    remarks = []
    if encoding != "utf-8":
        remarks.append(f"encoding: read as {encoding.upper()}")
        content = content.decode(encoding, errors="replace").encode()
    text = content.removeprefix(codecs.BOM_UTF8)
    trimmed = text.rstrip(b"\0")
    n_zeros = len(text) - len(trimmed)
    if n_zeros:
        cause = "the log was cut while it was written"
        remarks.append(f"end: zero bytes left out, {cause} ({n_zeros})")
    start = trimmed[:SHOWN]
    if b"\0" in trimmed or len(UNPRINTABLE.findall(start)) > len(start) / 100:
        allowed = "a table as text, Parquet, MCAP or a rosbag2 folder"
        raise refusal("log", log, allowed, "export it as CSV")
    if b"\r" in trimmed:
        trimmed = trimmed.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return trimmed, remarks


def encoding_of(content: bytes) -> str:
    """UTF-8, UTF-16, or Latin-1 for what is neither."""
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    even_zeros = _share_of_zeros(content[0:4096:2])
    odd_zeros = _share_of_zeros(content[1:4096:2])
    if max(even_zeros, odd_zeros) > 0.4 and min(even_zeros, odd_zeros) < 0.1:
        return "utf-16-be" if even_zeros > odd_zeros else "utf-16-le"
    return "utf-8" if content.isascii() or _is_utf8(content) else "latin-1"


def _is_utf8(content: bytes) -> bool:
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True


def _share_of_zeros(content: bytes) -> float:
    return float(np.mean(np.frombuffer(content, np.uint8) == 0)) if content else 0.0
