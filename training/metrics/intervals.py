"""95 % intervals: how far a figure could be off by the luck of the lanes drawn.

They know nothing of a diagnoser trained with another seed, nor of a plant unlike ours.
"""

import numpy as np
from scipy.stats import chi2

from training.metrics.metrics import confusion, macro_f1

Interval = tuple[float, float]
RESAMPLES = 2000


def interval(values: np.ndarray, seed: int, n: int = RESAMPLES) -> Interval:
    """Bootstrap interval of the mean of values (n_lanes,).

    Misleads where the same lanes serve two diagnosers: overlapping intervals may hide a sure
    difference. Compare with `paired_bootstrap`.
    """
    return central(resamples(len(values), seed, n) @ values / len(values))


def paired_bootstrap(a: np.ndarray, b: np.ndarray, seed: int, n: int = RESAMPLES) -> Interval:
    """Interval of mean(a) - mean(b) over lanes (n_lanes,) that both have met, each resample the same for both.

    Small but sure differences are apart from zero: read it beside their size.
    """
    return interval(np.asarray(a) - np.asarray(b), seed, n)


def f1_interval(
    label: np.ndarray, decision: np.ndarray, n_classes: int, seed: int, n: int = RESAMPLES
) -> Interval:
    """Interval of macro-F1 by resampling lanes; label and decision (n_lanes,)."""
    return central(_resampled_f1(label, decision, n_classes, seed, n))


def paired_f1(
    label: np.ndarray, a: np.ndarray, b: np.ndarray, n_classes: int, seed: int, n: int = RESAMPLES
) -> Interval:
    """Interval of the macro-F1 of decisions a minus that of decisions b, (n_lanes,) each, over the same resamples."""
    first, second = (_resampled_f1(label, decision, n_classes, seed, n) for decision in (a, b))
    return central(first - second)


def poisson_interval(count: int, duration: float) -> Interval:
    """Exact interval (Garwood, Biometrika 28 (1936) 437) of a rate, from a count over a duration.

    Takes the events as independent; alarms that flicker are not, and the true interval is wider.
    """
    low = chi2.ppf(0.025, 2 * count) / 2 if count else 0.0
    return float(low / duration), float(chi2.ppf(0.975, 2 * count + 2) / 2 / duration)


def resamples(n_lanes: int, seed: int | list[int], n: int = RESAMPLES) -> np.ndarray:
    """How often each lane is drawn in each resample, (n, n_lanes)."""
    return np.random.default_rng(seed).multinomial(n_lanes, np.full(n_lanes, 1.0 / n_lanes), size=n)


def _resampled_f1(
    label: np.ndarray, decision: np.ndarray, n_classes: int, seed: int, n: int
) -> np.ndarray:
    return macro_f1(confusion(label, decision, n_classes, resamples(len(label), seed, n)))


def central(values: np.ndarray) -> Interval:
    """The interval that holds the central 95 % of the values (n,) of resamples."""
    low, high = np.percentile(values, [2.5, 97.5])
    return float(low), float(high)
