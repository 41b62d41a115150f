"""95 % intervals of figures over the lanes of a sample.

They do not cover a diagnoser trained with another seed, nor another plant.
"""

import numpy as np
from scipy.stats import chi2

from training.metrics import confusion, macro_f1

Interval = tuple[float, float]
RESAMPLES = 2000


def interval(values: np.ndarray, seed: int, n: int = RESAMPLES) -> Interval:
    """Bootstrap interval of the mean of values (n_lanes,).

    Misleads where the same lanes serve two diagnosers: overlapping intervals may hide a sure
    difference. Compare with `paired_bootstrap`.
    """
    counts = resamples(len(values), seed, n)
    return central(counts @ values / len(values))


def paired_bootstrap(a: np.ndarray, b: np.ndarray, seed: int, n: int = RESAMPLES) -> Interval:
    """Interval of mean(a) - mean(b) over the same lanes (n_lanes,), resampled together.

    Small but sure differences are apart from zero: read it beside their size.
    """
    return interval(np.asarray(a) - np.asarray(b), seed, n)


def f1_interval(
    label: np.ndarray,
    decision: np.ndarray,
    n_classes: int,
    seed: int,
    n: int = RESAMPLES,
) -> Interval:
    """Interval of macro-F1 by resampling lanes; label and decision (n_lanes,)."""
    values = resampled_f1(label, decision, n_classes, seed, n)
    return central(values)


def paired_f1(
    label: np.ndarray,
    a: np.ndarray,
    b: np.ndarray,
    n_classes: int,
    seed: int,
    n: int = RESAMPLES,
) -> Interval:
    """Interval of the macro-F1 of decisions a minus that of b, (n_lanes,), resampled together."""
    first = resampled_f1(label, a, n_classes, seed, n)
    second = resampled_f1(label, b, n_classes, seed, n)
    return central(first - second)


def poisson_interval(count: int, duration: float) -> Interval:
    """Exact interval (Garwood, Biometrika 28 (1936) 437) of a rate, from a count over a duration.

    Takes the events as independent; alarms that flicker are not, and the true interval is wider.
    """
    low = chi2.ppf(0.025, 2 * count) / 2 if count else 0.0
    high = chi2.ppf(0.975, 2 * count + 2) / 2
    return float(low / duration), float(high / duration)


def resamples(n_lanes: int, seed: int | list[int], n: int = RESAMPLES) -> np.ndarray:
    """How often each lane is in each resample, (n, n_lanes)."""
    random = np.random.default_rng(seed)
    chance = np.full(n_lanes, 1.0 / n_lanes)
    return random.multinomial(n_lanes, chance, size=n)


def resampled_f1(
    label: np.ndarray, decision: np.ndarray, n_classes: int, seed: int, n: int = RESAMPLES
) -> np.ndarray:
    """Macro-F1 of resamples of the lanes, (n,); equal seeds have equal resamples."""
    counts = resamples(len(label), seed, n)
    return macro_f1(confusion(label, decision, n_classes, counts))


def central(values: np.ndarray) -> Interval:
    """The interval that holds the central 95 % of the values (n,) of resamples."""
    low, high = np.percentile(values, [2.5, 97.5])
    return float(low), float(high)
