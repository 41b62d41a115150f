"""Metrics: pure functions of beliefs and truth over time, vectorised over lanes.

Arrays over time are (n_samples, n_lanes); sample k stands at ``k * SAMPLE_TIME`` seconds. Classes
are indices, 0 is `normal`. Every docstring says how its figure misleads and beside which other one
it must be read.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import norm

from auv_fault_env.errors import finite_in_range, refusal, whole_number
from auv_fault_env.parameters import SAMPLE_TIME
from diagnosers.diagnoser import IMPOSSIBLE

NORMAL = 0
ROUNDING = 1e-9  # s: 61 samples of 0.1 s are a little more than 6.1 s
# of confidence, as in Guo et al., "On calibration of modern neural networks", ICML 2017
N_BINS = 15


class Times(NamedTuple):
    """Seconds from onset to an event, (n_lanes,), and where it is censored at the horizon."""

    time: np.ndarray
    censored: np.ndarray


class Reliability(NamedTuple):
    """Share of the beliefs in each bin, their mean confidence, share that was right, (n_bins,)."""

    share: np.ndarray
    confidence: np.ndarray
    accuracy: np.ndarray


def sample_at(time: np.ndarray | float) -> np.ndarray:
    """Index of the last sample at or before a time [s]."""
    return np.floor(np.asarray(time) / SAMPLE_TIME + 1e-6).astype(np.int64)


def class_order(given: Sequence[str], wanted: Sequence[str]) -> np.ndarray:
    """Columns of beliefs over classes `given` in the order of `wanted`, matched by name.

    Raises `InputError` if the two are not the same set.
    """
    if sorted(given) != sorted(wanted):
        differing = ", ".join(sorted(set(given) ^ set(wanted))) or "doubles"
        allowed = "each of those of the truth, once"
        raise refusal("classes of the belief", tuple(given), allowed, f"correct {differing}")
    return np.array([list(given).index(name) for name in wanted])


def alarms(log_normal: np.ndarray, threshold: float, persistence: int) -> np.ndarray:
    """Where the alarm stands, (n_samples, n_lanes) bool.

    log p(normal) has been below the threshold for `persistence` samples in a row. By itself it
    is no merit: a threshold high enough detects everything at once. Read every figure made from
    it beside the measured false-alarm rate.
    """
    return running_maximum(log_normal, persistence) < threshold


def rising(alarm: np.ndarray) -> np.ndarray:
    """Where an alarm begins; on healthy lanes the sum is the number of false alarms.

    One that never ends counts once, so a diagnoser whose alarm never ends looks better than one
    that flickers; read it beside the detection delay, which such a diagnoser loses (an alarm
    standing at onset detects nothing).
    """
    before = np.zeros_like(alarm)
    before[1:] = alarm[:-1]
    return alarm & ~before


class Edges(NamedTuple):
    """Alarms, (n_edges,) each: one begins at thresholds above `low` and up to `high`."""

    low: np.ndarray
    high: np.ndarray


def edges(log_normal: np.ndarray, persistence: int) -> Edges:
    """Every alarm that some threshold would raise on these lanes, by time and then lane.

    An alarm begins at sample k for thresholds in (m[k], m[k-1]], m being the maximum over the last
    `persistence` samples. Misleads as `rising` does.
    """
    depth = running_maximum(log_normal, persistence)
    before = np.concatenate([np.full_like(depth[:1], np.inf), depth[:-1]])
    falls = depth < before
    return Edges(depth[falls], before[falls])


def count_alarms(found: Edges, threshold: np.ndarray | float) -> np.ndarray:
    """How many alarms begin at a threshold: the sum of `rising`, which misleads likewise."""
    low = np.sort(found.low)
    high = np.sort(found.high)
    begun = np.searchsorted(low, threshold, side="left")
    above = np.searchsorted(high, threshold, side="left")
    return begun - above


def threshold_within(found: Edges, allowed: int) -> float:
    """The largest threshold such that no lower one gives more alarms than allowed."""
    low = np.sort(found.low)
    high = np.sort(found.high)
    # how many alarms begin just above each of the thresholds `low`
    begun = np.searchsorted(low, low, side="right")
    ended = np.searchsorted(high, low, side="right")
    too_many = low[begun - ended > allowed]
    return min(float(too_many[0]), 0.0) if too_many.size else 0.0


def allowed_alarms(duration: float, mean_time: float) -> int:
    """How many alarms so much operation may have, one per mean time, both in seconds."""
    finite_in_range("mean time between false alarms", mean_time, SAMPLE_TIME, math.inf)
    return math.floor(duration / mean_time + 1e-9)


def threshold_for(log_normal: np.ndarray, mean_time: float, persistence: int) -> float:
    """The threshold for one false alarm per `mean_time` [s] on these healthy lanes.

    The largest one up to which no lower threshold gives more rising edges than the lanes' total
    time allows. (Raised further, alarms merge, and the count falls again to one per lane: such
    thresholds are no use.) Exact: it counts the ends of the `edges`. At most 0: p(normal) below 1.
    Misleads on lanes that also serve for scoring, and on few hours: with n alarms allowed, the true
    rate scatters by 1/sqrt(n). Read it beside the rate on other lanes.
    """
    allowed = allowed_alarms(log_normal.size * SAMPLE_TIME, mean_time)
    return threshold_within(edges(log_normal, persistence), allowed)


def running_maximum(values: np.ndarray, window: int) -> np.ndarray:
    """Maximum of the last `window` samples, infinite before there are as many."""
    window = whole_number("persistence", window)
    padded = np.concatenate([np.full_like(values[:1], np.inf).repeat(window - 1, axis=0), values])
    return np.lib.stride_tricks.sliding_window_view(padded, window, axis=0).max(axis=-1)


def detection_delay(alarm: np.ndarray, onset: np.ndarray, horizon: float) -> Times:
    """From onset to the first alarm that begins after it, censored at the horizon [s].

    An alarm before onset, or standing at onset, is a false alarm and never a detection of delay 0.
    Misleads alone: an alarm for the wrong reason counts, and frequent false alarms detect
    everything soon. Read it beside the false-alarm rate and the isolation time.
    """
    time = np.arange(len(alarm))[:, None] * SAMPLE_TIME
    hit = rising(alarm) & (time > onset + ROUNDING) & (time <= onset + horizon + ROUNDING)
    delay = hit.argmax(axis=0) * SAMPLE_TIME - onset
    return _censored(delay, hit.any(axis=0), horizon)


def isolation_time(
    decision: np.ndarray, label: np.ndarray, onset: np.ndarray, horizon: float
) -> Times:
    """Time from onset to the start of the last interval with right decisions to the horizon [s].

    A decision that is wrong at the horizon is censored there, and so is one that was right before
    the fault began: that was luck. Depends on the horizon: a right answer one sample before it
    counts. Read it beside the share isolated.

    Parameters
    ----------
    decision
        (n_samples, n_lanes) class: the most probable fault while the alarm stands, else normal.
    label, onset
        (n_lanes,) true class and its onset [s].
    """
    index = np.arange(len(decision))[:, None]
    end = sample_at(onset + horizon)
    wrong = (decision != label) & (index <= end)
    start = np.where(wrong, index, -1).max(axis=0) + 1
    time = start * SAMPLE_TIME - onset
    return _censored(time, (start <= end) & (time > ROUNDING), horizon)


def _censored(time: np.ndarray, happened: np.ndarray, horizon: float) -> Times:
    return Times(np.where(happened, np.minimum(time, horizon), horizon), ~happened)


def restricted_mean(times: Times) -> float:
    """Mean time [s], lanes where nothing happened counting with the horizon.

    With one horizon for all it is the area above the share-over-time curve. It hides whether few
    lanes are missed or all are slow: read it beside `probability`. The mean over detected lanes
    alone, which rewards missing the difficult ones, is deliberately not here.
    """
    return float(times.time.mean())


def probability(times: Times) -> float:
    """Share of the lanes where it happened within the horizon.

    Says nothing of when: read it beside `restricted_mean`.
    """
    return float(1.0 - times.censored.mean())


def kaplan_meier_median(times: Times) -> float:
    """Kaplan-Meier estimate of the median time [s]; infinite if it never reaches half.

    Censored lanes count as observed until then. Blind to the slower half: read it beside
    `restricted_mean`. Source: Kaplan & Meier, J. Am. Stat. Assoc. 53 (1958) 457.
    """
    event, count = np.unique(times.time[~times.censored], return_counts=True)
    at_risk = (times.time >= event[:, None]).sum(axis=1)
    survival = np.cumprod(1.0 - count / at_risk)
    half = event[survival <= 0.5 + 1e-12]
    return float(half[0]) if half.size else math.inf


def confusion(
    label: np.ndarray,
    decision: np.ndarray,
    n_classes: int,
    weights: np.ndarray | None = None,
) -> np.ndarray:
    """Counts of true class (row) against decided class (column), (n_classes, n_classes).

    With `weights` (..., n_lanes) one matrix for each row of weights. At one instant: early, a
    cautious diagnoser looks bad; read it beside the isolation times.
    """
    cell = label.astype(np.int64) * n_classes + decision
    if weights is None:
        return np.bincount(cell, minlength=n_classes**2).reshape(n_classes, n_classes).astype(float)
    cells = cell[:, None] == np.arange(n_classes**2)
    return (weights @ cells.astype(float)).reshape(*weights.shape[:-1], n_classes, n_classes)


def macro_f1(matrix: np.ndarray) -> np.ndarray:
    """Mean harmonic mean of precision and recall over the classes that occur.

    Confusion matrices (..., n_classes, n_classes) have the truth in rows. Each class weighs the
    same however rare; one that is never the truth, as `unknown` may be, is no F1 of its own and
    counts only as a wrong decision. Depends on the share of healthy lanes through the precision of
    `normal`, and says nothing of which classes are mixed up: read it beside the confusion matrix.
    """
    occurs = matrix.sum(axis=-1) > 0
    return class_f1(matrix).sum(axis=-1) / np.maximum(occurs.sum(axis=-1), 1)


def class_f1(matrix: np.ndarray) -> np.ndarray:
    """Harmonic mean of precision and recall by class, (..., n_classes); see `macro_f1`.

    0 for a class that is never the truth: leave it out of means.
    """
    hits = np.diagonal(matrix, axis1=-2, axis2=-1)
    truth = matrix.sum(axis=-1)
    decided = matrix.sum(axis=-2)
    return 2.0 * hits / np.maximum(truth + decided, 1e-300)


def severity_error(estimate: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """|E[severity | true class] - truth| by lane; the mean is the MAE.

    Given the true class, so it says nothing of whether that was found: read it beside macro-F1. A
    constant estimate in the middle of all severities already has a quarter of their range.
    """
    return np.abs(estimate - truth)


def covered(
    estimate: np.ndarray, std: np.ndarray, truth: np.ndarray, share: float = 0.9
) -> np.ndarray:
    """Whether the central normal interval that should hold `share` of the truths holds it, by lane.

    Wide intervals cover everything: read it beside `severity_error`.
    """
    return np.abs(estimate - truth) <= norm.ppf(0.5 + share / 2) * std


def reliability(confidence: np.ndarray, right: np.ndarray, n_bins: int = N_BINS) -> Reliability:
    """Confidence in the most probable class against how often it is right, by bin.

    Both are (n,): one belief each. Bins have equal width; empty ones are NaN. Bins with few
    beliefs scatter widely: read accuracy beside the share.
    """
    place = np.minimum((confidence * n_bins).astype(np.int64), n_bins - 1)
    count, sure, hits = (
        np.bincount(place, weights, n_bins) for weights in (None, confidence, right)
    )
    with np.errstate(invalid="ignore"):
        return Reliability(count / len(confidence), sure / count, hits / count)


def expected_calibration_error(
    confidence: np.ndarray, right: np.ndarray, n_bins: int = N_BINS
) -> float:
    """Mean distance between confidence and accuracy over the bins, weighted by their share.

    Useless beliefs can be calibrated (the prior always is), errors within a bin cancel, and few
    beliefs bias it upwards. Read it beside `log_loss`.
    """
    bins = reliability(confidence, right, n_bins)
    return float(np.nansum(bins.share * np.abs(bins.confidence - bins.accuracy)))


def brier(log_probability: np.ndarray, label: np.ndarray) -> float:
    """Mean squared distance of probabilities (n, n_classes) from the truth (n,): 0 to 2.

    Forgiving of a truth held impossible; read it beside `log_loss`, which is not.
    """
    truth = np.eye(log_probability.shape[1])[label]
    squared = (np.exp(log_probability) - truth) ** 2
    return float(squared.sum(axis=1).mean())


def log_loss(log_probability: np.ndarray, label: np.ndarray) -> float:
    """Mean of -log p(true class) [nat]; infinite if a truth was held impossible once.

    A few confident errors decide it: read it beside `brier`.
    """
    of_truth = np.take_along_axis(log_probability, label[:, None], axis=1)
    if (of_truth <= IMPOSSIBLE).any():
        return math.inf
    return float(-of_truth.mean())
