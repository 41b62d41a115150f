"""The thesis' networks on the operating modes of their own tables.

Run ``python -m training.studies.own_modes``. In the benchmark a diagnoser names one of all classes;
here it is asked only for the modes of Table 5.1 or 5.2, in episodes of faults that have one. The
threshold is set for one false alarm per hour. The filter bank is the mark to compare with. Ideal
vehicles and those with all imperfections are apart.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tqdm import tqdm

from auv_fault_env.errors import finite_in_range
from diagnosers import make
from training.benchmark.assessment import DECISION_TIME
from training.benchmark.own_modes import Episodes, Table, sample_for, scores_on, tables
from training.metrics.records import HORIZON, SEVERITY_AT
from training.report.cells import percent, with_interval
from training.report.sections import table_section
from training.studies.run import command_line, run_study

FIRST_SEED = 740_000_000  # within those of tests
ENTRANTS = {
    "5.1": ("raw_network", "parallel", "filter_bank"),
    "5.2": ("kalman_network", "parallel", "filter_bank"),
}
REALISMS = {"ideal": 0.0, "realism 1": 1.0}
COLUMNS = (
    *("table", "vehicles", "diagnoser", f"macro-F1 at {DECISION_TIME:g} s (95 %)", "detected"),
    *("isolated", f"severity MAE at {SEVERITY_AT:g} s", "false alarms"),
)


@dataclass(frozen=True)
class OwnModesStudy:
    """Score the networks of the thesis on the modes that they were made for."""

    output: Path = Path("runs/own-modes")
    """Folder of the results; an earlier run there is replaced."""
    lanes: int = 280
    """Faulty episodes of each table and realism."""
    hours: float = 4.0
    """Healthy operation that sets the thresholds, and as much that counts false alarms [h]."""
    seed: int = 0
    """Offset within the seeds of tests, and seed of the bootstrap."""


def main(arguments: OwnModesStudy) -> None:
    """Score, and write the results."""
    finite_in_range("lanes", arguments.lanes, 12, 10_000)
    finite_in_range("hours", arguments.hours, 0.1, 1000.0)
    run_study("own_modes", arguments, lambda folder: study(arguments))


def study(arguments: OwnModesStudy) -> dict[str, Any]:
    """Scores by table, realism and diagnoser, as plain data and as tables."""
    scores = {
        number: {
            kind: scores_of(number, table, realism, arguments)
            for kind, realism in tqdm(REALISMS.items(), desc=f"Table {number}")
        }
        for number, table in tables().items()
    }
    sections = [score_section(scores)]
    for number, table in tables().items():
        sections.append(reason_section(number, table, scores[number]))
    for number, table in tables().items():
        sections += confusion_sections(number, table, scores[number])
    return {
        "title": "The thesis' networks on their own modes",
        "summary": summary(scores),
        "intro": [],
        "scores": scores,
        "sections": sections,
    }


def summary(scores: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> list[str]:
    """How the first network of each table compares with the filter bank."""
    sentences = ["The networks of the thesis were asked for the modes of their own tables only."]
    for number, by_kind in scores.items():
        network = ENTRANTS[number][0]
        mark = ENTRANTS[number][-1]
        shares = {
            name: " and ".join(
                percent(of[name]["isolation"]["probability"]) for of in by_kind.values()
            )
            for name in (network, mark)
        }
        sentences.append(
            f"Table {number}, vehicles {' and '.join(by_kind)}: {network} isolates "
            f"{shares[network]} of the faults; {mark}, the mark to reach, {shares[mark]}."
        )
    return sentences


def scores_of(
    number: str, table: Table, realism: float, arguments: OwnModesStudy
) -> dict[str, dict[str, Any]]:
    """Scores by diagnoser on the same episodes."""
    first = FIRST_SEED + arguments.seed
    which = Episodes("test", first, arguments.lanes, arguments.hours, realism)
    sample = sample_for(table, which)
    return {name: scores_on(make(name), table, sample, arguments.seed) for name in ENTRANTS[number]}


def score_section(scores: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> dict[str, Any]:
    """The table of the scores."""
    rows = [
        [f"Table {number}", kind, name, *cells(number, score)]
        for number, by_kind in scores.items()
        for kind, by_name in by_kind.items()
        for name, score in by_name.items()
    ]
    text = (
        "Port and starboard are one mode. Detected and isolated: for good within "
        f"{HORIZON:g} s of the onset, at the threshold for one false alarm per hour. Table 5.1 has "
        "no severity."
    )
    return table_section("Scores on the modes of a table", COLUMNS, rows, text)


def cells(number: str, score: Mapping[str, Any]) -> list[str]:
    """The cells of a row, from the macro-F1 on."""
    has_severity = number == "5.2"
    return [
        with_interval(score["macro_f1"], score["macro_f1_interval"], 2),
        percent(score["detection"]["probability"]),
        percent(score["isolation"]["probability"]),
        f"{score['severity_mae']:.2f}" if has_severity else "-",
        f"{score['false_alarms']} in {score['hours']:.1f} h",
    ]


def reason_section(
    number: str, table: Table, by_kind: Mapping[str, Mapping[str, Any]]
) -> dict[str, Any]:
    """Whether a mode is missed because it raises no alarm or because another one is named."""
    rows = []
    for kind, by_name in by_kind.items():
        for name, score in by_name.items():
            lanes = [sum(counts) for counts in score["confusion"][1:]]
            counted = zip(score["named"], score["in_alarm"], lanes, strict=True)
            rows.append(
                [kind, name, *(f"{named}; {alarms} of {total}" for named, alarms, total in counted)]
            )
    text = (
        f"Vehicles of each mode {DECISION_TIME:g} s after the onset: how many have the true fault "
        "as their most probable one, in alarm or not; and how many are in alarm. A mode that is "
        "named but raises no alarm is missed because healthy vehicles look as faulty once an hour."
    )
    heading = f"Table {number}: the right name, and the alarm, by true mode"
    return table_section(heading, ["vehicles", "diagnoser", *table.modes[1:]], rows, text)


def confusion_sections(
    number: str, table: Table, by_kind: Mapping[str, Mapping[str, Any]]
) -> list[dict[str, Any]]:
    """The confusion tables of the diagnosers on a table's modes."""
    sections = []
    for kind, by_name in by_kind.items():
        for name, score in by_name.items():
            rows = [
                [mode, *map(str, counts)]
                for mode, counts in zip(table.modes, score["confusion"], strict=True)
            ]
            heading = f"Table {number}, {kind}: {name}, true mode against named one"
            sections.append(table_section(heading, ["true mode", *table.modes], rows))
    return sections


if __name__ == "__main__":
    command_line(main)
