"""From what the diagnosers believed to how good they are: one threshold each, then every metric on the same lanes."""

from typing import Any, NamedTuple

import numpy as np

from auv_fault_env.faults import classes
from auv_fault_env.schedules import ScheduleSampler
from training import metrics
from training.benchmark.validation import Beliefs
from training.metrics import NORMAL, Edges, Times
from training.metrics.intervals import f1_interval, interval, poisson_interval
from training.metrics.records import (
    DECISION_TIMES,
    HORIZON,
    PERSISTENCE,
    HealthyOutcome,
    Record,
    Truth,
    healthy_outcome,
)

MEAN_TIME = 3600.0  # s between false alarms that the thresholds are set for
DECIDED_AT = 10.0  # s after onset, one of `DECISION_TIMES`
# in what is judged at an instant
HEALTHY_PER_FAULTY = ScheduleSampler().healthy / (1.0 - ScheduleSampler().healthy)


class Assessment(NamedTuple):
    """What a diagnoser did on the lanes of the suite, for figures and for paired comparisons.

    isolation, detection, severity (estimate given the true class), covered: by faulty lane. label
    (n_lanes,), decisions (n_decided, n_lanes): at the instants `DECISION_TIMES`, some of the lanes being
    healthy. log_probability and truth: beliefs at random instants.
    """

    threshold: float
    false_alarms: int
    false_alarm_vehicles: int
    hours: float
    isolation: Times
    detection: Times
    label: np.ndarray
    decisions: np.ndarray
    severity: np.ndarray
    covered: np.ndarray
    log_probability: np.ndarray
    truth: np.ndarray

    @property
    def decision(self) -> np.ndarray:
        """The decisions at `DECIDED_AT`, (n_lanes,)."""
        return self.decisions[DECISION_TIMES.index(DECIDED_AT)]

    @property
    def confidence(self) -> np.ndarray:
        """Probability of the most probable class, (n_beliefs,)."""
        return np.exp(self.log_probability.max(axis=1))

    @property
    def right(self) -> np.ndarray:
        """Whether the most probable class is the true one, (n_beliefs,)."""
        return self.log_probability.argmax(axis=1) == self.truth


def judge_all(
    beliefs: Beliefs, seed: int
) -> tuple[dict[str, Assessment], dict[str, dict[str, Any]]]:
    """What every contestant did, and its figures; `seed` is that of the bootstrap intervals."""
    judged = {name: judge(records, beliefs.truth) for name, records in beliefs.records.items()}
    return judged, {
        name: summary(one, beliefs.truth["faulty"], seed) for name, one in judged.items()
    }


def judge(records: dict[str, Record], truth: dict[str, Truth]) -> Assessment:
    """Set the threshold on its lanes, count false alarms on theirs, and judge the faulty ones at that threshold."""
    threshold = metrics.threshold_for(records["threshold"].log_normal, MEAN_TIME, PERSISTENCE)
    return assess(
        threshold,
        records["faulty"],
        truth["faulty"],
        healthy_outcome(records["counting"], truth["counting"].onset),
    )


def assess(threshold: float, faulty: Record, truth: Truth, healthy: HealthyOutcome) -> Assessment:
    """Judge the record of faulty lanes and what is left of healthy ones at a threshold of log p(normal)."""
    alarm = metrics.alarms(faulty.log_normal, threshold, PERSISTENCE)
    decision = np.where(alarm, faulty.fault, NORMAL)
    some = healthy_beside(len(truth.fault), len(healthy.least))
    decided = decision[
        metrics.sample_at(truth.onset + np.array(DECISION_TIMES)[:, None]),
        np.arange(len(truth.onset)),
    ]
    healthy_decided = np.where(healthy.depth < threshold, healthy.fault, NORMAL)[:, some]
    given = 0, np.arange(len(truth.fault)), truth.fault  # the true class, at the first instant
    severity = faulty.severity_mean[given]
    calm_beliefs = healthy.log_probability[:, some]
    return Assessment(
        threshold,
        int(metrics.count_alarms(Edges(healthy.low, healthy.high), threshold)),
        int((healthy.least < threshold).sum()),
        float(healthy.hours.sum()),
        metrics.isolation_time(decision, truth.fault, truth.onset, HORIZON),
        metrics.detection_delay(alarm, truth.onset, HORIZON),
        np.concatenate([truth.fault, np.full(len(some), NORMAL)]),
        np.concatenate([decided, healthy_decided], axis=1),
        severity,
        metrics.covered(severity, faulty.severity_std[given], truth.severity[0]),
        np.concatenate([_flat(faulty.log_probability[1:]), _flat(calm_beliefs)]),
        np.concatenate([truth.label[1:].ravel(), np.full(calm_beliefs.shape[:2], NORMAL).ravel()]),
    )


def healthy_beside(n_faulty: int, n_healthy: int) -> np.ndarray:
    """Indices of the healthy lanes judged beside the faulty ones at an instant, spread evenly over these."""
    wanted = min(round(HEALTHY_PER_FAULTY * n_faulty), n_healthy)
    return np.linspace(0, n_healthy - 1, wanted).astype(np.int64)


def _flat(log_probability: np.ndarray) -> np.ndarray:
    return log_probability.reshape(-1, log_probability.shape[-1]).astype(np.float64)


def summary(judged: Assessment, truth: Truth, seed: int) -> dict[str, Any]:
    """Every figure of a diagnoser as plain data; `truth` is that of the faulty lanes."""
    names = classes()
    error = metrics.severity_error(judged.severity, truth.severity[0])
    return {
        **alarm_summary(judged, MEAN_TIME, seed),
        "macro_f1": float(
            metrics.macro_f1(metrics.confusion(judged.label, judged.decision, len(names)))
        ),
        "macro_f1_interval": f1_interval(judged.label, judged.decision, len(names), seed),
        "severity_mae": float(error.mean()),
        "severity_mae_interval": interval(error, seed),
        "severity_coverage": float(judged.covered.mean()),
        "ece": metrics.expected_calibration_error(judged.confidence, judged.right),
        "brier": metrics.brier(judged.log_probability, judged.truth),
        "log_loss": finite(metrics.log_loss(judged.log_probability, judged.truth)),
        "isolation_by_class": mean_by_class(judged.isolation, truth),
    }


def alarm_summary(judged: Assessment, mean_time: float, seed: int) -> dict[str, Any]:
    """The figures that hang on the threshold, which was set for one false alarm per `mean_time` [s]."""
    rate = poisson_interval(judged.false_alarms, judged.hours)
    return {
        "threshold": finite(judged.threshold),
        "false_alarms": judged.false_alarms,
        "false_alarm_vehicles": judged.false_alarm_vehicles,
        "hours": judged.hours,
        "false_alarms_per_hour": judged.false_alarms / judged.hours,
        "false_alarms_per_hour_interval": rate,
        "rate_as_set": rate[0] <= 3600.0 / mean_time <= rate[1],
        "isolation": _times(judged.isolation, seed),
        "detection": _times(judged.detection, seed),
    }


def mean_by_class(times: Times, truth: Truth) -> dict[str, float]:
    """Restricted mean [s] of the lanes of each class that occurs."""
    faults = enumerate(classes())
    return {
        name: float(times.time[truth.fault == k].mean())
        for k, name in faults
        if (truth.fault == k).any()
    }


def _times(times: Times, seed: int) -> dict[str, Any]:
    return {
        "restricted_mean": metrics.restricted_mean(times),
        "interval": interval(times.time, seed),
        "probability": metrics.probability(times),
        "median": finite(metrics.kaplan_meier_median(times)),
    }


def finite(value: float) -> float | None:
    """The value, None if infinite: JSON knows no infinity."""
    return value if np.isfinite(value) else None
