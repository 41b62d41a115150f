"""Planning against other stimuli on validation seeds: ``python -m training.studies.planning``.

Vehicles under the conditions of a suite have an abrupt fault of hull, propellers or paddle wheel; a
lost propeller is lost as a whole, which episodes of the frozen suites do not ensure. Healthy ones
give the healthy cost, and each stimulus its own threshold of one false alarm per hour.

The first point is the reference of the others.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from tyro.conf import arg

from auv_fault_env.errors import finite_in_range, known_name, whole_number
from auv_fault_env.faults import classes
from training.benchmark import suites
from training.benchmark.suites import IDEAL, Conditions
from training.benchmark.trials import FAULTY, THRESHOLD, lane_truth
from training.known_names import SUITES
from training.report.sections import Section, table_section
from training.studies.run import command_line, run_study
from training.studies.stimulus_behaviour import faulty_lanes, healthy_lanes
from training.studies.stimulus_comparisons import SUBSETS
from training.studies.stimulus_front_runs import FrontLanes, Point, point_of, read_runs
from training.studies.stimulus_front_scores import compared, detected, threshold_at

HOUR = 3600.0  # s between false alarms
# offsets within the validation seeds, each for itself
LARGEST_SEED = 10_000_000
POINTS = ("thesis:0.0762", "standing_surge:0.2", "planner:0.25")
COLUMNS = (
    *("stimulus and budget [m/s]", "healthy rms [m/s]", "log p", "isolation [s]"),
    *("ratio (95 %)", "difference [s]"),
)


@dataclass(frozen=True)
class Planning:
    """Compare stimuli on abrupt faults, on validation seeds."""

    points: Annotated[tuple[str, ...], arg(metavar="STIMULUS:BUDGET")] = POINTS
    """Stimuli with their budgets [m/s]; the first is the reference."""
    suite: str = IDEAL
    """Suite that gives the conditions."""
    per_class: int = 32
    """Faulty vehicles of each class."""
    hours: float = 5.0
    """Healthy operation for cost and threshold of each point [h]."""
    workers: int = 2
    """Number of processes; the results do not depend on it."""
    seed: int = 0
    """Offset within the seeds of validation, and seed of the bootstrap intervals."""
    output: Path = Path("runs/planning")
    """Folder of the report; an earlier run there is replaced."""
    cache: Path = Path("runs/planning-cache")
    """Folder of finished closed loops, from which an interrupted run goes on."""


def main(arguments: Planning) -> None:
    """Run the points and write results and page."""
    whole_number("per_class", arguments.per_class)
    whole_number("workers", arguments.workers)
    finite_in_range("hours", arguments.hours, 0.01, 100.0)
    finite_in_range("seed", arguments.seed, 0, LARGEST_SEED)
    known_name("suite", arguments.suite, SUITES)
    points = [point_of(text) for text in dict.fromkeys(arguments.points)]
    run_study("planning", arguments, lambda _: study(arguments, points))


def study(arguments: Planning, points: Sequence[Point]) -> dict[str, Any]:
    """Rows of the table, and the page."""
    lanes = lanes_of(arguments)
    truth = lane_truth(lanes.conditions, lanes.episodes[FAULTY]).at_instants
    reference: np.ndarray | None = None
    rows: list[dict[str, Any]] = []
    for point, runs in read_runs(arguments.cache, points, lanes, arguments.workers):
        threshold = threshold_at(runs[THRESHOLD].log_normal, HOUR)
        found = detected(runs[FAULTY], threshold.value, truth.fault, truth.onset)
        times = found.isolation.time[None]
        reference = times if reference is None else reference
        cost = math.sqrt(runs[THRESHOLD].offset_square.mean())
        figures = compared(times, reference, arguments.seed)
        by_class = {
            name: float(times[0, truth.fault == classes().index(name)].mean())
            for name in SUBSETS["confounded"]
        }
        row: dict[str, Any] = {
            "healthy_rms": cost,
            "threshold": threshold.value,
            "by_class": by_class,
        }
        rows.append(point._asdict() | row | figures)
    return {
        "points": rows,
        "title": "Planning at equal healthy cost",
        "summary": summary(rows, len(truth.fault), arguments),
        "intro": [],
        "sections": [_section(rows)],
    }


def summary(rows: Sequence[dict[str, Any]], n_faulty: int, arguments: Planning) -> list[str]:
    """What was run, and which point is the quickest."""
    best = min(rows, key=lambda row: row["mean"][0])
    return [
        f"{n_faulty} vehicles with abrupt faults of hull, propellers and paddle wheel run under "
        f"the conditions of {arguments.suite}, and healthy ones for {arguments.hours:g} h.",
        f"{_label(best)} is the quickest: it isolates in {best['mean'][0]:.2f} s, "
        f"{_triple(best['ratio'])} times as long as {_label(rows[0])}, at a healthy cost of "
        f"{best['healthy_rms']:.3f} m/s.",
    ]


def lanes_of(arguments: Planning) -> FrontLanes:
    """The vehicles that all points run on."""
    suite = suites.load(arguments.suite)
    conditions = Conditions(**vars(suite.conditions) | {"whole_missions": None})
    chosen = SUBSETS["confounded"]
    every_class = faulty_lanes(conditions, arguments.per_class, arguments.seed)
    label = lane_truth(conditions, every_class).at_instants.fault
    names = [classes()[k] for k in label]
    faulty = [one for one, name in zip(every_class, names, strict=True) if name in chosen]
    n_healthy = math.ceil(HOUR * arguments.hours / conditions.duration)
    healthy = healthy_lanes(conditions, n_healthy, arguments.seed)
    return FrontLanes(conditions, {FAULTY: faulty, THRESHOLD: healthy})


def _section(rows: Sequence[dict[str, Any]]) -> Section:
    lines = [
        [
            _label(row),
            f"{row['healthy_rms']:.4f}",
            f"{row['threshold']:.2f}",
            _triple(row["mean"]),
            _triple(row["ratio"]),
            _triple(row["difference"], "+"),
        ]
        for row in rows
    ]
    text = "Ratio and difference are those to the first stimulus, on the same vehicles."
    return table_section("Isolation of hull, propellers and paddle wheel", COLUMNS, lines, text)


def _label(row: dict[str, Any]) -> str:
    return Point(row["stimulus"], row["strength"]).label


def _triple(figure: Sequence[float], sign: str = "") -> str:
    value, low, high = (f"{number:{sign}.2f}" for number in figure)
    return f"{value} ({low} to {high})"


if __name__ == "__main__":
    command_line(main)
