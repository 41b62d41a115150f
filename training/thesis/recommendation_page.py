"""Section VI.B of the report, the thesis' recommendation answered: both networks in parallel, and one integrated."""

from collections.abc import Mapping
from typing import Any

from training.benchmark.scoring import DECIDED_AT, HORIZON, Assessment, judge_all
from training.benchmark.validation import compare, contestants
from training.benchmark.validation_page import isolation_over_time
from training.benchmark.verdicts import Difference, difference
from training.thesis.comparison import Comparison

NAMES = ("raw_network", "kalman_network", "parallel", "integrated")
LANES = 400  # faulty vehicles
HOURS = 8.0  # healthy operation twice
SEED = 0  # first seed within those of validation


def section(view: Comparison, columns: list[str]) -> dict[str, Any]:
    """Run the four diagnosers over a small part of the validation suite, and compare them."""
    entrants, failures = contestants(NAMES)
    beliefs = compare(entrants, LANES, HOURS, SEED)
    failures |= beliefs.failures
    return page(view, *judge_all(beliefs, SEED), failures, columns)


def page(
    view: Comparison,
    judged: Mapping[str, Assessment],
    scores: Mapping[str, Mapping[str, Any]],
    failures: Mapping[str, str],
    columns: list[str],
) -> dict[str, Any]:
    """The section from what was found; diagnosers that could not run are named with the reason."""
    text = [
        "The thesis leaves two ways to see faults inside the motor system and of the hull at once: both networks side "
        "by side, which 'would certainly be capable', or one network on the sensors and the filter's estimates. Both "
        f"are built. {LANES} vehicles with one fault each of every class, default noise, disturbance and spread of "
        "vehicles, half with the thesis' stimulus; at thresholds for one false alarm per hour, set on "
        f"{HOURS:g} h of healthy operation. Faults not isolated within {HORIZON:g} s count with {HORIZON:g} s. A small "
        "sample: auv-fault validate compares all diagnosers on more. Verdicts of this table are under noise; both "
        "networks in parallel agree with the thesis if they beat each alone, how far that carries is in their row.",
        *(f"{name} could not take part: {reason}" for name, reason in failures.items()),
    ]
    pairs = (
        ("parallel", "raw_network"),
        ("parallel", "kalman_network"),
        ("integrated", "parallel"),
    )
    rows = [measured_row(view, name, scores.get(name)) for name in NAMES]
    rows += [against_row(view, judged, a, b) for a, b in pairs]
    figures = isolation_over_time(judged, list(judged)[::-1])["figures"] if judged else []
    table = {"columns": columns, "rows": rows}
    return {
        "heading": "VI.B: the recommendation answered",
        "text": text,
        "table": table,
        "figures": figures,
    }


def measured_row(view: Comparison, name: str, score: Mapping[str, Any] | None) -> list[str]:
    """What one diagnoser achieves."""
    quantity = (
        f"{name}: restricted mean isolation time; share isolated; macro-F1 at {DECIDED_AT:g} s"
    )
    if score is None:
        return [
            "VI.B",
            quantity,
            "-",
            "-",
            "-",
            "not judged",
            "It could not take part.",
            view.command,
        ]
    isolation = score["isolation"]
    ours = f"{isolation['restricted_mean']:.1f} s; {100 * isolation['probability']:.0f} %; {score['macro_f1']:.2f}"
    low, high = isolation["interval"]
    why = (
        f"95 % interval of the time {low:.1f} to {high:.1f} s. False alarms {score['false_alarms_per_hour']:.1f} per "
        f"hour on other healthy vehicles; severity error {score['severity_mae']:.2f}, calibration error "
        f"{score['ece']:.3f}."
    )
    return ["VI.B", quantity, "-", "-", ours, "-", why, view.command]


THESIS = {"parallel": "would certainly be capable", "integrated": "another approach"}


def against_row(
    view: Comparison, judged: Mapping[str, Assessment], name: str, other: str
) -> list[str]:
    """Whether one diagnoser beats another on the same vehicles."""
    quantity = f"{name} minus {other}: isolation time; macro-F1 at {DECIDED_AT:g} s"
    if not {name, other} <= judged.keys():
        why = "One of them could not take part."
        return ["VI.B", quantity, THESIS[name], "-", "-", "not judged", why, view.command]
    by: Difference = difference(judged[name], judged[other], SEED)
    ours = f"{by.isolation[0]:+.1f} s; {by.macro_f1[0]:+.2f}"
    why = (
        f"95 % paired intervals {by.isolation[1]:+.1f} to {by.isolation[2]:+.1f} s and {by.macro_f1[1]:+.2f} to "
        f"{by.macro_f1[2]:+.2f}. {name} is {'better on both' if by.better else 'not better on both'}."
    )
    return view.row("VI.B", quantity, THESIS[name], "-", ours, by.better, why)
