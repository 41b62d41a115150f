"""Scores of other benchmarks against figures worked out by hand from their definitions."""

import math

import numpy as np
import pytest

from auv_fault_env.parameters import SAMPLE_TIME
from training import metrics
from training.metrics import compatibility

LABEL = np.array([[0, 0], [0, 2], [1, 2], [1, 2]])
# a false alarm, wrong, right; nothing, late, given up
DECISION = np.array([[0, 0], [1, 0], [2, 2], [1, 0]])


def test_fddbenchmark_by_hand():
    found = compatibility.fddbenchmark(LABEL, DECISION, 3)
    # 5 faulty samples, a fault named at 3 of them
    assert found.detection_tpr == pytest.approx(3 / 5)
    assert found.detection_fpr == pytest.approx(1 / 3)
    assert found.cdr == pytest.approx(2 / 3)  # of the 3, 2 named rightly
    np.testing.assert_allclose(found.tpr, [2 / 3, 1 / 2, 1 / 3])
    np.testing.assert_allclose(found.fpr, [2 / 3, 1 / 3, 0.0])


def test_a_share_of_nothing_is_nan():
    quiet = np.zeros((3, 2), np.int8)
    found = compatibility.fddbenchmark(quiet, quiet, 2)
    assert math.isnan(found.detection_tpr) and math.isnan(found.cdr) and math.isnan(found.tpr[1])
    assert found.detection_fpr == 0.0
    assert math.isnan(compatibility.true_detection_rate(quiet, quiet))
    assert math.isnan(compatibility.false_alarm_rate(quiet + 1, quiet))


def test_rates_of_dx25_by_hand():
    assert compatibility.true_detection_rate(LABEL, DECISION) == pytest.approx(3 / 5)
    assert compatibility.false_alarm_rate(LABEL, DECISION) == pytest.approx(1 / 3)


def test_isolation_accuracy_is_over_the_samples_rightly_detected_and_among_faults():
    # what is believed elsewhere does not matter
    probability = np.full((4, 2, 3), [0.98, 0.01, 0.01])
    probability[2, 0] = 0.2, 0.2, 0.6  # true class 1: 0.25 among faults
    probability[3, 0] = 0.0, 1.0, 0.0
    probability[2, 1] = 0.5, 0.1, 0.4  # true class 2: 0.8
    probability[1, 0] = 0.0, 0.5, 0.5  # a false alarm
    with np.errstate(divide="ignore"):
        found = compatibility.fault_isolation_accuracy(LABEL, DECISION, np.log(probability))
    assert found == pytest.approx((0.25 + 1.0 + 0.8) / 3)


def sets(*members, n=4):
    return np.array([[k in group for k in range(n)] for group in members])


@pytest.mark.parametrize(
    ("diagnosed", "true", "value"),
    [
        ({0}, {0}, 1.0),
        (set(), set(), 1.0),
        (set(), {0}, 1 - 1 * 5 / (4 * 2)),  # one missed among four that were not suspected
        ({1}, {0}, 1 - 1 * 2 / (4 * 2) - 1 * 4 / (4 * 2)),
        ({0, 1}, {0}, 1 - 1 * 3 / (4 * 2)),
        ({0, 1, 2, 3}, {0}, 1 - 3 * 5 / (4 * 4)),
        ({0, 1, 2, 3}, set(), 1 - 4 * 5 / (4 * 5)),  # the worst there is
        ({0}, {0, 1, 2}, 1 - 2 * 4 / (4 * 3)),
    ],
)
def test_utility_by_hand(diagnosed, true, value):
    assert compatibility.utility(sets(diagnosed), sets(true)) == pytest.approx([value])


def test_the_last_fault_named_counts_even_if_given_up():
    # lane 0: named 1, true 1; lane 1: named 2 once, true 2
    assert compatibility.mean_utility(LABEL, DECISION, 3) == pytest.approx(1.0)
    decision = DECISION.copy()
    decision[-1, 0] = 2
    decision[:, 1] = 0  # two components: wrong is 1 - 2/4 - 2/4, silence 1 - 3/4
    assert compatibility.mean_utility(LABEL, decision, 3) == pytest.approx((0.0 + 0.25) / 2)


def test_all_scores_at_once():
    log_probability = np.log(np.full((2, 2, 3), 1 / 3))
    found = compatibility.scores(LABEL, DECISION, np.array([[3, 3], [2, 0]]), log_probability, 3)
    assert found["fddbenchmark TPR"] == found["DX'25 TDR"] == pytest.approx(0.6)
    assert found["DX'25 FIA"] == pytest.approx(0.5)  # two faults, equally likely
    assert found["DXC'26 m_utl"] == pytest.approx(1.0)
    nothing = compatibility.scores(
        LABEL * 0, DECISION * 0, np.zeros((1, 2), int), log_probability[:1], 3
    )
    assert nothing["DX'25 TDR"] is None and nothing["DX'25 FAR"] == 0.0


def added_delay(label, decision, step):
    """The ADD of fddbenchmark for one run per lane, as its evaluator defines it."""
    index = np.arange(len(label))[:, None]
    onset = np.where(label != 0, index, len(label)).min(axis=0)
    hit = (decision != 0) & (index >= onset)
    delays = (np.where(hit, index, len(label)).min(axis=0) - onset) * step
    return delays[hit.any(axis=0)].mean()


def test_what_another_average_delay_does_not_see():
    """Three runs with a fault from sample 10 on: an alarm before that stays, one 20 samples late,
    none at all.
    """
    n_samples = 100
    step = 10
    label = np.repeat(np.arange(n_samples)[:, None] >= 10, 3, axis=1).astype(int)
    decision = np.zeros_like(label)
    decision[5:, 0] = 1
    decision[30:, 1] = 1
    onset = np.full(3, 9.5 * SAMPLE_TIME)
    horizon = 8.0
    delays = metrics.detection_delay(decision != 0, onset, horizon)
    # the first detects nothing
    np.testing.assert_allclose(delays.time, [horizon, 20.5 * SAMPLE_TIME, horizon])
    assert metrics.restricted_mean(delays) == pytest.approx((8.0 + 2.05 + 8.0) / 3)
    # nought for the first, a window step for each of the 20 samples, the third forgotten: no time
    # of anything
    assert added_delay(label, decision, step) == (0 + 20 * step) / 2
    # the missed run changes nothing
    assert added_delay(label[:, 1:], decision[:, 1:], step) == 20 * step
