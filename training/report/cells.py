"""Texts of table cells, and file names."""

import re
from collections.abc import Collection, Sequence

import numpy as np


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


def percent(share: float) -> str:
    """A share, 0 to 1, in whole per cent."""
    return f"{100 * share:.0f} %"


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
