"""``auv-fault validate``: the diagnosers compared on the validation suite, at one false alarm per hour."""

import sys
from typing import Any

from tqdm import tqdm

from auv_fault_env.errors import finite_in_range, known_name, refusal
from diagnosers import NAMES, ranked
from training.arguments import Validate
from training.benchmark import timing
from training.benchmark.scoring import judge_all
from training.benchmark.validation import Contestant, compare, contestants, note_failure
from training.benchmark.validation_page import page
from training.benchmark.verdicts import (
    BELOW_FILTER_BANK,
    FILTER_BANK,
    INTEGRATED,
    differences,
    verdicts,
)
from training.report.page import print_tables, write_report
from training.report.run_folder import run_folder, write_json
from training.seeds import seeds

LAST_SEED = 90_000_000  # of the parts of the suite, which are 100 million apart
# first seed, within those of validation, of the episodes that the timing runs on
TIMED = 400_000_000


def main(arguments: Validate) -> None:
    """Compare, and write report, figures and results."""
    names = _checked(arguments)
    with run_folder(arguments.output, "validate", arguments) as folder:
        results = validate(arguments, names)
        write_json(folder / "results.json", results)
        write_report(results, folder)
    print_tables(results["sections"][:2])
    print(f"\nreport: {arguments.output / 'index.html'}")


def _checked(arguments: Validate) -> list[str]:
    finite_in_range("lanes", arguments.lanes, 2, 1_000_000)
    finite_in_range("hours", arguments.hours, 0.05, 1000)
    finite_in_range("seed", arguments.seed, 0, LAST_SEED)
    return [
        known_name("diagnoser", name, NAMES)
        for name in dict.fromkeys(arguments.diagnosers or NAMES)
    ]


def validate(arguments: Validate, names: list[str]) -> dict[str, Any]:
    """All results as plain data: the page, and under `scores` every figure by name."""
    entrants, failures = contestants(names)
    costs = _timed(entrants, arguments.seed, failures)
    beliefs = compare(
        {name: entrants[name] for name in costs}, arguments.lanes, arguments.hours, arguments.seed
    )
    failures |= beliefs.failures
    if not beliefs.records:
        raise refusal(
            "diagnosers", list(names), "at least one that works", "see above what ails them"
        )
    seed = arguments.seed
    judged, scores = judge_all(beliefs, seed)
    scores = {name: score | costs[name] for name, score in scores.items()}
    others = {
        INTEGRATED: [name for name in ranked() if name != INTEGRATED],
        FILTER_BANK: BELOW_FILTER_BANK,
    }
    against = {name: differences(judged, name, than, seed) for name, than in others.items()}
    command = (
        f"auv-fault validate --seed {seed} --lanes {arguments.lanes} --hours {arguments.hours:g}"
    )
    command += f" --diagnosers {' '.join(arguments.diagnosers)}" if arguments.diagnosers else ""
    sections = page(
        judged, scores, beliefs.truth["faulty"], against, failures, verdicts(scores, against)
    )
    return sections | {"command": command, "scores": scores, "failures": failures}


def _timed(
    entrants: dict[str, Contestant], seed: int, failures: dict[str, str]
) -> dict[str, dict[str, Any]]:
    costs = {}
    first = seeds("validation", 1, TIMED + seed)[0]
    for name, contestant in tqdm(
        entrants.items(), desc="timing", unit="diagnoser", file=sys.stderr
    ):
        try:
            costs[name] = timing.cost(contestant, first)
        except Exception as error:  # whatever ails one diagnoser, the others are compared
            note_failure(failures, name, error)
    return costs
