"""Texts of table cells, and file names."""

import re
from collections.abc import Collection, Sequence
from pathlib import PurePath

import numpy as np

LARGEST_SHARE = 10.0
LEAST_DECIMAL = 1e-4  # below which a number would be a power of ten


def row_name(name: str, references: Collection[str]) -> str:
    """The name, marked with a star if it is a reference."""
    return f"{name} *" if name in references else name


def with_interval(value: float, interval: Sequence[float], digits: int, sign: str = "") -> str:
    """A value and its interval; `sign` "+" for differences."""
    form = f"{sign}.{digits}f"
    low = format(interval[0], form)
    high = format(interval[1], form)
    separator = " to " if sign else "–"
    return f"{value:{form}} ({low}{separator}{high})"


def counted(n: int, noun: str) -> str:
    """A number of things.

    >>> counted(1, "log"), counted(2, "log")
    ('1 log', '2 logs')
    """
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


def percent(share: float) -> str:
    """A share, 0 to 1, in whole per cent."""
    return f"{100 * share:.0f} %"


def probability(value: float) -> str:
    """A probability, without powers of ten.

    >>> probability(0.0753), probability(2e-6)
    ('0.075', '1 in 500,000')
    """
    return f"{value:.2g}" if value >= LEAST_DECIMAL else f"1 in {1.0 / value:,.0f}"


def significant(value: float, digits: int = 2) -> str:
    """A number with so many significant digits, without a power of ten up to a million.

    >>> significant(183.0), significant(0.00583), significant(0.0)
    ('180', '0.0058', '0')
    """
    return f"{float(f'{value:.{digits}g}'):g}"


def signed_percent(share: float) -> str:
    """A relative change in whole per cent, up to +1000 %.

    >>> signed_percent(0.62), signed_percent(-0.001), signed_percent(208.0)
    ('+62 %', '+0 %', 'over +1000 %')
    """
    if share > LARGEST_SHARE:
        return f"over {signed_percent(LARGEST_SHARE)}"
    return f"{round(100.0 * share):+d} %"


def seconds(time: float | None, horizon: float) -> str:
    """A time [s]; None is beyond the horizon [s]."""
    return f"> {horizon:g}" if time is None else f"{time:.1f}"


def number(value: float | None, digits: int, missing: str = "infinite") -> str:
    """A number, or the word for None."""
    return missing if value is None else f"{value:.{digits}f}"


def without_nan(values: np.ndarray) -> list[float | None]:
    """The values (n,) as plain data, None for NaN."""
    return [None if np.isnan(value) else float(value) for value in values]


def file_name(text: str) -> str:
    """The text reduced to letters, digits and single hyphens."""
    return re.sub(r"\W+", "-", text).strip("-")


def distinct_names(paths: Sequence[str]) -> list[str]:
    """The last parts of each path, as many as make the paths distinct.

    >>> distinct_names(["runs/a/log.csv", "runs/b/log.csv"])
    ['a/log.csv', 'b/log.csv']
    >>> distinct_names(["/data/one.csv", "/data/two.csv"])
    ['one.csv', 'two.csv']
    """
    parts = [PurePath(path).parts for path in paths]
    n_distinct = len(set(parts))
    longest = max(map(len, parts), default=0)
    for n in range(1, longest):
        if len({one[-n:] for one in parts}) == n_distinct:
            return [str(PurePath(*one[-n:])) for one in parts]
    return list(paths)
