"""A report from results alone: sections of text, tables and figures as one ``index.html``, and tables as text."""

import base64
import io
from collections.abc import Iterable
from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import Template

from training.report.figures.registry import PLOTS

PRINTED = 6  # columns of a table on the screen


def write_report(results: dict[str, Any], folder: Path) -> None:
    """Draw the figures of `results` into ``figures/`` and write ``index.html`` with all of them inside.

    Parameters
    ----------
    results
        title, intro and sections; a section has heading, text (list of paragraphs) and optionally
        table (columns, rows) and figures (plot: name in `PLOTS`, data, name, caption).
    folder
        Where to write.
    """
    (folder / "figures").mkdir()
    images = {
        figure["name"]: _draw(figure, folder / "figures")
        for section in results["sections"]
        for figure in section.get("figures", ())
    }
    template = Template(
        files("training").joinpath("report.html.j2").read_text(encoding="utf-8"), autoescape=True
    )
    (folder / "index.html").write_text(
        template.render(results=results, images=images), encoding="utf-8"
    )


def _draw(figure: dict[str, Any], folder: Path) -> str:
    drawn = PLOTS[figure["plot"]](**figure["data"])
    drawn.savefig(folder / f"{figure['name']}.png", dpi=110)
    buffer = io.BytesIO()
    drawn.savefig(buffer, format="svg")
    return base64.b64encode(buffer.getvalue()).decode()


def print_tables(sections: Iterable[dict[str, Any]]) -> None:
    """Print the sections' tables as plain text, the first six columns of each: the wordy ones come last."""
    for section in sections:
        if "table" not in section:
            continue
        rows = [row[:PRINTED] for row in (section["table"]["columns"], *section["table"]["rows"])]
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        print(f"\n{section['heading']}")
        for row in rows:
            cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
            print("  " + "  ".join(cells).rstrip())
