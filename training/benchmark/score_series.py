"""The parts of a score that are curves, tables and scatters: data for figures and comparisons."""

from typing import Any

import numpy as np

from auv_fault_env.faults import classes
from training import metrics
from training.benchmark.assessment import Assessment
from training.benchmark.trials import FaultyOutcome, LaneTruth
from training.metrics import NORMAL, Edges, Times, compatibility, declaration, naming
from training.metrics import abstention as withheld
from training.metrics.intervals import interval
from training.metrics.plain import finite, rounded
from training.metrics.records import HORIZON, PERSISTENCE, HealthyOutcome, Truth

AMOC_RATES = np.geomspace(0.02, 60.0, 41)  # false alarms per hour
CURVE_POINTS = 61
SCATTER_POINTS = 300
COVERAGE = np.linspace(0.05, 1.0, 20)


def mean_by_class(times: Times, truth: Truth) -> dict[str, float]:
    """Restricted mean [s] of the lanes of each class that occurs."""
    means = {}
    for k, name in enumerate(classes()):
        of_class = truth.fault == k
        if of_class.any():
            means[name] = float(times.time[of_class].mean())
    return means


def f1_over_time(assessment: Assessment) -> list[float]:
    """Macro-F1 at each of `DECISION_TIMES`."""
    n_classes = len(classes())
    label = assessment.label
    matrices = [metrics.confusion(label, row, n_classes) for row in assessment.decisions]
    return [float(metrics.macro_f1(matrix)) for matrix in matrices]


def mission_cost(faulty: FaultyOutcome, cruise: FaultyOutcome | None) -> dict[str, float | None]:
    """What the mission paid, and the ratio to what it pays under `cruise`, if that was run."""
    paid = _paid(faulty)
    if cruise is None:
        return paid | {f"{name}_ratio": None for name in paid}
    under_cruise = _paid(cruise)
    return paid | {f"{name}_ratio": value / under_cruise[name] for name, value in paid.items()}


def _paid(faulty: FaultyOutcome) -> dict[str, float]:
    """RMS speed deviation [m/s] and mean energy [J]."""
    return {
        "speed_rms": float(np.sqrt(np.mean(faulty.speed_rms**2))),
        "energy": float(faulty.energy.mean()),
    }


def isolation_over_time(assessment: Assessment) -> dict[str, list[float]]:
    """Share isolated for good by a time since onset [s]."""
    time = np.linspace(0.0, HORIZON, CURVE_POINTS)
    isolation = assessment.isolation
    isolated = (isolation.time <= time[:, None]) & ~isolation.censored
    return {"time": rounded(time), "share": rounded(isolated.mean(axis=1))}


def amoc(
    setting: HealthyOutcome, faulty: FaultyOutcome, onset: np.ndarray
) -> dict[str, list[float]]:
    """Delay and share detected against the false alarms per hour that the threshold is set for."""
    alarms = Edges(setting.low, setting.high)
    depth = metrics.running_maximum(faulty.log_normal, PERSISTENCE)
    hours = float(setting.hours.sum())
    rates = []
    delays = []
    shares = []
    for allowed in np.unique((AMOC_RATES * hours).astype(int)):
        threshold = metrics.threshold_within(alarms, int(allowed))
        if allowed and threshold <= setting.complete.min():
            delay = metrics.detection_delay(depth < threshold, onset, HORIZON)
            rates.append(allowed / hours)
            delays.append(metrics.restricted_mean(delay))
            shares.append(metrics.probability(delay))
    return {
        "false_alarms_per_hour": rounded(rates),
        "delay": rounded(delays),
        "probability": rounded(shares),
    }


def confusion(assessment: Assessment) -> list[list[int]]:
    """Counts, rows true classes, columns decisions at `DECISION_TIME`."""
    matrix = metrics.confusion(assessment.label, assessment.decision, len(classes()))
    return matrix.astype(int).tolist()


def reliability(assessment: Assessment) -> dict[str, list[float]]:
    """The bins of the reliability diagram that are not empty."""
    bins = metrics.reliability(assessment.confidence, assessment.right)
    has_beliefs = bins.share > 0
    return {name: rounded(values[has_beliefs]) for name, values in bins._asdict().items()}


def abstention(assessment: Assessment, unknown: int) -> dict[str, Any]:
    """Risk against coverage, in steps of `COVERAGE`."""
    confidence, right = withheld.known_confidence(
        assessment.log_probability, assessment.truth, unknown
    )
    curve = withheld.risk_coverage(confidence, right)
    return {
        "area": withheld.area(curve),
        "risk": float(1.0 - right.mean()),
        "coverage": rounded(COVERAGE),
        "risk_at": rounded([withheld.risk_at(curve, share) for share in COVERAGE]),
    }


def judged(
    faulty: FaultyOutcome, truth: LaneTruth, unknown: int
) -> tuple[declaration.Declarations, Times]:
    """What is declared on each lane, and the times to the right declaration [s]."""
    first = declaration.declare(faulty.fault, faulty.log_fault)
    onset = truth.at_instants.onset
    declarations = declaration.judge(first, truth.right_classes, onset, HORIZON, unknown)
    return declarations, declaration.time_to_right(first, declarations, onset, HORIZON)


def declared(faulty: FaultyOutcome, truth: LaneTruth, unknown: int, seed: int) -> dict[str, Any]:
    """Shares of the lanes by what is declared, and the time to the right declaration [s]."""
    declarations, times = judged(faulty, truth, unknown)
    return {
        "right": float(declarations.right.mean()),
        "wrong": float(declarations.wrong.mean()),
        "unknown": float(declarations.abstained.mean()),
        "never": float(declarations.never.mean()),
        "time_to_right": metrics.restricted_mean(times),
        "time_to_right_interval": interval(times.time, seed),
    }


def naming_of_unexplained(
    faulty: FaultyOutcome, assessment: Assessment, truth: LaneTruth
) -> dict[str, Any] | None:
    """What is named where no single fault of the catalogue explains the readings."""
    lanes = np.flatnonzero(~truth.explained)
    if not lanes.size:
        return None
    at_horizon = metrics.sample_at(truth.at_instants.onset[lanes] + HORIZON), lanes
    named = naming.name_of(
        ~assessment.detection.censored[lanes],
        faulty.fault[at_horizon],
        faulty.log_fault[at_horizon],
        truth.right_classes[lanes],
        naming.unknown_class(),
    )
    shares = {
        key: finite(naming.share_of_alarmed(named, getattr(named, key)))
        for key in ("right", "unknown", "surely_wrong")
    }
    return {"lanes": lanes.size, "alarmed": float(named.alarmed.mean()), **shares}


def known_faults(truth: Truth) -> np.ndarray:
    """Lanes whose fault is a known one: `unknown` has no severity that a diagnoser could know."""
    return np.flatnonzero(truth.fault != naming.unknown_class())


def severity_scatter(assessment: Assessment, truth: Truth) -> dict[str, list[float]]:
    """Severity, true and estimated, of some lanes with a known fault."""
    known = known_faults(truth)
    count = min(SCATTER_POINTS, known.size)
    lanes = known[np.linspace(0, known.size - 1, count).astype(np.int64)]
    return {
        "truth": rounded(truth.severity[0, lanes]),
        "estimate": rounded(assessment.severity[lanes]),
    }


def compatible_scores(
    faulty: FaultyOutcome, threshold: float, truth: LaneTruth
) -> dict[str, float | None]:
    """Scores of other benchmarks, on the faulty lanes from the start of the episodes."""
    alarm = metrics.alarms(faulty.log_normal, threshold, PERSISTENCE)
    decision = np.where(alarm, faulty.fault, NORMAL)
    random_instants = truth.instants[1:]
    beliefs = faulty.log_probability[1:]
    return compatibility.scores(truth.label, decision, random_instants, beliefs, len(classes()))


def lane_results(assessment: Assessment) -> dict[str, list[Any]]:
    """What paired comparisons need."""
    return {
        "isolation": rounded(assessment.isolation.time),
        "isolated": (~assessment.isolation.censored).tolist(),
        "detection": rounded(assessment.detection.time),
        "detected": (~assessment.detection.censored).tolist(),
        "decision": assessment.decision.tolist(),
    }
