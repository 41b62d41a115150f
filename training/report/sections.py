"""Sections of a page, as plain data (see `training.report.page.write_report`)."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

Section = dict[str, Any]


def table_section(
    heading: str, columns: Iterable[str], rows: Sequence[Sequence[str]], *text: str
) -> Section:
    """A section of paragraphs and a table."""
    table = {"columns": list(columns), "rows": rows}
    return {"heading": heading, "text": list(text), "table": table}


def figure_section(
    heading: str, plot: str, name: str, caption: str, data: Mapping[str, Any]
) -> Section:
    """A section of one figure."""
    return {
        "heading": heading,
        "text": [],
        "figures": [figure(plot, name, caption, data)],
    }


def figure(plot: str, name: str, caption: str, data: Mapping[str, Any]) -> dict[str, Any]:
    """A figure: name of its function in `PLOTS`, name of its file, caption, and arguments."""
    return {"plot": plot, "name": name, "caption": caption, "data": dict(data)}
