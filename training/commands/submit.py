"""``auv-fault submit``: a diagnoser from elsewhere on a suite that it cannot know."""

import os
import tempfile
from pathlib import Path

from auv_fault_env.errors import refusal
from training.arguments import Submit
from training.commands.benchmark import ALL_CORES
from training.report.cells import counted, file_name
from training.report.page import print_tables
from training.report.run_folder import provenance
from training.report.sections import table_section
from training.report.whole_file import write_whole
from training.submissions.draw import Draw, Recipe
from training.submissions.page import COLUMNS
from training.submissions.row import Row, row_of
from training.submissions.scoring import examine, figures, scoring_code
from training.submissions.submission import Submission, submission_of

NONCE_BYTES = 16


def main(arguments: Submit) -> None:
    """Score the submission and write its row, or print its digest."""
    recipe = Recipe(arguments.suite, arguments.lanes, arguments.hours, arguments.counting_hours)
    with tempfile.TemporaryDirectory() as folder:
        submission = submission_of(arguments.target, arguments.files, Path(folder).resolve())
        print(f"submission: {submission.digest}, {counted(len(submission.files), 'file')}")
        print(f"recipe: {recipe.about}")
        if not arguments.digest:
            _score(arguments, recipe, submission)


def _score(arguments: Submit, recipe: Recipe, submission: Submission) -> None:
    if arguments.nonce is None and arguments.nonce_from is not None:
        thing = "nonce-from"
        raise refusal(thing, arguments.nonce_from, "the origin of --nonce", "give the nonce too")
    if arguments.output is not None:
        _require_new(arguments.output)
    nonce = os.urandom(NONCE_BYTES).hex() if arguments.nonce is None else arguments.nonce
    draw = Draw(recipe, submission.digest, nonce)
    limit = arguments.time_limit
    examined = examine(submission.party, limit)
    default = Path("runs/submit") / f"{file_name(examined.name)}-{recipe.suite}.json"
    output = arguments.output or default
    _require_new(output)
    workers = ALL_CORES if arguments.workers is None else arguments.workers
    found = figures(draw.plan, examined.name, submission.party, limit, workers)
    origin = provenance()
    scored_by = {
        "version": origin["versions"]["auv-fault"],
        "revision": origin["revision"],
        "code": scoring_code(),
    }
    row = row_of(
        draw,
        submission.target,
        submission.files,
        arguments.nonce_from,
        examined,
        found,
        scored_by,
    )
    write_whole(output, row.text().encode())
    _print(row)
    print(f"\nrow: {output}")


def _require_new(output: Path) -> None:
    if os.path.lexists(output):
        raise refusal("output", str(output), "a new file", "choose another --output")


def _print(row: Row) -> None:
    cells = [[heading, cell(row.figures[key])] for key, (heading, cell) in COLUMNS.items()]
    print_tables([table_section(row.name, ["figure", "value (95 %)"], cells)])
