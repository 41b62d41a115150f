"""What a diagnoser believed along some lanes, recorded sample by sample, and what of it healthy lanes leave behind."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from auv_fault_env.faults import classes
from auv_fault_env.parameters import SAMPLE_TIME
from diagnosers import Belief
from training.metrics.metrics import (
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
)  # s after onset, instants at which decisions are judged
HORIZON = 30.0  # s after onset, up to which it is watched
UNNORMALISED = 1e-3  # how far a sum of probabilities may be from 1
# of what may still be an honest estimate of a number from 0 to 1, and its spread
LARGEST_SEVERITY = 1e6


class Truth(NamedTuple):
    """What is so: fault class and onset [s], (n_lanes,); label and severity at the instants, (n_instants, n_lanes).

    The first instant is some time after onset, the others random. Healthy lanes have class 0 and,
    so that they can be judged at the same instants as faulty ones, an onset at which nothing
    happens.
    """

    fault: np.ndarray
    onset: np.ndarray
    label: np.ndarray
    severity: np.ndarray


class Record(NamedTuple):
    """What a diagnoser believed, classes in the order of `classes()`, lanes last or before the classes.

    log p(normal) and the most probable fault at all times, (n_samples, n_lanes); the whole belief
    at the instants, (n_instants, n_lanes, n_classes).
    """

    log_normal: np.ndarray
    fault: np.ndarray
    log_probability: np.ndarray
    severity_mean: np.ndarray
    severity_std: np.ndarray


class HealthyOutcome(NamedTuple):
    """What healthy lanes leave behind: all that false alarms and decisions at any threshold depend on.

    Attributes
    ----------
    low, high
        Where alarms begin, as `metrics.Edges`.
    complete
        (n_chunks,) thresholds up to which these are all.
    least
        (n_lanes,) alarms arise above this threshold.
    depth, fault
        (n_decided, n_lanes): alarms stand above this threshold at the instants, and then this fault
        is named.
    log_probability
        (n_random, n_lanes, n_classes) at random instants.
    hours
        (n_chunks,) of operation.
    """

    low: np.ndarray
    high: np.ndarray
    complete: np.ndarray
    least: np.ndarray
    depth: np.ndarray
    fault: np.ndarray
    log_probability: np.ndarray
    hours: np.ndarray


class Recorder:
    """Takes the beliefs of a diagnoser as they come; one that is none is refused, with the time.

    Parameters
    ----------
    given
        Classes of the beliefs.
    n_samples
        How many beliefs come.
    instants
        (n_instants, n_lanes) samples at which the whole belief is kept.
    """

    def __init__(self, given: Sequence[str], n_samples: int, instants: np.ndarray):
        self.order = class_order(given, classes())
        self.instants = instants
        n_lanes = instants.shape[1]
        whole = (*instants.shape, len(self.order))
        self.record = Record(
            np.empty((n_samples, n_lanes), np.float32),
            np.empty((n_samples, n_lanes), np.int8),
            *(np.empty(whole, np.float32) for _ in range(3)),
        )

    def note(self, k: int, belief: Belief) -> Belief:
        """Keep the belief after sample k, and give it back in the order of `classes()`; `ValueError` if it is none."""
        fault = belief_error(belief, (self.instants.shape[1], len(self.order)))
        if fault:
            raise ValueError(f"its {fault} at {k * SAMPLE_TIME:.1f} s")
        ordered = Belief(*(np.asarray(values)[:, self.order] for values in belief))
        self.record.log_normal[k] = ordered.log_probability[:, 0]
        self.record.fault[k] = 1 + ordered.log_probability[:, 1:].argmax(axis=1)
        instant, lane = np.nonzero(self.instants == k)
        for kept, values in zip(self.record[2:], ordered, strict=True):
            kept[instant, lane] = values[lane]
        return ordered


def belief_error(belief: Any, shape: tuple[int, int]) -> str | None:
    """What is wrong with a belief that ought to have this shape, if anything is."""
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
    return f"probabilities sum to {worst:.6g}" if abs(worst - 1.0) > UNNORMALISED else None


def healthy_outcome(record: Record, onset: np.ndarray, keep: int | None = None) -> HealthyOutcome:
    """What is left of the record of healthy lanes, their onsets (n_lanes,) being instants at which nothing happens.

    With `keep`, alarms are left out that begin only above a threshold at which these lanes alone
    have more than so many: a threshold that allows as many on all lanes together lies below.
    """
    found = edges(record.log_normal, PERSISTENCE)
    complete = 0.0 if keep is None else threshold_within(found, keep)
    kept = found.low <= complete
    depth = running_maximum(record.log_normal, PERSISTENCE)
    at = sample_at(onset + np.array(DECISION_TIMES)[:, None]), np.arange(onset.size)
    return HealthyOutcome(
        found.low[kept],
        found.high[kept],
        np.array([complete]),
        depth.min(axis=0),
        depth[at],
        record.fault[at],
        record.log_probability[1:],
        np.array([depth.size * SAMPLE_TIME / 3600.0]),
    )


def concatenate_lanes(parts: Sequence[Any]) -> Any:
    """Tuples of arrays as one, put together along the axis of the lanes: the only one of vectors, else the second."""
    columns = zip(*parts, strict=True)
    return type(parts[0])(
        *(np.concatenate(arrays, axis=min(arrays[0].ndim - 1, 1)) for arrays in columns)
    )
