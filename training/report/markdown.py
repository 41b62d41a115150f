"""A report as Markdown, text and tables without figures, to be taken over into documents."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

FILE = "report.md"


def write_markdown(results: dict[str, Any], folder: Path) -> None:
    """Write ``report.md``: summary, introduction, command, and the sections with a table."""
    (folder / FILE).write_text(markdown(results), encoding="utf-8")


def markdown(results: dict[str, Any]) -> str:
    """The results of a report (`training.report.page.write_report`) as Markdown."""
    parts = [f"## {results['title']}", *results["summary"], *results["intro"]]
    parts.append(f"Command: `{results['command']}`")
    for section in results["sections"]:
        if "table" in section:
            table = section["table"]
            parts += [f"### {section['heading']}", *section["text"]]
            parts.append(markdown_table(table["columns"], table["rows"]))
    return "\n\n".join(parts) + "\n"


def markdown_table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown; bars within cells are escaped."""
    lines = [_line(columns), "|" + "---|" * len(columns)]
    return "\n".join(lines + [_line(row) for row in rows])


def _line(cells: Sequence[str]) -> str:
    escaped = [cell.replace("|", "\\|") for cell in cells]
    return f"| {' | '.join(escaped)} |"
