import numpy as np
import pytest

from training.metrics import abstention
from training.metrics.abstention import known_confidence, risk_coverage


def test_risk_by_hand():
    confidence = np.array([0.5, 0.9, 0.8, 0.6])
    right = np.array([False, True, False, True])
    curve = risk_coverage(confidence, right)
    np.testing.assert_allclose(curve.coverage, [0.25, 0.5, 0.75, 1.0])
    np.testing.assert_allclose(curve.risk, [0.0, 1 / 2, 1 / 3, 1 / 2])
    assert abstention.area(curve) == pytest.approx((0 + 1 / 2 + 1 / 3 + 1 / 2) / 4)
    assert abstention.risk_at(curve, 0.5) == 0.5
    assert abstention.risk_at(curve, 0.6) == pytest.approx(1 / 3)


def test_beliefs_as_sure_as_each_other_are_named_together_in_any_order():
    for right in ([True, False], [False, True]):
        curve = risk_coverage(np.array([0.7, 0.7]), np.array(right))
        assert curve.coverage.tolist() == [1.0] and curve.risk.tolist() == [0.5]


def test_who_knows_when_he_is_wrong_has_the_smaller_area():
    right = np.array([True] * 8 + [False] * 2)
    knows = risk_coverage(np.where(right, 0.9, 0.4), right)
    does_not = risk_coverage(np.where(right, 0.4, 0.9), right)
    assert abstention.area(knows) < 0.05 < 0.3 < abstention.area(does_not)
    assert knows.risk[-1] == does_not.risk[-1] == 0.2


def test_unknown_lowers_the_confidence_and_is_never_the_name():
    log_probability = np.log([[0.1, 0.3, 0.6]])
    confidence, right = known_confidence(log_probability, np.array([1]), 2)
    assert confidence == pytest.approx([0.3]) and right.all()
    _, right = known_confidence(log_probability, np.array([0]), 2)
    assert not right.any()
