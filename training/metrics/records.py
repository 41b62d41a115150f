"""What a diagnoser believed along some lanes, and what of it is needed to score healthy lanes."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from auv_fault_env.faults import classes
from auv_fault_env.parameters import SAMPLE_TIME
from diagnosers import Belief
from training.metrics import (
    Edges,
    class_order,
    running_maximum,
    sample_at,
    threshold_within,
)
from training.metrics.healthy_time import N_QUARTERS, Changes, begins, ends

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
# greatest threshold: no alarm while `normal` is more probable than that
HIGHEST_THRESHOLD = math.log(0.9)
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
    log_fault: np.ndarray  # (n_samples, n_lanes) its log probability
    # the whole belief, (n_instants, n_lanes, n_classes)
    log_probability: np.ndarray
    severity_mean: np.ndarray
    severity_std: np.ndarray


class HealthyOutcome(NamedTuple):
    """What scores need of healthy lanes: false alarms and decisions at any threshold."""

    low: np.ndarray  # low and high: where alarms begin, as `metrics.Edges`
    high: np.ndarray
    begin: np.ndarray  # (n_edges,) when they begin [s]
    quarter: np.ndarray  # (n_edges,) and in which quarter of the mission, 0 to 3
    end_low: np.ndarray  # where alarms end, likewise
    end_high: np.ndarray
    end: np.ndarray  # (n_ends,) when they end [s]
    complete: np.ndarray  # (n_chunks,) thresholds up to which these are all
    least: np.ndarray  # (n_lanes,) alarms arise above this threshold
    # (n_decisions, n_lanes): above `depth` an alarm stands at the decision and names `fault`
    depth: np.ndarray
    fault: np.ndarray
    log_probability: np.ndarray  # (n_random, n_lanes, n_classes) at random instants
    hours: np.ndarray  # (n_lanes,) of operation


class Recorder:
    """Records beliefs, whole ones at the samples `instants` (n_instants, n_lanes).

    n_samples is the length of all lanes, or of each, (n_lanes,): after its end a lane is not in
    alarm.
    """

    def __init__(self, n_samples: int | np.ndarray, instants: np.ndarray):
        self.instants = instants
        self.lengths = np.broadcast_to(n_samples, instants.shape[1])
        n_samples = int(self.lengths.max())
        over_time = n_samples, instants.shape[1]
        whole = *instants.shape, len(classes())
        self.record = Record(
            np.empty(over_time, np.float32),
            np.empty(over_time, np.int8),
            np.empty(over_time, np.float32),
            *(np.empty(whole, np.float32) for _ in range(3)),
        )

    def add(self, k: int, belief: Belief) -> None:
        """Record the belief after sample k, classes in the order of `classes()`."""
        log_probability = belief.log_probability
        fault = 1 + log_probability[:, 1:].argmax(axis=1)
        log_normal = np.where(k < self.lengths, log_probability[:, 0], np.inf)
        self.record.log_normal[k] = log_normal
        self.record.fault[k] = fault
        self.record.log_fault[k] = np.take_along_axis(log_probability, fault[:, None], 1)[:, 0]
        instant, lane = np.nonzero(self.instants == k)
        whole = self.record.log_probability, self.record.severity_mean, self.record.severity_std
        for recorded, values in zip(whole, belief, strict=True):
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

    Alarms are left out that only thresholds above `HIGHEST_THRESHOLD` would raise. With
    `most_alarms`, those are as well that begin only above a threshold at which these lanes alone
    have more than so many: a threshold that allows as many on all lanes together lies below.
    """
    depth = running_maximum(record.log_normal, PERSISTENCE)
    lengths = (record.log_normal != np.inf).sum(axis=0)
    begun = begins(depth)
    ended = ends(depth)
    complete = HIGHEST_THRESHOLD
    if most_alarms is not None:
        complete = min(complete, threshold_within(Edges(begun.low, begun.high), most_alarms))
    begun = _below(complete, begun)
    ended = _below(complete, ended)
    decision_samples = sample_at(onset + np.array(DECISION_TIMES)[:, None])
    at_decisions = decision_samples, np.arange(onset.size)
    return HealthyOutcome(
        low=begun.low,
        high=begun.high,
        begin=(begun.sample * SAMPLE_TIME).astype(np.float32),
        quarter=(N_QUARTERS * begun.sample // lengths[begun.lane]).astype(np.int8),
        end_low=ended.low,
        end_high=ended.high,
        end=(ended.sample * SAMPLE_TIME).astype(np.float32),
        complete=np.array([complete]),
        least=depth.min(axis=0),
        depth=depth[at_decisions],
        fault=record.fault[at_decisions],
        log_probability=record.log_probability[1:],
        hours=lengths * SAMPLE_TIME / 3600.0,
    )


def _below(complete: float, changes: Changes) -> Changes:
    """The changes that some threshold up to `complete` brings about."""
    chosen = changes.low <= complete
    return Changes(*(values[chosen] for values in changes))


def concatenate_lanes(parts: Sequence[Any]) -> Any:
    """Tuples of arrays as one, along the lanes: the first axis of vectors, else the second."""
    columns = zip(*parts, strict=True)
    fields = (np.concatenate(arrays, axis=min(arrays[0].ndim - 1, 1)) for arrays in columns)
    return type(parts[0])(*fields)
