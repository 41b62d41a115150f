"""From the operating modes of the thesis' tables to beliefs over all classes."""

from collections.abc import Collection, Mapping

import numpy as np

from auv_fault_env.faults import UNKNOWN

LEAST = -500.0  # log probability of a mode: far from where exp gives zero
IMPOSSIBLE_SHARE = 1e-12  # by which the share of an impossible class is multiplied
# mean and standard deviation of a uniform one on 0.2 to 1, where there is no estimate
PRIOR_SEVERITY = 0.6, 0.8 / 12**0.5


def class_shares(
    labels: Mapping[str, str | None], modes: tuple[str, ...], impossible: Collection[str] = ()
) -> np.ndarray:
    """The share of every known class in each mode, (n_modes, n_known); rows sum to 1.

    The classes with a mode's label share its probability evenly. Classes without a mode in the
    table look like any fault: each takes the same constant share of every mode but the first,
    `normal`, that which it has among all faults if these are equally likely. Classes that are
    impossible on a vehicle have next to no share. Misleads where such a fault looks normal.
    """
    known = [label for name, label in labels.items() if name != UNKNOWN]
    of_class = np.array(known, dtype=object)
    n_faults = len(of_class) - 1
    table = np.array([of_class == mode for mode in modes], dtype=np.float64)
    table /= table.sum(axis=1, keepdims=True)
    has_mode = np.array([label in modes for label in of_class])
    without_mode = ~has_mode / n_faults
    left = 1.0 - without_mode.sum()
    table[1:] = table[1:] * left + without_mode
    if impossible:
        names = [name for name in labels if name != UNKNOWN]
        table[:, [name in impossible for name in names]] *= IMPOSSIBLE_SHARE
        table /= table.sum(axis=1, keepdims=True)
    return table


def log_softmax(scores: np.ndarray) -> np.ndarray:
    """Logarithm of the probabilities that are proportional to exp(scores) along the last axis."""
    scores = scores - scores.max(axis=-1, keepdims=True)
    total = np.exp(scores).sum(axis=-1, keepdims=True)
    return scores - np.log(total)


def class_log_probability(log_modes: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """Log probabilities (n, n_known) from those of the modes (n, n_modes) and `class_shares`."""
    probability = np.exp(np.maximum(log_modes, LEAST))
    return np.log(probability @ shares)
