"""The tables that comparisons of diagnosers have: leaderboard, false alarms, compute, failures."""

from collections.abc import Collection, Iterable, Mapping
from typing import Any

from training.benchmark.scores import METRICS, Score
from training.report.cells import percent, row_name, with_interval
from training.report.sections import table_section

Scores = Mapping[str, Score]
ORACLE = "oracle"
COLUMNS = tuple(column for metric in METRICS for column in metric.columns)
ALARM_COLUMNS = (
    "threshold, log p(normal)",
    "isolation [s]",
    "detected",
    "false alarms (vehicles)",
    "per hour",
    "time in alarm",
    "as set",
)
COMPUTE_COLUMNS = {
    "p50_us": "one vehicle, median",
    "p99_us": "99th percentile",
    "many_lanes_us": "per vehicle of 4096",
}


def in_order(scores: Scores, references: Collection[str]) -> list[str]:
    """Names by restricted mean isolation time, references last."""
    times = {name: score["isolation"]["restricted_mean"] for name, score in scores.items()}
    return sorted(scores, key=lambda name: (name in references, times[name]))


def leaderboard(scores: Scores, references: Collection[str], heading: str) -> dict[str, Any]:
    """The main table."""
    has_oracle = ORACLE in scores
    headings = [column.heading for column in COLUMNS]
    rows = []
    for name in in_order(scores, references):
        cells = [column.cell(scores[name]) for column in COLUMNS]
        relative = [_relative_to_oracle(scores, name)] if has_oracle else []
        rows.append([row_name(name, references), *cells, *relative])
    text = (
        "By restricted mean isolation time. A short time with few faults isolated means that "
        "some faults are missed and the rest isolated at once. Macro-F1 is over the classes "
        "and normal, one healthy vehicle to four faulty ones. Severity error and coverage of "
        "the 90 % interval are those of the estimate given the true class. Calibration error "
        "(ECE) and log loss are of beliefs at random instants of the same vehicles; the log loss "
        "is infinite if a truth was held impossible."
    )
    if has_oracle:
        headings.append("× oracle")
        text += " The last column is the isolation time divided by the oracle's."
    return table_section(heading, ["diagnoser", *headings], rows, text)


def _relative_to_oracle(scores: Scores, name: str) -> str:
    time = scores[name]["isolation"]["restricted_mean"]
    oracle_time = scores[ORACLE]["isolation"]["restricted_mean"]
    return f"{time / oracle_time:.2f}"


def alarm_cells(score: Score, mean_time: float) -> list[str]:
    """Cells of `ALARM_COLUMNS`, the threshold set for one false alarm per mean time [s]."""
    threshold = score["threshold"]
    per_hour = score["false_alarms_per_hour"]
    direction = "more" if per_hour > 3600.0 / mean_time else "fewer"
    return [
        "none, no alarm" if threshold is None else f"{threshold:.3g}",
        f"{score['isolation']['restricted_mean']:.2f}",
        percent(score["detection"]["probability"]),
        f"{score['false_alarms']} ({score['false_alarm_vehicles']})",
        with_interval(per_hour, score["false_alarms_per_hour_interval"], 2),
        percent(score["time_in_alarm"]),
        "yes" if score["rate_as_set"] else f"no, {direction}",
    ]


def compute_table(
    costs: Scores, names: Iterable[str], references: Collection[str]
) -> dict[str, Any]:
    """What an update costs."""
    rows = []
    for name in names:
        cells = [_microseconds(costs[name][key]) for key in COMPUTE_COLUMNS]
        rows.append([row_name(name, references), *cells])
    return table_section(
        "Compute",
        ["diagnoser", *COMPUTE_COLUMNS.values()],
        rows,
        "Wall-clock microseconds of an update; a sample comes every 100,000 microseconds. Other "
        "work on the machine makes them longer.",
    )


def _microseconds(duration: float) -> str:
    return f"{duration:,.0f}" if duration >= 100.0 else f"{duration:.3g}"


def failures_table(failures: Mapping[str, str]) -> dict[str, Any]:
    """Diagnosers that could not be compared."""
    text = "These could not be created, or failed during the run; they have no results."
    rows = [list(item) for item in failures.items()]
    return table_section("Left out", ["diagnoser", "reason"], rows, text)
