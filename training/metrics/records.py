"""What a diagnoser believed along some lanes, and what of it is needed to score healthy lanes."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from auv_fault_env.faults import classes
from auv_fault_env.parameters import SAMPLE_TIME
from diagnosers import Belief
from training.metrics import (
    class_order,
    edges,
    running_maximum,
    sample_at,
    threshold_within,
)

# samples in a row for an alarm, the same for all: outlives a spike, and costs 0.2 s
PERSISTENCE = 3
DECISION_TIMES = (
    1.0,
    2.0,
    5.0,
    10.0,
    20.0,
)  # s after onset, at which decisions are judged
SEVERITY_AT = 20.0  # s after onset, at which the estimate of severity is judged
HORIZON = 30.0  # s after onset, at which delays are censored
MOST_UNNORMALISED = 1e-3  # how far a sum of probabilities may be from 1
# a severity is 0 to 1; its estimate and standard deviation may be this large
LARGEST_SEVERITY = 1e6


class Truth(NamedTuple):
    """What is true of some lanes, over the episode and at the instants.

    The first instant is `SEVERITY_AT` after onset, the others are random. Healthy lanes have class
    0 and a stand-in onset: so they are judged at the same instants as faulty lanes.
    """

    fault: np.ndarray  # (n_lanes,) class
    onset: np.ndarray  # (n_lanes,) [s]
    label: np.ndarray  # (n_instants, n_lanes) class
    severity: np.ndarray  # (n_instants, n_lanes)


class Record(NamedTuple):
    """What a diagnoser believed, classes in the order of `classes()`."""

    log_normal: np.ndarray  # (n_samples, n_lanes) log p(normal)
    fault: np.ndarray  # (n_samples, n_lanes) most probable fault
    # the whole belief, (n_instants, n_lanes, n_classes)
    log_probability: np.ndarray
    severity_mean: np.ndarray
    severity_std: np.ndarray


class HealthyOutcome(NamedTuple):
    """What scores need of healthy lanes: false alarms and decisions at any threshold."""

    low: np.ndarray  # low and high: where alarms begin, as `metrics.Edges`
    high: np.ndarray
    complete: np.ndarray  # (n_chunks,) thresholds up to which these are all
    least: np.ndarray  # (n_lanes,) alarms arise above this threshold
    # (n_decisions, n_lanes): above `depth` an alarm stands at the decision and names `fault`
    depth: np.ndarray
    fault: np.ndarray
    log_probability: np.ndarray  # (n_random, n_lanes, n_classes) at random instants
    hours: np.ndarray  # (n_chunks,) of operation


class Recorder:
    """Records `n_samples` beliefs, whole ones at the samples `instants` (n_instants, n_lanes)."""

    def __init__(self, n_samples: int, instants: np.ndarray):
        self.instants = instants
        over_time = n_samples, instants.shape[1]
        whole = *instants.shape, len(classes())
        self.record = Record(
            np.empty(over_time, np.float32),
            np.empty(over_time, np.int8),
            *(np.empty(whole, np.float32) for _ in range(3)),
        )

    def add(self, k: int, belief: Belief) -> None:
        """Record the belief after sample k, classes in the order of `classes()`."""
        self.record.log_normal[k] = belief.log_probability[:, 0]
        self.record.fault[k] = 1 + belief.log_probability[:, 1:].argmax(axis=1)
        instant, lane = np.nonzero(self.instants == k)
        for recorded, values in zip(self.record[2:], belief, strict=True):
            recorded[instant, lane] = values[lane]


def ordered_belief(belief: Any, diagnoser_classes: Sequence[str], n_lanes: int, k: int) -> Belief:
    """The belief after sample k, classes as `classes()`; `ValueError` says what is wrong."""
    order = class_order(diagnoser_classes, classes())
    error = belief_error(belief, (n_lanes, len(order)))
    if error:
        raise ValueError(f"its {error} at {k * SAMPLE_TIME:.1f} s")
    return Belief(*(np.asarray(values)[:, order] for values in belief))


def belief_error(belief: Any, shape: tuple[int, int]) -> str | None:
    """What is wrong with a belief that should have this shape; None if nothing."""
    if not isinstance(belief, tuple) or len(belief) != len(Belief._fields):
        return f"belief is {type(belief).__name__}, not a Belief,"
    for name, values in zip(Belief._fields, belief, strict=True):
        if np.shape(values) != shape:
            return f"{name} has shape {np.shape(values)} instead of {shape}"
    if any(np.isnan(values).any() for values in belief):
        return "belief is NaN"
    if np.max(np.abs(belief[1:])) > LARGEST_SEVERITY or np.min(belief[2]) < 0.0:
        return "severity is infinite, or its standard deviation negative,"
    total = np.exp(np.asarray(belief[0], np.float64)).sum(axis=1)
    worst = total[np.abs(total - 1.0).argmax()]
    if abs(worst - 1.0) > MOST_UNNORMALISED:
        return f"probabilities sum to {worst:.6g}"
    return None


def healthy_outcome(
    record: Record, onset: np.ndarray, most_alarms: int | None = None
) -> HealthyOutcome:
    """What scores need of the record of healthy lanes with these stand-in onsets (n_lanes,) [s].

    With `most_alarms`, alarms are left out that begin only above a threshold at which these lanes
    alone have more than so many: a threshold that allows as many on all lanes together lies below.
    """
    alarms = edges(record.log_normal, PERSISTENCE)
    complete = 0.0 if most_alarms is None else threshold_within(alarms, most_alarms)
    is_recorded = alarms.low <= complete
    depth = running_maximum(record.log_normal, PERSISTENCE)
    decision_samples = sample_at(onset + np.array(DECISION_TIMES)[:, None])
    at_decisions = decision_samples, np.arange(onset.size)
    return HealthyOutcome(
        low=alarms.low[is_recorded],
        high=alarms.high[is_recorded],
        complete=np.array([complete]),
        least=depth.min(axis=0),
        depth=depth[at_decisions],
        fault=record.fault[at_decisions],
        log_probability=record.log_probability[1:],
        hours=np.array([depth.size * SAMPLE_TIME / 3600.0]),
    )


def concatenate_lanes(parts: Sequence[Any]) -> Any:
    """Tuples of arrays as one, along the lanes: the first axis of vectors, else the second."""
    columns = zip(*parts, strict=True)
    fields = (np.concatenate(arrays, axis=min(arrays[0].ndim - 1, 1)) for arrays in columns)
    return type(parts[0])(*fields)
