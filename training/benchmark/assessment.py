"""What a diagnoser did on the lanes of a suite at one threshold, from what it believed."""

from typing import NamedTuple

import numpy as np

from auv_fault_env.schedules import ScheduleSampler
from training import metrics
from training.metrics import NORMAL, Edges, Times, healthy_time
from training.metrics.healthy_time import CountedAlarms, is_raised
from training.metrics.records import (
    DECISION_TIMES,
    HORIZON,
    PERSISTENCE,
    HealthyOutcome,
    Record,
    Truth,
)

DECISION_TIME = 10.0  # s after onset, of the decisions that macro-F1 and confusion judge
AT_DECISION = DECISION_TIMES.index(DECISION_TIME)
# healthy lanes to each faulty one among the decisions, as the sampler of schedules draws them
HEALTHY_PER_FAULTY = ScheduleSampler().healthy / (1.0 - ScheduleSampler().healthy)


class Assessment(NamedTuple):
    """What a diagnoser did at a threshold, for scores and for paired comparisons."""

    threshold: float  # of log p(normal)
    false_alarms: int  # on healthy lanes
    false_alarm_vehicles: int  # healthy lanes with an alarm
    hours: float  # operation of the healthy lanes
    alarm_hours: float  # of these with an alarm
    by_age: CountedAlarms  # false alarms by the age of the mission
    by_quarter: np.ndarray  # (4,) and by its quarters
    isolation: Times  # of faulty lanes
    detection: Times
    label: np.ndarray  # (n_decided,) true class of all faulty lanes, then of some healthy ones
    decisions: np.ndarray  # (n_decision_times, n_decided) of the same lanes, at `DECISION_TIMES`
    named: np.ndarray  # (n_faulty,) most probable fault at `DECISION_TIME`, in alarm or not
    severity: np.ndarray  # (n_faulty,) estimate given the true class
    severity_std: np.ndarray  # (n_faulty,)
    log_probability: np.ndarray  # (n_beliefs, n_classes) at random instants
    truth: np.ndarray  # (n_beliefs,) true class there

    @property
    def decision(self) -> np.ndarray:
        """The decisions at `DECISION_TIME`, (n_decided,)."""
        return self.decisions[AT_DECISION]

    @property
    def confidence(self) -> np.ndarray:
        """Probability of the most probable class, (n_beliefs,)."""
        return np.exp(self.log_probability.max(axis=1))

    @property
    def right(self) -> np.ndarray:
        """Whether the most probable class is the true one, (n_beliefs,)."""
        return self.log_probability.argmax(axis=1) == self.truth


def assess(threshold: float, faulty: Record, truth: Truth, healthy: HealthyOutcome) -> Assessment:
    """Assess beliefs on faulty lanes and false alarms on healthy ones at a threshold."""
    n_faulty = len(truth.fault)
    alarm = metrics.alarms(faulty.log_normal, threshold, PERSISTENCE)
    decision = np.where(alarm, faulty.fault, NORMAL)
    decision_samples = metrics.sample_at(truth.onset + np.array(DECISION_TIMES)[:, None])
    faulty_decisions = decision[decision_samples, np.arange(n_faulty)]

    healthy_lanes = healthy_beside(n_faulty, len(healthy.least))
    all_healthy_decisions = np.where(healthy.depth < threshold, healthy.fault, NORMAL)
    healthy_decisions = all_healthy_decisions[:, healthy_lanes]
    healthy_beliefs = healthy.log_probability[:, healthy_lanes]
    healthy_label = np.full(healthy_beliefs.shape[:2], NORMAL)

    at_true_class = 0, np.arange(n_faulty), truth.fault  # at the first instant
    begun = is_raised(healthy.low, healthy.high, threshold)
    ended = is_raised(healthy.end_low, healthy.end_high, threshold)
    begin = healthy.begin[begun]
    beliefs = [_by_belief(faulty.log_probability[1:]), _by_belief(healthy_beliefs)]
    return Assessment(
        threshold=threshold,
        false_alarms=int(metrics.count_alarms(Edges(healthy.low, healthy.high), threshold)),
        false_alarm_vehicles=int((healthy.least < threshold).sum()),
        hours=float(healthy.hours.sum()),
        alarm_hours=healthy_time.time_in_alarm(begin, healthy.end[ended]) / 3600.0,
        by_age=healthy_time.by_age(begin, healthy.hours),
        by_quarter=healthy_time.by_quarter(healthy.quarter[begun]),
        isolation=metrics.isolation_time(decision, truth.fault, truth.onset, HORIZON),
        detection=metrics.detection_delay(alarm, truth.onset, HORIZON),
        label=np.concatenate([truth.fault, np.full(len(healthy_lanes), NORMAL)]),
        decisions=np.concatenate([faulty_decisions, healthy_decisions], axis=1),
        named=faulty.fault[decision_samples[AT_DECISION], np.arange(n_faulty)],
        severity=faulty.severity_mean[at_true_class],
        severity_std=faulty.severity_std[at_true_class],
        log_probability=np.concatenate(beliefs),
        truth=np.concatenate([truth.label[1:].ravel(), healthy_label.ravel()]),
    )


def healthy_beside(n_faulty: int, n_healthy: int) -> np.ndarray:
    """Indices of the healthy lanes judged beside the faulty ones, evenly spaced."""
    count = min(round(HEALTHY_PER_FAULTY * n_faulty), n_healthy)
    return np.linspace(0, n_healthy - 1, count).astype(np.int64)


def _by_belief(log_probability: np.ndarray) -> np.ndarray:
    """(n_instants, n_lanes, n_classes) as (n_beliefs, n_classes)."""
    return log_probability.reshape(-1, log_probability.shape[-1]).astype(np.float64)
