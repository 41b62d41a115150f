"""Section VI.B of the report: both networks in parallel, and one integrated network."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from diagnosers import ranked
from training.benchmark.assessment import DECISION_TIME, Assessment
from training.benchmark.differences import difference
from training.metrics.plain import rounded
from training.metrics.records import HORIZON
from training.report.sections import figure, table_section
from training.thesis.comparison import COLUMNS, Comparison
from training.thesis.recommendation import compare

NAMES = ("raw_network", "kalman_network", "parallel", "integrated")
PAIRS = [
    ("parallel", "raw_network"),
    ("parallel", "kalman_network"),
    ("integrated", "parallel"),
]
THESIS = {"parallel": "would certainly be capable", "integrated": "another approach"}
LANES = 400  # faulty vehicles
HOURS = 8.0  # healthy operation, twice
SEED = 0  # first seed within those of validation


def section(comparison: Comparison) -> dict[str, Any]:
    """Run the four diagnosers over a small part of the validation suite, and compare them."""
    results = compare(NAMES, LANES, HOURS, SEED)
    return section_of_assessments(comparison, *results)


def section_of_assessments(
    comparison: Comparison,
    assessments: Mapping[str, Assessment],
    scores: Mapping[str, Mapping[str, Any]],
    failures: Mapping[str, str],
) -> dict[str, Any]:
    """The section as plain data; `failures` are the reasons of diagnosers that could not run."""
    text = (
        "The thesis suggests two ways to diagnose the motor system and the hull at once: both "
        "networks side by side, which 'would certainly be capable', or one network on the sensors "
        f"and the filter's estimates. Both are built. {LANES} vehicles with one fault each of "
        "every class, default noise, disturbance and healthy band, half with the thesis' stimulus; "
        f"at thresholds for one false alarm per hour, set on {HOURS:g} h of healthy operation. "
        f"Faults not isolated within {HORIZON:g} s count with {HORIZON:g} s. The sample is small: "
        "auv-fault validate compares all diagnosers on more. Verdicts of this table are under "
        "noise; the parallel networks agree with the thesis if they beat each network alone, by "
        "the margin in their row."
    )
    absences = [f"{name} could not take part: {reason}" for name, reason in failures.items()]
    rows = [score_row(comparison, name, scores.get(name)) for name in NAMES]
    rows += [difference_row(comparison, assessments, *pair) for pair in PAIRS]
    figures = [isolation_figure(assessments)] if assessments else []
    heading = "VI.B: the recommendation followed"
    return table_section(heading, COLUMNS, rows, text, *absences) | {"figures": figures}


def isolation_figure(assessments: Mapping[str, Assessment]) -> dict[str, Any]:
    """Share isolated against time since onset."""
    time = np.linspace(0.0, HORIZON, 301)
    names = list(assessments)[::-1]
    shares = {}
    for name in names:
        isolation = assessments[name].isolation
        isolated = (isolation.time <= time[:, None]) & ~isolation.censored
        shares[name] = rounded(isolated.mean(axis=1))
    references = [name for name in names if name not in ranked()]
    caption = (
        "Share of the faults isolated for good by a time since onset; the area above a line is "
        "its restricted mean."
    )
    data = {"time": rounded(time, 1), "shares": shares, "references": references}
    return figure("isolation_curves", "isolation", caption, data)


def score_row(comparison: Comparison, name: str, score: Mapping[str, Any] | None) -> list[str]:
    """The scores of one diagnoser; None if it could not take part."""
    quantity = (
        f"{name}: restricted mean isolation time; share isolated; macro-F1 at {DECISION_TIME:g} s"
    )
    texts = ["-", "not judged", "It could not take part."]
    if score is not None:
        ours, why = _score_texts(score)
        texts = [ours, "-", why]
    return ["VI.B", quantity, "-", "-", *texts, comparison.command]


def _score_texts(score: Mapping[str, Any]) -> tuple[str, str]:
    isolation = score["isolation"]
    mean = isolation["restricted_mean"]
    percent = 100 * isolation["probability"]
    low, high = isolation["interval"]
    why = (
        f"95 % interval of the time {low:.1f} to {high:.1f} s. False alarms "
        f"{score['false_alarms_per_hour']:.1f} per hour on other healthy vehicles; severity error "
        f"{score['severity_mae']:.2f}, calibration error {score['ece']:.3f}."
    )
    return f"{mean:.1f} s; {percent:.0f} %; {score['macro_f1']:.2f}", why


def difference_row(
    comparison: Comparison,
    assessments: Mapping[str, Assessment],
    name: str,
    rival: str,
) -> list[str]:
    """Whether one diagnoser beats another on the same vehicles."""
    quantity = f"{name} minus {rival}: isolation time; macro-F1 at {DECISION_TIME:g} s"
    if name not in assessments or rival not in assessments:
        texts = [
            THESIS[name],
            "-",
            "-",
            "not judged",
            "One of them could not take part.",
        ]
        return ["VI.B", quantity, *texts, comparison.command]
    paired = difference(assessments[name], assessments[rival], SEED)
    time, time_low, time_high = paired.isolation
    f1, f1_low, f1_high = paired.macro_f1
    verdict = "better on both" if paired.is_better else "not better on both"
    why = (
        f"95 % paired intervals {time_low:+.1f} to {time_high:+.1f} s and {f1_low:+.2f} to "
        f"{f1_high:+.2f}. {name} is {verdict}."
    )
    ours = f"{time:+.1f} s; {f1:+.2f}"
    return comparison.row("VI.B", quantity, THESIS[name], "-", ours, paired.is_better, why)
