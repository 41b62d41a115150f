"""How a text file is laid out: separator, header and first row of numbers."""

import io
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from auv_fault_env.errors import InputError, refusal
from training.field.logs.cells import (
    COMMENT_MARKS,
    LONGEST_LINE,
    cells_of,
    matching_names,
    separator_of,
    share_of_values,
    usual_width,
    without_stray_quotes,
)
from training.field.logs.header_rows import header_of, is_byte_row

# lines from all parts of a file, and as many at its end, by which separator and width are found
SAMPLE = 50
WHOLE = 1 << 16  # bytes at the end of a file that are cut into lines
LONGEST_PREAMBLE = 100_000  # lines


class Dialect(NamedTuple):
    """Layout of a text table."""

    separator: str  # one of `SEPARATORS`
    names: tuple[str, ...]  # by column
    units: tuple[str, ...]  # by column; empty without a row of units
    start: int  # bytes before the first row of numbers
    lines_before: int  # how many lines with text stand before the header


def dialect_of(content: bytes, log: str) -> Dialect:
    """The layout of a file in UTF-8; `InputError` without a header above rows of numbers."""
    lines = [_as_text(line) for line in _sample(content) if line.strip()]
    if not lines:
        raise _no_rows(log)
    if max(map(len, lines)) > LONGEST_LINE:
        raise _too_long(log)
    separator = separator_of(lines)
    rows = [cells_of(line, separator) for line in lines]
    width = usual_width(rows)
    rows = [row for row in rows if len(row) == width]
    shares = [share for share in map(share_of_values, rows) if share]
    least_share = float(np.median(shares)) / 2 if shares else 1.0
    above = []
    end = 0
    for line in _lines(content, log):
        end += len(line)
        row = cells_of(_as_text(line), separator)
        if len(row) == width and share_of_values(row) > least_share:
            break
        if any(row):
            above.append(row)
    else:
        raise _no_rows(log)
    header = header_of(above)
    names = matching_names(header.names, rows, separator)
    if len(names) != width:
        got = f"{log}: a header of {len(names)} names above rows of {width} cells"
        remedy = "write the header, and separate cells by semicolons"
        raise refusal("log", got, "one name for each column", remedy)
    start = end if header.units and is_byte_row(row) else end - len(line)
    return Dialect(separator, tuple(names), tuple(header.units), start, header.n_before)


def _lines(content: bytes, log: str) -> Iterator[bytes]:
    """The first lines."""
    file = io.BytesIO(content)
    for _ in range(LONGEST_PREAMBLE):
        line = file.readline(LONGEST_LINE + 1)
        if len(line) > LONGEST_LINE:
            raise _too_long(log)
        if not line:
            return
        yield line


def _no_rows(log: str) -> InputError:
    return refusal("log", log, "a header with rows of numbers below", "check what was exported")


def _too_long(log: str) -> InputError:
    allowed = f"lines of at most {LONGEST_LINE} characters"
    return refusal("log", log, allowed, "export it with fewer columns")


def _as_text(line: bytes) -> str:
    return without_stray_quotes(line.decode(errors="replace").strip("\n").lstrip(COMMENT_MARKS))


def _sample(content: bytes) -> Sequence[bytes]:
    """The last lines, and lines from all parts of a file."""
    lines = content[-WHOLE:].split(b"\n")
    if len(content) <= WHOLE:
        places = np.linspace(0, len(lines) - 1, min(SAMPLE, len(lines)))
        return [*(lines[int(place)] for place in places), *lines[SAMPLE:][-SAMPLE:]]
    last = lines[1:][-SAMPLE:]
    file = io.BytesIO(content)
    lines = []
    for place in np.linspace(0, len(content), SAMPLE, endpoint=False):
        file.seek(int(place))
        file.readline(LONGEST_LINE + 1)  # the rest of a line
        lines.append(file.readline(LONGEST_LINE + 1))
    return [*lines, *last]
