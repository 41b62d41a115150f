"""Reports made from results alone: one ``index.html`` with its figures, and tables as text."""

import base64
import io
import re
from collections.abc import Iterable, Sequence
from importlib.resources import files
from itertools import zip_longest
from pathlib import Path
from textwrap import wrap
from typing import Any, NamedTuple

from jinja2 import Environment
from markupsafe import Markup, escape

from training.report.figures.registry import draw

N_PRINTED_COLUMNS = 6
PRINTED_WIDTH = 120  # characters of a terminal
MARGIN = "  "  # left of a column
WIDE = 6  # columns from which long names in a table may break
LONG_WORD = re.compile(r"\S{21,}")
JOINT = re.compile(r"(?<=\w)([_:/])(?=\w)")
# up to the first full stop that ends a sentence
FIRST_SENTENCE = re.compile(r"(?:Figs?\. |[^.]|\.(?! |$))*")


class ShownFigure(NamedTuple):
    """A figure of the page: number, title for the list of figures, and SVG in base64."""

    number: int
    title: str
    image: str


def write_report(results: dict[str, Any], folder: Path) -> None:
    """Write the figures of `results` into ``figures/`` and ``index.html``, which contains them.

    Parameters
    ----------
    results
        title, summary, intro, command and sections. The summary says in 2 to 5 sentences what was
        run, what came out and whether that is good; the intro, paragraphs that may be none, how
        to read the page; the command how to reproduce it, and nothing else repeats it. A section
        has a heading, text (list of paragraphs) and optionally a table (columns, rows) and
        figures (plot: name in `PLOTS`, data, name, caption); the first sentence of a caption is
        the figure's title. Texts have code between backticks.
    folder
        Folder to write into; it must not have a ``figures/`` yet.
    """
    figure_folder = folder / "figures"
    figure_folder.mkdir()
    figures: dict[str, ShownFigure] = {}
    for section in results["sections"]:
        for figure in section.get("figures", ()):
            title = FIRST_SENTENCE.match(figure["caption"])[0]
            image = _write_figure(figure, figure_folder)
            figures[figure["name"]] = ShownFigure(len(figures) + 1, title, image)
    source = files("training.report").joinpath("report.html.j2").read_text(encoding="utf-8")
    environment = Environment(autoescape=True)
    environment.filters["code"] = _with_code
    environment.filters["cell"] = _cell
    page = environment.from_string(source).render(results=results, figures=figures)
    (folder / "index.html").write_text(page, encoding="utf-8", errors="backslashreplace")


def _with_code(text: str) -> Markup:
    """The text as HTML, what stands between backticks as code."""
    return Markup(re.sub("`([^`]+)`", r"<code>\1</code>", str(escape(text))))


def _cell(text: str, n_columns: int) -> Markup:
    """The text of a cell: no break within an interval; in wide tables breaks within long names."""
    whole_intervals = text.replace("–", "\u2060–\u2060")
    html = str(_with_code(whole_intervals))
    if n_columns >= WIDE:
        html = LONG_WORD.sub(lambda word: JOINT.sub(r"\1<wbr>", word[0]), html)
    return Markup(html)


def _write_figure(figure: dict[str, Any], folder: Path) -> str:
    """Write the figure as PNG; returns it as SVG in base64."""
    plot = draw(figure["plot"], figure["data"])
    plot.savefig(folder / f"{figure['name']}.png", dpi=110)
    buffer = io.BytesIO()
    plot.savefig(buffer, format="svg")
    return base64.b64encode(buffer.getvalue()).decode()


def print_tables(sections: Iterable[dict[str, Any]], whole: bool = False) -> None:
    """Print the tables of the sections as text, the first six columns of each or the whole."""
    for section in sections:
        if "table" in section:
            print(f"\n{section['heading']}")
            _print_table(section["table"], None if whole else N_PRINTED_COLUMNS)


def _print_table(table: dict[str, Any], n_columns: int | None) -> None:
    rows = [row[:n_columns] for row in (table["columns"], *table["rows"])]
    widths = _widths(list(zip(*rows, strict=True)))
    for row in rows:
        cells = [
            wrap(cell, width, break_on_hyphens=False)
            for cell, width in zip(row, widths, strict=True)
        ]
        for line in zip_longest(*cells, fillvalue=""):
            padded = [part.ljust(width) for part, width in zip(line, widths, strict=True)]
            print((MARGIN + MARGIN.join(padded)).rstrip())


def _widths(columns: Sequence[Sequence[str]]) -> list[int]:
    """Widths of the columns within `PRINTED_WIDTH`: the widest that has several words gives way."""
    widths = [max(map(len, cells)) for cells in columns]
    words = [max(map(len, " ".join(cells).split()), default=0) for cells in columns]
    while sum(widths) + len(MARGIN) * len(widths) > PRINTED_WIDTH:
        divisible = [k for k, width in enumerate(widths) if width > words[k]]
        widest = max(divisible or range(len(widths)), key=widths.__getitem__)
        widths[widest] -= 1
    return widths
