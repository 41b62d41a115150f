"""Rules by hand: what they require, what contradicts them, and the belief that follows."""

import numpy as np
import pytest

from auv_fault_env.errors import InputError
from diagnosers.symptoms.rulebook import (
    EVEN_SUPPORT,
    GAIN,
    LARGEST_LOG_ODDS,
    TOLERANCE,
    WEIGHT,
    log_probability,
    merge_rules,
    parse_rules,
    rules_of_sides,
    support,
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
def test_support_of_a_rule(rule, symptoms, expected):
    book = parse_rules({"two": (rule,)}, SYMPTOMS, CLASSES)
    assert support(book, np.array([symptoms])).item() == pytest.approx(expected)


def test_the_best_rule_supports_a_class_and_classes_may_come_in_any_order():
    book = parse_rules({"three": ("+c",), "one": ("+a", "+b -c")}, SYMPTOMS, CLASSES)
    np.testing.assert_allclose(support(book, np.array([[1.0, 4.0, -3.0]])), [[3.0, -3.0]])
    assert book.classes.tolist() == [1, 3]


def test_belief_from_support():
    book = parse_rules({"one": ("+a",), "two": ("+b",)}, SYMPTOMS, CLASSES)
    class_support = np.array(
        [[EVEN_SUPPORT, EVEN_SUPPORT - 50.0], [EVEN_SUPPORT + 2.0, EVEN_SUPPORT + 2.0], [1e6, 0.0]]
    )
    chances = log_probability(book, class_support)
    np.testing.assert_allclose(np.exp(chances).sum(axis=1), 1.0)
    np.testing.assert_allclose(np.exp(chances[0, :2]), 0.5)
    assert chances[1, 0] == pytest.approx(-2.0 * GAIN, rel=1e-4) and chances[1, 1] == chances[1, 2]
    assert chances[2, 0] == pytest.approx(-LARGEST_LOG_ODDS)


def test_books_merge_and_sides_are_written_out():
    book = merge_rules({"x": ("+a",)}, {"x": ("+b",)}, rules_of_sides({"y:{side}": ("-{side}_z",)}))
    assert book == {"x": ("+a", "+b"), "y:port": ("-port_z",), "y:starboard": ("-starboard_z",)}


def test_unknown_names_are_refused():
    with pytest.raises(InputError, match="class of a rule"):
        parse_rules({"four": ("+a",)}, SYMPTOMS, CLASSES)
    with pytest.raises(InputError, match="symptom"):
        parse_rules({"one": ("+d",)}, SYMPTOMS, CLASSES)
    with pytest.raises(InputError, match="sign"):
        parse_rules({"one": ("+a *b",)}, SYMPTOMS, CLASSES)
