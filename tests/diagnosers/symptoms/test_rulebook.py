"""Rules by hand: what they ask for, what speaks against them, and the belief that follows."""

import numpy as np
import pytest

from auv_fault_env.errors import InputError
from diagnosers.symptoms.rulebook import (
    DEEPEST,
    GAIN,
    LEVEL,
    TOLERANCE,
    WEIGHT,
    for_sides,
    log_probability,
    merged,
    parsed,
    truths,
)

CLASSES = ("normal", "one", "two", "three")
SYMPTOMS = ("a", "b", "c")


@pytest.mark.parametrize(
    ("rule", "symptoms", "expected"),
    [
        ("+a -b", (3.0, -2.0, 0.0), 2.0),
        ("+a -b", (3.0, 2.0, 0.0), -2.0),
        ("+a ~c", (3.0, 0.0, -1.0), 3.0 - WEIGHT * (1.0 - TOLERANCE)),
        ("+a <c", (3.0, 0.0, -1.0), 3.0),
        ("+a <c", (3.0, 0.0, 1.0), 3.0 - WEIGHT * (1.0 - TOLERANCE)),
        ("+a >c", (3.0, 0.0, -1.0), 3.0 - WEIGHT * (1.0 - TOLERANCE)),
        ("+a >c >b", (3.0, -1.0, 1.0), 3.0 - WEIGHT * (1.0 - TOLERANCE)),
    ],
)
def test_truth_of_a_rule(rule, symptoms, expected):
    book = parsed({"two": (rule,)}, SYMPTOMS, CLASSES)
    assert truths(book, np.array([symptoms])).item() == pytest.approx(expected)


def test_a_class_is_as_true_as_its_truest_rule_and_classes_may_come_in_any_order():
    book = parsed({"three": ("+c",), "one": ("+a", "+b -c")}, SYMPTOMS, CLASSES)
    np.testing.assert_allclose(truths(book, np.array([[1.0, 4.0, -3.0]])), [[3.0, -3.0]])
    assert book.classes.tolist() == [1, 3]


def test_belief_from_truths():
    book = parsed({"one": ("+a",), "two": ("+b",)}, SYMPTOMS, CLASSES)
    truth = np.array([[LEVEL, LEVEL - 50.0], [LEVEL + 2.0, LEVEL + 2.0], [1e6, 0.0]])
    chances = log_probability(book, truth)
    np.testing.assert_allclose(np.exp(chances).sum(axis=1), 1.0)
    np.testing.assert_allclose(np.exp(chances[0, :2]), 0.5)
    assert chances[1, 0] == pytest.approx(-2.0 * GAIN, rel=1e-4) and chances[1, 1] == chances[1, 2]
    assert chances[2, 0] == pytest.approx(-DEEPEST)


def test_books_merge_and_sides_are_written_out():
    book = merged({"x": ("+a",)}, {"x": ("+b",)}, for_sides({"y:{side}": ("-{side}_z",)}))
    assert book == {"x": ("+a", "+b"), "y:port": ("-port_z",), "y:starboard": ("-starboard_z",)}


def test_unknown_names_are_refused():
    with pytest.raises(InputError, match="class of a rule"):
        parsed({"four": ("+a",)}, SYMPTOMS, CLASSES)
    with pytest.raises(InputError, match="symptom"):
        parsed({"one": ("+d",)}, SYMPTOMS, CLASSES)
    with pytest.raises(InputError, match="sign"):
        parsed({"one": ("+a *b",)}, SYMPTOMS, CLASSES)
