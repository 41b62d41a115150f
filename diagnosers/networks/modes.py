"""From the operating modes of the thesis' tables to beliefs over all classes, by what a table knows of them."""

from collections.abc import Mapping

import numpy as np

LEAST = -500.0  # of a mode's log-probability: far from where exp gives zero
# mean and standard deviation where nothing is known: uniform on 0.2 to 1
PRIOR_SEVERITY = 0.6, 0.8 / 12**0.5


def class_shares(labels: Mapping[str, str | None], modes: tuple[str, ...]) -> np.ndarray:
    """What of each mode's probability goes to each class, (n_modes, n_classes); rows sum to 1.

    A mode's probability is shared evenly by the classes of that label. Classes that the table does
    not know (None) look like any fault: each takes the same constant share of every mode but the
    first, `normal`, that which it has among all faults if these are equally likely. Misleads where
    an unknown fault looks normal.
    """
    of_class = list(labels.values())
    table = np.array([[label == mode for label in of_class] for mode in modes], dtype=np.float64)
    table /= table.sum(axis=1, keepdims=True)
    unknown = np.array([label is None for label in of_class]) / (len(of_class) - 1)
    table[1:] = table[1:] * (1.0 - unknown.sum()) + unknown
    return table


def log_softmax(scores: np.ndarray) -> np.ndarray:
    """Logarithm of the probabilities that are proportional to exp(scores) along the last axis."""
    scores = scores - scores.max(axis=-1, keepdims=True)
    return scores - np.log(np.exp(scores).sum(axis=-1, keepdims=True))


def class_log_probability(log_modes: np.ndarray, table: np.ndarray) -> np.ndarray:
    """Log-probability of every class (n, n_classes) from that of the modes (n, n_modes) and their `class_shares`."""
    return np.log(np.exp(np.maximum(log_modes, LEAST)) @ table)
