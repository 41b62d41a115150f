"""The tables of the leaderboard, as Markdown."""

import shlex
from collections.abc import Callable, Mapping
from pathlib import Path

from auv_fault_env.errors import refusal
from training.report.cells import with_interval
from training.report.markdown import markdown_table
from training.submissions.draw import Recipe
from training.submissions.row import Row
from training.submissions.scoring import Figure

BEGIN = "<!-- written by auv-fault leaderboard -->\n"
END = "<!-- until here -->\n"
UNVERIFIED = "own: unverified"
SHOWN = 12  # digits of a digest


def _number(digits: int) -> Callable[[Figure], str]:
    return lambda figure: with_interval(*figure, digits)


def _share(figure: Figure) -> str:
    low, high = figure.interval
    return f"{100 * figure.value:.0f} % ({100 * low:.0f}–{100 * high:.0f})"


COLUMNS: dict[str, tuple[str, Callable[[Figure], str]]] = {
    "isolation": ("isolation [s]", _number(2)),
    "isolated": ("isolated", _share),
    "detection": ("detection [s]", _number(2)),
    "detected": ("detected", _share),
    "false_alarms_per_hour": ("false alarms per hour", _number(2)),
    "declared_right": ("declared right", _share),
    "declared_wrong": ("wrong", _share),
    "abstained": ("abstained", _share),
    "macro_f1": ("macro-F1 at 10 s", _number(2)),
}


def with_tables(page: str, rows: Mapping[Path, Row], origin: Path) -> str:
    """The page with the tables of these rows between its marks; refused without the marks."""
    before, mark, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not mark or not end:
        allowed = f"one with the lines {BEGIN.strip()} and {END.strip()}"
        raise refusal("page", str(origin), allowed, "put them in")
    return f"{before}{BEGIN}{tables(rows, origin.parent)}{END}{after}"


def tables(rows: Mapping[Path, Row], folder: Path) -> str:
    """The rows by recipe; links to their files are relative to the folder of the page."""
    recipes = sorted({row.recipe for row in rows.values()}, key=_order)
    return "".join(
        _section(recipe, {path: row for path, row in rows.items() if row.recipe == recipe}, folder)
        for recipe in recipes
    )


def command(row: Row) -> str:
    """The command that scores the submission of a row again."""
    recipe = row.recipe
    words = ["auv-fault", "submit", row.target]
    further = [name for name in row.files if name != row.target.rpartition(":")[0]]
    if row.target.rpartition(":")[0].endswith(".py") and further:
        words += ["--files", *further]
    words += ["--suite", recipe.suite, "--lanes", str(recipe.lanes)]
    words += ["--hours", f"{recipe.hours:.12g}"]
    words += ["--counting-hours", f"{recipe.counting_hours:.12g}", "--nonce", row.nonce]
    if row.nonce_from is not None:
        words += ["--nonce-from", row.nonce_from]
    return shlex.join(words)


def _order(recipe: Recipe) -> tuple[str, int, float, float]:
    return recipe.suite, -recipe.lanes, -recipe.hours, -recipe.counting_hours


def _origin_of_nonce(row: Row) -> str:
    if row.nonce_from is None:
        return UNVERIFIED
    shown = row.nonce_from.replace("`", "'")
    return f"`{shown}`"


def _broken(line: str) -> str:
    """A command in two lines, which the width of a page holds."""
    return line.replace(" --suite ", " \\\n        --suite ", 1)


def _section(recipe: Recipe, rows: Mapping[Path, Row], folder: Path) -> str:
    ascending = sorted(rows.items(), key=lambda item: item[1].figures["isolation"].value)
    figures = [
        [row.name, *(cell(row.figures[key]) for key, (_, cell) in COLUMNS.items())]
        for _, row in ascending
    ]
    origins = [
        [
            row.name,
            f"`{row.digest[:SHOWN]}`",
            _origin_of_nonce(row),
            str(row.seeds["faulty"]["first"]),
            f"{row.update['p50_us']:.0f}",
            f"{row.scored_by['version']}, `{row.scored_by['code']}`",
            f"[{path.name}]({path.relative_to(folder).as_posix()})",
        ]
        for path, row in ascending
    ]
    headings = ["diagnoser", *(heading for heading, _ in COLUMNS.values())]
    of_origin = ["diagnoser", "submission", "nonce", "first seed", "update, median [µs]"]
    of_origin += ["scored by version, code", "row"]
    commands = "".join(f"    {_broken(command(row))}\n" for _, row in ascending)
    return (
        f"\n### Recipe {recipe.about}\n\n"
        f"{markdown_table(headings, figures)}\n\n"
        f"{markdown_table(of_origin, origins)}\n\n{commands}\n"
    )
