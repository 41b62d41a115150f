"""What a diagnoser believed along some lanes, and what of it is needed to score healthy lanes."""

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
DECISION_TIMES = (1.0, 2.0, 5.0, 10.0, 20.0)  # s after onset, at which decisions are judged
SEVERITY_AT = 20.0  # s after onset, at which the estimate of severity is judged
HORIZON = 30.0  # s after onset, at which delays are censored
MOST_UNNORMALISED = 1e-3  # how far a sum of probabilities may be from 1
# a severity is 0 to 1; its estimate and standard deviation may be this large
LARGEST_SEVERITY = 1e6


class Truth(NamedTuple):
    """What is true of some lanes, over the episode and at the instants.

    The first instant is `SEVERITY_AT` after onset, the others are random. Healthy lanes have class
    0 and a stand-in onset at which nothing happens: so they are judged at the same instants as
    faulty lanes.

    Attributes
    ----------
    fault, onset
        (n_lanes,) class of the fault and its onset [s].
    label, severity
        (n_instants, n_lanes) class and severity at the instants.
    """

    fault: np.ndarray
    onset: np.ndarray
    label: np.ndarray
    severity: np.ndarray


class Record(NamedTuple):
    """What a diagnoser believed, classes in the order of `classes()`.

    Attributes
    ----------
    log_normal, fault
        (n_samples, n_lanes) log p(normal) and the most probable fault at all samples.
    log_probability, severity_mean, severity_std
        (n_instants, n_lanes, n_classes) the whole belief at the instants.
    """

    log_normal: np.ndarray
    fault: np.ndarray
    log_probability: np.ndarray
    severity_mean: np.ndarray
    severity_std: np.ndarray


class HealthyOutcome(NamedTuple):
    """What scores need of healthy lanes: false alarms and decisions at any threshold.

    Attributes
    ----------
    low, high
        Where alarms begin, as `metrics.Edges`.
    complete
        (n_chunks,) thresholds up to which these are all.
    least
        (n_lanes,) alarms arise above this threshold.
    depth, fault
        (n_decisions, n_lanes): above this threshold an alarm stands at the time of decision, and
        then this fault is named.
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
    """Records the beliefs of a diagnoser sample by sample.

    Parameters
    ----------
    n_samples
        How many beliefs come.
    instants
        (n_instants, n_lanes) samples at which the whole belief is recorded.
    """

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
    """The belief after sample k with its classes in the order of `classes()`.

    Raises
    ------
    ValueError
        If it is not a belief over these classes and lanes; says what is wrong and when.
    """
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
    fields = []
    for arrays in zip(*parts, strict=True):
        axis = min(arrays[0].ndim - 1, 1)
        fields.append(np.concatenate(arrays, axis=axis))
    return type(parts[0])(*fields)
