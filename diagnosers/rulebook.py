"""Rules as text over named symptoms, and how true each class is by them.

``"+a -b ~c"`` asks for symptom a above its healthy value and b below, and speaks against itself where c has moved;
``<c`` where c is above, ``>c`` where c is below. A symptom of 1 is what a healthy vehicle shows about once an hour.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import logsumexp

from auv_fault_env.errors import known_name
from auv_fault_env.parameters import SIDES

TOLERANCE, WEIGHT = 0.3, 0.5  # of a symptom that must not come: how much is nothing, and what the rest counts
LEVEL, GAIN, SHARPNESS = 1.0, 6.0, 3.0  # truth at even odds, log odds per truth, log odds between classes
DEEPEST = 100.0  # largest log odds of a fault, and of an unsupported class

Rule = tuple[int, tuple[tuple[str, int], ...]]  # class index; sign and symptom's column


def merged(*books: Mapping[str, Sequence[str]]) -> dict[str, tuple[str, ...]]:
    """The rules of several books, by class."""
    rules: dict[str, tuple[str, ...]] = {}
    for book in books:
        for name, texts in book.items():
            rules[name] = (*rules.get(name, ()), *texts)
    return rules


def for_sides(book: Mapping[str, Sequence[str]]) -> dict[str, tuple[str, ...]]:
    """A book of rules for ``{side}``, written out for both sides."""
    return {
        name.format(side=side): tuple(text.format(side=side) for text in texts)
        for side in SIDES
        for name, texts in book.items()
    }


def parsed(rules: Mapping[str, Sequence[str]], symptoms: Sequence[str], classes: Sequence[str]) -> tuple[Rule, ...]:
    """The rules of each class, any of which suffices; a class or symptom that is not known is refused."""
    columns = {name: k for k, name in enumerate(symptoms)}
    return tuple(
        (
            classes.index(known_name("class of a rule", name, classes)),
            tuple((part[0], columns[known_name("symptom", part[1:], columns)]) for part in text.split()),
        )
        for name, texts in rules.items()
        for text in texts
    )


def truth(parts: Sequence[tuple[str, int]], symptoms: np.ndarray) -> np.ndarray:
    """How true a rule is (n_lanes,): the least of what it asks for, less `WEIGHT` times what speaks against it."""
    asked, against = np.full(len(symptoms), DEEPEST), np.zeros(len(symptoms))
    for sign, column in parts:
        value = symptoms[:, column]
        if sign in "+-":
            asked = np.minimum(asked, value if sign == "+" else -value)
        else:
            contrary = {"~": np.abs(value), "<": value, ">": -value}[sign]
            against += np.maximum(contrary - TOLERANCE, 0.0)
    return asked - WEIGHT * against


def log_probability(rules: Sequence[Rule], symptoms: np.ndarray, n_classes: int) -> np.ndarray:
    """Log probabilities (n_lanes, n_classes) from symptoms (n_lanes, n_symptoms).

    The truest rule decides on the odds of a fault, `GAIN` per truth beyond `LEVEL`; its truth among those of the other
    classes, times `SHARPNESS`, on the class. Misleads: these are degrees of belief, calibrated only in the threshold.
    """
    evidence = np.full((len(symptoms), n_classes - 1), -DEEPEST)
    for k, parts in rules:
        evidence[:, k - 1] = np.maximum(evidence[:, k - 1], truth(parts, symptoms))
    odds = np.minimum(GAIN * (evidence.max(axis=1, keepdims=True) - LEVEL), DEEPEST)
    shares = SHARPNESS * evidence - logsumexp(SHARPNESS * evidence, axis=1, keepdims=True)
    return np.hstack([-np.logaddexp(0.0, odds), shares - np.logaddexp(0.0, -odds)])
