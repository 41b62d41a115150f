"""Section VI.B of the report: both networks in parallel, and one integrated network."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from diagnosers import ranked
from training.benchmark.assessment import DECISION_TIME, Assessment
from training.benchmark.differences import difference
from training.metrics.plain import rounded
from training.metrics.records import HORIZON
from training.report.cells import percent
from training.report.sections import figure, table_section
from training.thesis.comparison import COLUMNS
from training.thesis.recommendation import ALONE, PARALLEL, capability, compare

NAMES = (*ALONE, PARALLEL, "integrated")
PAIRS = [
    (PARALLEL, "raw_network"),
    (PARALLEL, "kalman_network"),
    ("integrated", PARALLEL),
]
CLAIM = "would certainly be capable"  # the networks in parallel
LANES = 400  # faulty vehicles
HOURS = 8.0  # healthy operation, twice
SEED = 0  # first seed within those of validation


def section() -> dict[str, Any]:
    """Run the four diagnosers over a small part of the validation suite, and compare them."""
    results = compare(NAMES, LANES, HOURS, SEED)
    return section_of_assessments(*results)


def section_of_assessments(
    assessments: Mapping[str, Assessment],
    scores: Mapping[str, Mapping[str, Any]],
    failures: Mapping[str, str],
) -> dict[str, Any]:
    """The section as plain data; `failures` are the reasons of diagnosers that could not run."""
    text = (
        "The thesis suggests two ways to diagnose the motor system and the hull at once: both "
        f"networks side by side, which '{CLAIM}', or one network on the sensors "
        f"and the filter's estimates. Both are built. {LANES} vehicles with one fault each of "
        "every class, default noise, disturbance and healthy band, half with the thesis' stimulus; "
        f"at thresholds for one false alarm per hour, set on {HOURS:g} h of healthy operation. "
        f"Faults not isolated within {HORIZON:g} s count with {HORIZON:g} s. The sample is small: "
        "auv-fault validate compares all diagnosers on more. The verdict is under noise: the "
        "networks in parallel agree with the thesis if they isolate surely more of the faults that "
        "have a mode in its tables than each of them alone, and at least half of these faults; in "
        "part if one of both holds."
    )
    absences = [f"{name} could not take part: {reason}" for name, reason in failures.items()]
    rows = [score_row(name, scores.get(name)) for name in NAMES]
    rows.append(capability_row(assessments))
    rows += [difference_row(assessments, *pair) for pair in PAIRS]
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


def score_row(name: str, score: Mapping[str, Any] | None) -> list[str]:
    """The scores of one diagnoser; None if it could not take part."""
    quantity = (
        f"{name}: restricted mean isolation time; share isolated; macro-F1 at {DECISION_TIME:g} s"
    )
    texts = ["-", "not judged", "It could not take part."]
    if score is not None:
        ours, why = _score_texts(score)
        texts = [ours, "-", why]
    return ["VI.B", quantity, "-", "-", *texts]


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


def capability_row(assessments: Mapping[str, Assessment]) -> list[str]:
    """Whether the networks in parallel are as capable as the thesis expects."""
    quantity = f"{PARALLEL}, faults that have a mode in the tables: share isolated"
    found = capability(assessments, SEED)
    texts = ["-", "not judged", "One of the networks could not take part."]
    if found is not None:
        ours = f"{percent(found.share)}; {100 * found.gain:+.0f} points on {found.better}"
        texts = [ours, found.verdict, found.why]
    return ["VI.B", quantity, CLAIM, "-", *texts]


def difference_row(
    assessments: Mapping[str, Assessment],
    name: str,
    rival: str,
) -> list[str]:
    """How much one diagnoser is better than another on the same vehicles."""
    quantity = f"{name} minus {rival}: isolation time; macro-F1 at {DECISION_TIME:g} s"
    texts = ["-", "not judged", "One of them could not take part."]
    if name in assessments and rival in assessments:
        paired = difference(assessments[name], assessments[rival], SEED)
        time, time_low, time_high = paired.isolation
        f1, f1_low, f1_high = paired.macro_f1
        verdict = "better on both" if paired.is_better else "not better on both"
        why = (
            f"95 % paired intervals {time_low:+.1f} to {time_high:+.1f} s and {f1_low:+.2f} to "
            f"{f1_high:+.2f}. {name} is {verdict}."
        )
        texts = [f"{time:+.1f} s; {f1:+.2f}", "-", why]
    return ["VI.B", quantity, "-", "-", *texts]
