"""The tables that every comparison of diagnosers has: who is best, who is left out, and how often alarms are false."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

from training.benchmark.scoring import DECIDED_AT
from training.benchmark.validation import SEVERITY_AT
from training.benchmark.verdicts import ORACLE
from training.metrics.records import HORIZON
from training.report.cells import number, percent, row_name, seconds, with_interval

Scores = Mapping[str, Mapping[str, Any]]
COLUMNS = (
    "diagnoser",
    "isolation, restricted mean [s]",
    "isolated",
    "median [s]",
    "detection, restricted mean [s]",
    f"macro-F1 at {DECIDED_AT:g} s",
    f"severity MAE at {SEVERITY_AT:g} s",
    "90 % covers",
    "ECE",
    "log loss [nat]",
    "× oracle",
)
ALARMS = (
    "threshold, log p(normal)",
    "isolation [s]",
    "detected",
    "false alarms (vehicles)",
    "per hour",
    "as set",
)


def in_order(scores: Scores, references: Collection[str]) -> list[str]:
    """Names by restricted mean isolation time, those that compete first."""
    return sorted(
        scores, key=lambda name: (name in references, scores[name]["isolation"]["restricted_mean"])
    )


def leaderboard(
    scores: Scores, references: Collection[str], heading: str = "Leaderboard"
) -> dict[str, Any]:
    """The main table."""
    return {
        "heading": heading,
        "text": [
            "By restricted mean isolation time. A short one with few faults isolated means that some are missed and "
            "the rest found at once. Macro-F1 is over the classes and normal, one healthy vehicle to four faulty ones. "
            "Severity error and coverage of the 90 % interval are those of the estimate given the true class. "
            "Calibration error and log loss are of beliefs at random instants of the same vehicles. The last column is "
            "the isolation time relative to the oracle's."
        ],
        "table": {
            "columns": list(COLUMNS),
            "rows": [
                [row_name(name, references), *_row(scores, name)]
                for name in in_order(scores, references)
            ],
        },
    }


def _row(scores: Scores, name: str) -> list[str]:
    score = scores[name]
    return [
        with_interval(score["isolation"]["restricted_mean"], score["isolation"]["interval"], 2),
        percent(score["isolation"]["probability"]),
        seconds(score["isolation"]["median"], HORIZON),
        f"{score['detection']['restricted_mean']:.2f}",
        with_interval(score["macro_f1"], score["macro_f1_interval"], 2),
        with_interval(score["severity_mae"], score["severity_mae_interval"], 3),
        percent(score["severity_coverage"]),
        f"{score['ece']:.3f}",
        number(score["log_loss"], 2),
        _of_oracle(scores, name),
    ]


def _of_oracle(scores: Scores, name: str) -> str:
    if ORACLE not in scores:
        return "–"
    return f"{scores[name]['isolation']['restricted_mean'] / scores[ORACLE]['isolation']['restricted_mean']:.2f}"


def by_class(kind: str, scores: Scores, names: Sequence[str]) -> list[list[str]]:
    """Rows of restricted mean times by class; `kind` is "isolation" or "detection"."""
    times = [scores[name][f"{kind}_by_class"] for name in names]
    return [[of_class, *(f"{time[of_class]:.1f}" for time in times)] for of_class in times[0]]


def alarm_cells(score: Mapping[str, Any], mean_time: float) -> list[str]:
    """What `ALARMS` asks of a score whose threshold is set for one false alarm per mean time [s]."""
    return [
        "none, no alarm" if score["threshold"] is None else f"{score['threshold']:.3g}",
        f"{score['isolation']['restricted_mean']:.2f}",
        percent(score["detection"]["probability"]),
        f"{score['false_alarms']} ({score['false_alarm_vehicles']})",
        with_interval(score["false_alarms_per_hour"], score["false_alarms_per_hour_interval"], 2),
        _as_set(score, mean_time),
    ]


def _as_set(score: Mapping[str, Any], mean_time: float) -> str:
    if score["rate_as_set"]:
        return "yes"
    return "no, more" if score["false_alarms_per_hour"] > 3600.0 / mean_time else "no, fewer"


def compute(costs: Scores, names: Iterable[str], references: Collection[str]) -> dict[str, Any]:
    """What an update costs."""
    keys = ("p50_us", "p99_us", "many_lanes_us")
    return {
        "heading": "Compute",
        "text": [
            "Wall-clock microseconds of an update; a sample comes every 100,000. Other work on the machine shows."
        ],
        "table": {
            "columns": [
                "diagnoser",
                "one vehicle, median",
                "99th percentile",
                "per vehicle of 4096",
            ],
            "rows": [
                [row_name(name, references), *(_micro(costs[name][key]) for key in keys)]
                for name in names
            ],
        },
    }


def _micro(duration: float) -> str:
    return f"{duration:,.0f}" if duration >= 100.0 else f"{duration:.3g}"


def left_out(failures: Mapping[str, str]) -> dict[str, Any]:
    """Diagnosers that could not be compared."""
    return {
        "heading": "Left out",
        "text": ["These could not be made, or failed on the way; nothing of them is shown."],
        "table": {
            "columns": ["diagnoser", "why"],
            "rows": [list(item) for item in failures.items()],
        },
    }


def figure_section(
    heading: str, plot: str, name: str, caption: str, data: Mapping[str, Any]
) -> dict[str, Any]:
    """A section of one figure."""
    return {
        "heading": heading,
        "text": [],
        "figures": [{"plot": plot, "name": name, "caption": caption, "data": dict(data)}],
    }
