"""Rules as text over named symptoms, and how much the symptoms support each class.

``"+a -b ~c"`` requires symptom a above its healthy value and b below, and loses support where c
differs from it; ``<c`` where c is above, ``>c`` where c is below. A healthy vehicle reaches a
symptom of 1 about once an hour.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from auv_fault_env.errors import known_name
from auv_fault_env.parameters import SIDES
from diagnosers.diagnoser import join_odds

# signs of symptoms that a rule requires, and of those that contradict it
REQUIRED = "+-"
CONTRADICTING = "~<>"
# a contradicting symptom counts beyond the tolerance, by the weight
TOLERANCE = 0.3
WEIGHT = 0.5
# support at even odds; log odds of a fault, and between classes, per support
EVEN_SUPPORT = 1.0
GAIN = 6.0
SHARPNESS = 3.0
LARGEST_LOG_ODDS = 100.0  # of a fault, and of an unsupported class


class Rulebook(NamedTuple):
    """Parsed rules, those of a class side by side."""

    # (n_rules, most), columns in the tables of `support`, padded with one that changes nothing
    required: np.ndarray
    contradicting: np.ndarray
    first_rules: np.ndarray  # (n_supported,), first rule of each class that has rules
    classes: np.ndarray  # (n_supported,), index of the class
    n_classes: int  # of all


def merge_rules(*books: Mapping[str, Sequence[str]]) -> dict[str, tuple[str, ...]]:
    """The rules of several books, by class."""
    rules: dict[str, tuple[str, ...]] = {}
    for book in books:
        for name, texts in book.items():
            rules[name] = (*rules.get(name, ()), *texts)
    return rules


def rules_of_sides(book: Mapping[str, Sequence[str]]) -> dict[str, tuple[str, ...]]:
    """The rules with each side for ``{side}``."""
    rules = {}
    for side in SIDES:
        for name, texts in book.items():
            rules[name.format(side=side)] = tuple(text.format(side=side) for text in texts)
    return rules


def parse_rules(
    rules: Mapping[str, Sequence[str]],
    symptoms: Sequence[str],
    classes: Sequence[str],
) -> Rulebook:
    """The rulebook of rules by class, one of which suffices.

    Raises `InputError` for an unknown class, sign or symptom.
    """
    for name in rules:
        known_name("class of a rule", name, classes)
    required = []
    contradicting = []
    owners = []
    for name in sorted(rules, key=classes.index):
        for text in rules[name]:
            required.append(_columns(text, REQUIRED, symptoms))
            contradicting.append(_columns(text, CONTRADICTING, symptoms))
            owners.append(classes.index(name))
    supported, first_rules = np.unique(owners, return_index=True)
    return Rulebook(
        _padded(required, len(REQUIRED) * len(symptoms)),
        _padded(contradicting, len(CONTRADICTING) * len(symptoms)),
        first_rules,
        supported,
        len(classes),
    )


def _columns(text: str, signs: str, symptoms: Sequence[str]) -> list[int]:
    """Columns of the parts with these signs in a table with one block of symptoms for each sign."""
    columns = []
    for part in text.split():
        sign = known_name("sign", part[0], REQUIRED + CONTRADICTING)
        symptom = symptoms.index(known_name("symptom", part[1:], symptoms))
        if sign in signs:
            columns.append(symptom + signs.index(sign) * len(symptoms))
    return columns


def _padded(rows: list[list[int]], blank: int) -> np.ndarray:
    longest = max(map(len, rows))
    padded = [row + [blank] * (longest - len(row)) for row in rows]
    return np.array(padded, np.int64)


def support(book: Rulebook, symptoms: np.ndarray) -> np.ndarray:
    """Support (n_lanes, n_supported) of the classes with rules, by symptoms (n_lanes, n_symptoms).

    The support of a rule is the least of the symptoms it requires, less `WEIGHT` times those that
    contradict it; that of a class is that of its best rule.
    """
    column = np.ones((len(symptoms), 1))
    required = np.hstack([symptoms, -symptoms, LARGEST_LOG_ODDS * column])
    magnitudes = np.hstack([np.abs(symptoms), symptoms, -symptoms, 0.0 * column])
    contradicting = np.maximum(magnitudes - TOLERANCE, 0.0)
    least = required[:, book.required].min(axis=2)
    loss = WEIGHT * contradicting[:, book.contradicting].sum(axis=2)
    return np.maximum.reduceat(least - loss, book.first_rules, axis=1)


def log_probability(book: Rulebook, class_support: np.ndarray) -> np.ndarray:
    """Log probabilities (n_lanes, n_classes) from the `support` of the classes.

    The best class decides on the odds of a fault, `GAIN` per support beyond `EVEN_SUPPORT`; the
    support of each, times `SHARPNESS`, on the class. Misleads: these are degrees of belief,
    calibrated only in the threshold.
    """
    evidence = np.full((len(class_support), book.n_classes), -LARGEST_LOG_ODDS)
    evidence[:, book.classes] = class_support
    evidence = evidence[:, 1:]
    highest = evidence.max(axis=1, keepdims=True)
    log_odds = np.minimum(GAIN * (highest - EVEN_SUPPORT), LARGEST_LOG_ODDS)
    return join_odds(log_odds, SHARPNESS * (evidence - highest))
