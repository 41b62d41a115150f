"""The page of `auv-fault validate`: verdicts, leaderboard, differences, figures."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from auv_fault_env.faults import classes
from diagnosers import ranked
from training import metrics
from training.benchmark.leaderboard import (
    ALARMS,
    Scores,
    alarm_cells,
    by_class,
    compute,
    figure_section,
    in_order,
    leaderboard,
    left_out,
)
from training.benchmark.scoring import DECIDED_AT, HORIZON, MEAN_TIME, Assessment
from training.benchmark.validation import SEVERITY_AT, UNTOLD
from training.benchmark.verdicts import FILTER_BANK, INTEGRATED, ORACLE, Difference
from training.metrics.records import PERSISTENCE, Truth
from training.report.cells import row_name, with_interval

SCATTERED = 400  # lanes in the scatter of severities


def page(
    judged: Mapping[str, Assessment],
    scores: Scores,
    truth: Truth,
    against: Mapping[str, Mapping[str, Difference]],
    failures: Mapping[str, str],
    verdicts: list[list[str]],
) -> dict[str, Any]:
    """The report as plain data; `truth` is that of the faulty lanes."""
    references = [name for name in scores if name not in ranked()]
    names = in_order(scores, references)
    sections = [
        {
            "heading": "Are the targets met?",
            "text": [],
            "table": {"columns": ["target", "verdict", "figures"], "rows": verdicts},
        },
        leaderboard(scores, references),
        *([left_out(failures)] if failures else []),
        *(paired(name, by) for name, by in against.items() if by),
        isolation_over_time(judged, names),
        isolation_by_class(scores, names),
        *(confusion(name, judged[name]) for name in (INTEGRATED, FILTER_BANK) if name in judged),
        alarms(scores, names, references),
        calibration(judged, scores, names),
        severity(judged, truth),
        compute(scores, names, references),
    ]
    return {
        "title": "Diagnosers on the validation suite",
        "intro": intro(truth, scores),
        "sections": sections,
    }


def intro(truth: Truth, scores: Scores) -> list[str]:
    """What was run."""
    hours = next(iter(scores.values()))["hours"]
    return [
        f"{len(truth.fault)} vehicles with one fault each, seeds of validation only; default noise, disturbance and "
        "spread of healthy vehicles. Half run the thesis' stimulus, half random missions with random manoeuvres. "
        "Every class is equally likely, severity 0.2 to 1, onset 5 to 30 s, abrupt or ramped.",
        f"An alarm is p(normal) below a threshold for {PERSISTENCE} samples in a row. Each diagnoser's threshold is "
        f"set for one false alarm per {MEAN_TIME / 3600:g} h on {hours:.1f} h of healthy operation, and its false "
        "alarms are counted on as many other hours. Isolated means: alarm on and the right class on top, from then "
        f"on until {HORIZON:g} s after onset. Faults not isolated by then count with {HORIZON:g} s. Intervals are "
        "95 % bootstrap intervals over vehicles.",
        "References, marked *, are not ranked: the oracle is told the true healthy parameters and severities (so its "
        "severity error is nil by construction; severities are compared with the oracle that is not told them); null "
        "and random anchor the scale.",
    ]


def paired(name: str, by: Mapping[str, Difference]) -> dict[str, Any]:
    """How one differs from the others on the same vehicles."""
    rows = [
        [
            other,
            with_interval(difference.isolation[0], difference.isolation[1:], 2, "+"),
            with_interval(difference.macro_f1[0], difference.macro_f1[1:], 3, "+"),
            "yes" if difference.better else "no",
        ]
        for other, difference in by.items()
    ]
    return {
        "heading": f"{name} against the others",
        "text": [
            f"{name} minus the other on the same vehicles, with 95 % paired bootstrap intervals; negative isolation "
            "times and positive macro-F1 are in its favour. Better means: on both, zero outside the intervals."
        ],
        "table": {"columns": ["against", "isolation time [s]", "macro-F1", "better"], "rows": rows},
    }


def isolation_over_time(judged: Mapping[str, Assessment], names: Sequence[str]) -> dict[str, Any]:
    """Share isolated against time since onset."""
    time = np.linspace(0.0, HORIZON, 301)
    shares = {
        name: [round(float(share), 4) for share in (_isolated_at(judged[name], time)).mean(axis=1)]
        for name in names
    }
    references = [name for name in names if name not in ranked()]
    data = {"time": np.round(time, 1).tolist(), "shares": shares, "references": references}
    caption = "Share of the faults isolated for good by a time since onset; the area above a line is its restricted mean."
    return figure_section(
        "How soon are faults isolated?", "isolation_curves", "isolation", caption, data
    )


def _isolated_at(judged: Assessment, time: np.ndarray) -> np.ndarray:
    return (judged.isolation.time <= time[:, None]) & ~judged.isolation.censored


def isolation_by_class(scores: Scores, names: Sequence[str]) -> dict[str, Any]:
    """Restricted mean isolation time by class and diagnoser."""
    return {
        "heading": "Isolation time by class",
        "text": [
            f"Restricted mean [s] of the vehicles with that fault; {HORIZON:g} is never within the horizon."
        ],
        "table": {"columns": ["class", *names], "rows": by_class("isolation", scores, names)},
    }


def confusion(name: str, judged: Assessment) -> dict[str, Any]:
    """Who is taken for what."""
    matrix = metrics.confusion(judged.label, judged.decision, len(classes()))
    shares = matrix / np.maximum(matrix.sum(axis=1, keepdims=True), 1.0)
    data = {"classes": list(classes()), "shares": np.round(shares, 4).tolist()}
    caption = (
        f"Decisions of {name} {DECIDED_AT:g} s after onset, per cent of each true class (rows); normal means that no "
        "alarm stands. Shares below 0.5 % are not written."
    )
    return figure_section(
        f"Confusion of {name}", "confusion_matrix", f"confusion-{name}", caption, data
    )


def alarms(scores: Scores, names: Iterable[str], references: Collection[str]) -> dict[str, Any]:
    """Thresholds and the false alarms counted."""
    return {
        "heading": "Alarms",
        "text": [
            "False alarms on healthy vehicles that did not serve to set the threshold; the aim is "
            f"{3600 / MEAN_TIME:g} per hour. The interval is that of the count (Poisson). The threshold itself rests "
            "on as few alarms, and alarms that flicker come several to a vehicle: a rate just outside its interval now "
            "and then is no wonder; far outside means that the threshold does not carry over to other vehicles."
        ],
        "table": {
            "columns": ["diagnoser", *ALARMS],
            "rows": [
                [row_name(name, references), *alarm_cells(scores[name], MEAN_TIME)]
                for name in names
            ],
        },
    }


def calibration(
    judged: Mapping[str, Assessment], scores: Scores, names: Iterable[str]
) -> dict[str, Any]:
    """Reliability diagrams."""
    diagrams = {}
    for name in names:
        bins = metrics.reliability(judged[name].confidence, judged[name].right)
        diagrams[name] = {
            key: np.round(values[bins.share > 0], 4).tolist()
            for key, values in bins._asdict().items()
        }
    caption = (
        "Share of beliefs that were right against their confidence, at random instants; a point's area is the share of "
        "the beliefs in its bin. Below the diagonal: too sure of itself."
    )
    return figure_section(
        "Are beliefs to be believed?",
        "reliability_diagrams",
        "reliability",
        caption,
        {"diagrams": diagrams},
    )


def severity(judged: Mapping[str, Assessment], truth: Truth) -> dict[str, Any]:
    """Scatter of severities."""
    wanted = [
        name for name in (INTEGRATED, FILTER_BANK, ORACLE + UNTOLD) if name in judged
    ] or list(judged)[:1]
    lanes = np.linspace(0, len(truth.fault) - 1, min(SCATTERED, len(truth.fault))).astype(np.int64)
    data = {
        "truth": np.round(truth.severity[0, lanes].astype(float), 4).tolist(),
        "estimates": {
            name: np.round(judged[name].severity[lanes].astype(float), 4).tolist()
            for name in wanted
        },
    }
    caption = f"Severity estimated {SEVERITY_AT:g} s after onset, given the true class, of {len(lanes)} vehicles."
    return figure_section("Severity", "severities", "severity", caption, data)
