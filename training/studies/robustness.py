"""What diagnosers do where the world is not exactly their model.

Run ``python -m training.studies.robustness``. The thresholds are set for one false alarm per hour
and per ten hours on healthy hours with imperfections, seeds of calibration; every row then
measures on other seeds. ``--rows`` chooses rows; ``--purpose validation`` is for tuning, so that
the seeds of tests stay unseen.
"""

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from tqdm import tqdm

from auv_fault_env.errors import finite_in_range, known_name
from diagnosers import NAMES
from training.report.sections import table_section
from training.studies.robustness_rows import ROWS, Finding, Study
from training.studies.robustness_runs import FIRST_ROW, MOST_RUNS, Runs
from training.studies.run import command_line, run_study

N_MISSED = 5  # missed targets that the summary names


@dataclass(frozen=True)
class RobustnessStudy:
    """Measure false alarms, names and delays where the model does not hold."""

    output: Path = Path("runs/robustness")
    """Folder of the results; an earlier run there is replaced."""
    diagnoser: str = "filter_bank"
    """Diagnoser of the registry."""
    rows: tuple[str, ...] = ()
    """Rows to measure; all if none is named."""
    purpose: Literal["test", "validation"] = "test"
    """Seeds to measure on; take validation to tune."""
    hours: float = 60.0
    """Healthy operation on which the thresholds are set, and the row `all` counts [h]."""
    effect_hours: float = 10.0
    """Healthy operation with each effect alone [h]."""
    workers: int = -1
    """Processes at work; -1 for one per core."""
    seed: int = 0
    """Number of the run; each has other vehicles."""


def main(arguments: RobustnessStudy) -> None:
    """Measure, and write the table."""
    known_name("diagnoser", arguments.diagnoser, NAMES)
    for name in arguments.rows:
        known_name("row", name, ROWS)
    finite_in_range("hours", arguments.hours, 1.0, 1000.0)
    finite_in_range("effect_hours", arguments.effect_hours, 0.1, 1000.0)
    finite_in_range("seed", arguments.seed, 0, MOST_RUNS - 1)
    run_study("robustness", arguments, lambda folder: study(arguments))


def study(arguments: RobustnessStudy) -> dict[str, Any]:
    """Findings by row, as plain data and as a table."""
    runs = Runs(
        diagnoser=arguments.diagnoser,
        purpose=arguments.purpose,
        hours=arguments.hours,
        workers=arguments.workers,
        seed=arguments.seed,
    )
    found: dict[str, list[Finding]] = {}
    numbers = {name: number for number, name in enumerate(ROWS, FIRST_ROW)}
    chosen = [name for name in ROWS if not arguments.rows or name in arguments.rows]
    for name in tqdm(chosen, unit="row"):
        found[name] = ROWS[name](Study(runs, arguments.effect_hours, numbers[name]))
        for one in found[name]:
            tqdm.write(f"{name}, {one.case}: {one.measured}", file=sys.stderr)
    thresholds = runs.thresholds_if_set
    return {
        "title": f"{arguments.diagnoser} where the model does not hold",
        "summary": summary(arguments.diagnoser, found),
        "intro": [
            "What the diagnoser does where vehicles, sensors or surroundings are not those of its "
            "model. The rows are explained in docs/suites.md. Reached is empty where nothing is "
            "to be reached, or nothing was alarmed of which it could be judged."
        ],
        "thresholds": dict(thresholds),
        "rows": {name: [one._asdict() for one in findings] for name, findings in found.items()},
        "sections": [section(found, thresholds)],
    }


def summary(diagnoser: str, found: Mapping[str, list[Finding]]) -> list[str]:
    """How many targets are reached, and which are not."""
    judged = [
        (name, one)
        for name, findings in found.items()
        for one in findings
        if one.reached is not None
    ]
    missed = [f"{name}, {one.case} ({one.measured})" for name, one in judged if not one.reached]
    sentences = [
        f"{diagnoser} was tried in {len(found)} kinds of deviation from its model; "
        f"{len(judged) - len(missed)} of {len(judged)} targets are reached.",
    ]
    if missed:
        shown = "; ".join(missed[:N_MISSED])
        rest = len(missed) - N_MISSED
        sentences.append(f"Not reached: {shown}{f'; and {rest} more' if rest > 0 else ''}.")
    else:
        sentences.append("No target is missed.")
    return sentences


def section(found: Mapping[str, list[Finding]], thresholds: Mapping[str, float]) -> dict[str, Any]:
    """The table of all findings."""
    words = {True: "yes", False: "no", None: ""}
    rows = [
        [name, one.case, one.measured, one.to_reach, words[one.reached]]
        for name, findings in found.items()
        for one in findings
    ]
    levels = [f"one per {rate}: {level:.3f}" for rate, level in thresholds.items()]
    return table_section(
        "Findings",
        ["row", "case", "measured", "to reach", "reached"],
        rows,
        "Thresholds of log p(normal), set on hours of their own: "
        f"{', '.join(levels) or 'none'}. Intervals of rates are Poisson's, those of times "
        "bootstrap intervals, 95 % both.",
    )


if __name__ == "__main__":
    command_line(main)
