"""Rules as text over named symptoms, and how true each class is by them.

``"+a -b ~c"`` asks for symptom a above its healthy value and b below, and speaks against itself
where c has moved; ``<c`` where c is above, ``>c`` where c is below. A symptom of 1 is what a
healthy vehicle shows about once an hour.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from auv_fault_env.errors import known_name
from auv_fault_env.parameters import SIDES

# signs of symptoms that a rule asks for, and of those that speak against it
ASKED = "+-"
AGAINST = "~<>"
# of a symptom that must not come: how much is nothing, and what the rest counts
TOLERANCE = 0.3
WEIGHT = 0.5
# truth at even odds, log odds per truth, log odds between classes
LEVEL = 1.0
GAIN = 6.0
SHARPNESS = 3.0
USUAL = 0.6, 0.25  # severity of which no symptom tells: mean and standard deviation
DEEPEST = 100.0  # largest log odds of a fault, and of an unsupported class


class Rulebook(NamedTuple):
    """Parsed rules, those of a class side by side: where their symptoms stand in what `truths` lays out.

    asked (n_rules, most) and against (n_rules, most): columns, padded with one that changes
    nothing. starts (n_supported,): first rule of each class that has rules; classes (n_supported,):
    its index; n_classes: of all.
    """

    asked: np.ndarray
    against: np.ndarray
    starts: np.ndarray
    classes: np.ndarray
    n_classes: int


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


def parsed(
    rules: Mapping[str, Sequence[str]], symptoms: Sequence[str], classes: Sequence[str]
) -> Rulebook:
    """The rules of each class, any of which suffices; a class, sign or symptom that is not known is refused."""
    columns = {name: k for k, name in enumerate(symptoms)}
    asked = []
    against = []
    owners = []
    for name in sorted(
        rules, key=lambda name: classes.index(known_name("class of a rule", name, classes))
    ):
        for text in rules[name]:
            parts = [
                (
                    known_name("sign", part[0], ASKED + AGAINST),
                    columns[known_name("symptom", part[1:], columns)],
                )
                for part in text.split()
            ]
            asked.append(
                [
                    column + ASKED.index(sign) * len(symptoms)
                    for sign, column in parts
                    if sign in ASKED
                ]
            )
            against.append(
                [
                    column + AGAINST.index(sign) * len(symptoms)
                    for sign, column in parts
                    if sign in AGAINST
                ]
            )
            owners.append(classes.index(name))
    supported, starts = np.unique(owners, return_index=True)
    places = _padded(asked, 2 * len(symptoms)), _padded(against, 3 * len(symptoms))
    return Rulebook(*places, starts, supported, len(classes))


def _padded(rows: list[list[int]], blank: int) -> np.ndarray:
    longest = max(map(len, rows))
    return np.array([row + [blank] * (longest - len(row)) for row in rows], np.int64)


def truths(book: Rulebook, symptoms: np.ndarray) -> np.ndarray:
    """How true each class that has rules is, (n_lanes, n_supported), from symptoms (n_lanes, n_symptoms).

    A rule is as true as the least of what it asks for, less `WEIGHT` times what speaks against it;
    a class as its truest rule.
    """
    edge = np.ones((len(symptoms), 1))
    asked = np.hstack([symptoms, -symptoms, DEEPEST * edge])
    against = np.maximum(
        np.hstack([np.abs(symptoms), symptoms, -symptoms, 0.0 * edge]) - TOLERANCE, 0.0
    )
    truth = asked[:, book.asked].min(axis=2) - WEIGHT * against[:, book.against].sum(axis=2)
    return np.maximum.reduceat(truth, book.starts, axis=1)


def log_probability(book: Rulebook, truth: np.ndarray) -> np.ndarray:
    """Log probabilities (n_lanes, n_classes) from the classes' truths.

    The truest class decides on the odds of a fault, `GAIN` per truth beyond `LEVEL`; each one's
    truth, times `SHARPNESS`, on the class. Misleads: these are degrees of belief, calibrated only
    in the threshold.
    """
    evidence = np.full((len(truth), book.n_classes), -DEEPEST)
    evidence[:, book.classes] = truth
    evidence = evidence[:, 1:]
    highest = evidence.max(axis=1, keepdims=True)
    odds = np.minimum(GAIN * (highest - LEVEL), DEEPEST)
    shares = SHARPNESS * (evidence - highest)
    shares -= np.log(np.exp(shares).sum(axis=1, keepdims=True)) + np.logaddexp(0.0, -odds)
    return np.hstack([-np.logaddexp(0.0, odds), shares])
