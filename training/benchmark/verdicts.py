"""Are the targets met? Each as one row: the target, whether it is met, and the figures that say so."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from auv_fault_env.faults import classes
from diagnosers import ranked
from training.benchmark.scoring import DECIDED_AT, Assessment
from training.benchmark.validation import SEVERITY_AT, UNTOLD
from training.metrics import Times, confusion, macro_f1, restricted_mean
from training.metrics.intervals import paired_bootstrap, paired_f1

ORACLE = "oracle"
INTEGRATED = "integrated"
FILTER_BANK = "filter_bank"
BELOW_FILTER_BANK = ("limits", "cusum", "rules", "raw_network", "kalman_network")
RATIO = 1.5
CALIBRATION_ERROR = 0.05
SLOWEST_US = 1000.0
MET = "met"
MISSED = "not met"
OPEN = "not judged"


class Difference(NamedTuple):
    """One diagnoser minus another, by lane: value, and 95 % paired bootstrap interval (low, high)."""

    isolation: tuple[float, float, float]
    macro_f1: tuple[float, float, float]

    @property
    def better(self) -> bool:
        """Isolates sooner and has the higher macro-F1, both intervals apart from zero."""
        return self.isolation[2] < 0.0 < self.macro_f1[1]


class ByLane(NamedTuple):
    """What a paired comparison needs of a diagnoser: isolation times of faulty lanes, and what was named at an instant.

    label and decision hold true classes and those named, some of the lanes being healthy.
    """

    isolation: Times
    label: np.ndarray
    decision: np.ndarray


def difference(a: Assessment | ByLane, b: Assessment | ByLane, seed: int) -> Difference:
    """How a differs from b on the same lanes."""
    f1 = [float(macro_f1(confusion(a.label, one.decision, len(classes())))) for one in (a, b)]
    return Difference(
        (
            restricted_mean(a.isolation) - restricted_mean(b.isolation),
            *paired_bootstrap(a.isolation.time, b.isolation.time, seed),
        ),
        (f1[0] - f1[1], *paired_f1(a.label, a.decision, b.decision, len(classes()), seed)),
    )


def differences(
    judged: Mapping[str, Assessment], name: str, others: Iterable[str], seed: int
) -> dict[str, Difference]:
    """How a diagnoser differs from each of the others that took part; empty if it did not itself."""
    if name not in judged:
        return {}
    return {
        other: difference(judged[name], judged[other], seed) for other in others if other in judged
    }


def verdicts(
    scores: Mapping[str, Mapping[str, Any]], against: Mapping[str, Mapping[str, Difference]]
) -> list[list[str]]:
    """Rows target, verdict, figures; `against` holds `differences` by diagnoser."""
    others = [name for name in ranked() if name != INTEGRATED]
    return [
        _beats(INTEGRATED, "every other ranked diagnoser", others, against.get(INTEGRATED, {})),
        _ratio(
            scores,
            "restricted mean isolation time",
            ORACLE,
            lambda score: score["isolation"]["restricted_mean"],
        ),
        _ratio(
            scores,
            f"severity MAE at {SEVERITY_AT:g} s",
            ORACLE + UNTOLD,
            lambda score: score["severity_mae"],
        ),
        _calibrated(scores),
        _beats(
            FILTER_BANK,
            ", ".join(BELOW_FILTER_BANK),
            BELOW_FILTER_BANK,
            against.get(FILTER_BANK, {}),
        ),
        _quick(scores),
    ]


def _beats(
    name: str, whom: str, others: Sequence[str], found: Mapping[str, Difference]
) -> list[str]:
    target = (
        f"{name} beats {whom}: isolates sooner and has the higher macro-F1 at {DECIDED_AT:g} s, "
    )
    target += "95 % intervals apart from zero"
    if not found:
        return [target, OPEN, f"Either {name} or all the others did not take part."]
    missing = [other for other in others if other not in found]
    lost = [other for other, by in found.items() if not by.better]
    shown = lost or sorted(found, key=lambda other: -found[other].isolation[0])[:1]
    figures = [
        f"{len(found) - len(lost)} of {len(found)} beaten",
        *(f"{other}: {_signed(found[other])}" for other in shown),
    ]
    figures += [f"did not take part: {', '.join(missing)}"] if missing else []
    return [target, MISSED if lost else OPEN if missing else MET, "; ".join(figures) + "."]


def _signed(by: Difference) -> str:
    isolation, f1 = by
    return "isolation {:+.2f} s ({:+.2f} to {:+.2f}), F1 {:+.3f} ({:+.3f} to {:+.3f})".format(
        *isolation, *f1
    )


def _ratio(
    scores: Mapping[str, Mapping[str, Any]], what: str, reference: str, value: Any
) -> list[str]:
    target = f"{INTEGRATED}: {what} at most {RATIO:g} times that of '{reference}'"
    if not {INTEGRATED, reference} <= scores.keys():
        return [target, OPEN, "One of them did not take part."]
    ours = value(scores[INTEGRATED])
    best = value(scores[reference])
    figures = (
        f"{ours:.3f} against {best:.3f}: {ours / best:.2f} times."
        if best
        else f"{ours:.3f} against 0."
    )
    return [target, MET if ours <= RATIO * best else MISSED, figures]


def _calibrated(scores: Mapping[str, Mapping[str, Any]]) -> list[str]:
    target = f"{INTEGRATED}: expected calibration error below {CALIBRATION_ERROR:g}"
    if INTEGRATED not in scores:
        return [target, OPEN, "It did not take part."]
    error = scores[INTEGRATED]["ece"]
    return [target, MET if error < CALIBRATION_ERROR else MISSED, f"{error:.3f}."]


def _quick(scores: Mapping[str, Mapping[str, Any]]) -> list[str]:
    slowest = max(scores, key=lambda name: scores[name]["p99_us"])
    p99 = scores[slowest]["p99_us"]
    target = f"99th percentile of one vehicle's update below {SLOWEST_US / 1000:g} ms for every diagnoser"
    return [target, MET if p99 < SLOWEST_US else MISSED, f"The slowest is {slowest}: {p99:.0f} µs."]
