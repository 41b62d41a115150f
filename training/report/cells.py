"""Figures as the text of a table's cell, and names as a table and a file have them."""

import re
from collections.abc import Collection, Sequence

from training.metrics.records import HORIZON


def row_name(name: str, references: Collection[str]) -> str:
    """The name, marked if it does not compete."""
    return f"{name} *" if name in references else name


def with_interval(value: float, interval: Sequence[float], digits: int, sign: str = "") -> str:
    """A value and its interval; `sign` "+" for differences."""
    form = f"{sign}.{digits}f"
    between = " to " if sign else "–"
    return f"{value:{form}} ({interval[0]:{form}}{between}{interval[1]:{form}})"


def percent(share: float) -> str:
    """A share in whole per cent."""
    return f"{100 * share:.0f} %"


def seconds(time: float | None) -> str:
    """A time, or that it is beyond the horizon."""
    return f"> {HORIZON:g}" if time is None else f"{time:.1f}"


def number(value: float | None, digits: int, nothing: str = "infinite") -> str:
    """A number, or the word for None."""
    return nothing if value is None else f"{value:.{digits}f}"


def file_name(text: str) -> str:
    """The text with nothing but letters, digits and single hyphens."""
    return re.sub(r"\W+", "-", text).strip("-")
