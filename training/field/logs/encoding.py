"""The text of a log file, whatever its encoding."""

import codecs
import re

import numpy as np

from auv_fault_env.errors import refusal

UNPRINTABLE = re.compile(r"[\x00-\x08\x0e-\x19\x1b-\x1f]")
SHOWN = 10_000  # characters in which unprintable ones are counted


def decoded(content: bytes, log: str) -> tuple[str, list[str]]:
    """The text of a file with the line ends of Unix, and remarks; `InputError` if it is no text."""
    encoding = _encoding(content)
    text = content.decode(encoding, errors="replace")
    remarks = [] if encoding.startswith("utf-8") else [f"encoding: read as {encoding.upper()}"]
    trimmed = text.rstrip("\0")
    n_zeros = len(text) - len(trimmed)
    if n_zeros:
        cause = "the log was cut while it was written"
        remarks.append(f"end: zero bytes left out, {cause} ({n_zeros})")
    start = trimmed[:SHOWN]
    if "\0" in trimmed or len(UNPRINTABLE.findall(start)) > len(start) / 100:
        allowed = "a table as text, Parquet, MCAP or a rosbag2 folder"
        raise refusal("log", log, allowed, "export it as CSV")
    return trimmed.replace("\r\n", "\n").replace("\r", "\n"), remarks


def _encoding(content: bytes) -> str:
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    even_zeros = _share_of_zeros(content[0:4096:2])
    odd_zeros = _share_of_zeros(content[1:4096:2])
    if max(even_zeros, odd_zeros) > 0.4 and min(even_zeros, odd_zeros) < 0.1:
        return "utf-16-be" if even_zeros > odd_zeros else "utf-16-le"
    try:
        content.decode("utf-8")
        return "utf-8-sig"
    except UnicodeDecodeError:
        return "latin-1"


def _share_of_zeros(content: bytes) -> float:
    return float(np.mean(np.frombuffer(content, np.uint8) == 0)) if content else 0.0
