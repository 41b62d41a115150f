import math

import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS
from auv_fault_env.errors import InputError
from diagnosers import make
from training import metrics
from training.metrics import Times, intervals


def lanes(*columns):
    return np.array(columns).T


def test_alarm_needs_every_one_of_the_last_samples_below():
    log_normal = lanes([-5.0, -5.0, 0.0, -5.0, -5.0, -5.0], [0.0, -2.0, -2.0, -2.0, 0.0, -2.0])
    alarm = metrics.alarms(log_normal, -1.0, 3)
    np.testing.assert_array_equal(alarm.T, [[0, 0, 0, 0, 0, 1], [0, 0, 0, 1, 0, 0]])
    np.testing.assert_array_equal(metrics.alarms(log_normal, -1.0, 1), log_normal < -1.0)


def test_alarm_is_below_the_threshold_not_at_it():
    assert not metrics.alarms(lanes([-1.0]), -1.0, 1).any()


def test_an_alarm_counts_once_while_it_stands_and_again_after_a_gap():
    alarm = lanes([1, 1, 0, 1, 1], [0, 0, 0, 0, 1]).astype(bool)
    np.testing.assert_array_equal(metrics.rising(alarm).T, [[1, 0, 0, 1, 0], [0, 0, 0, 0, 1]])


@pytest.mark.parametrize("persistence", [1, 3, 5])
def test_threshold_allows_just_the_alarms_of_its_rate(persistence):
    log_normal = np.random.default_rng(1).standard_normal((600, 60)).cumsum(axis=0)
    mean_time = 600 * 60 * 0.1 / 7.5  # 7 whole alarms
    threshold = metrics.threshold_for(log_normal, mean_time, persistence)

    def count(level):
        alarm = metrics.alarms(log_normal, level, persistence)
        return metrics.rising(alarm).sum()

    assert count(threshold) <= 7 < count(np.nextafter(threshold, 0.0))
    assert all(count(level) <= 7 for level in np.linspace(log_normal.min(), threshold, 50))


def test_threshold_counts_several_alarms_of_one_lane():
    # 2 s in all
    log_normal = lanes([0.0, -4.0, 0.0, -3.0, 0.0, -2.0, 0.0, 0.0, 0.0, 0.0], [-1.0] * 10)
    # two alarms: the dips to -4 and -3 of one lane
    assert metrics.threshold_for(log_normal, 1.0, 1) == -2.0
    assert metrics.threshold_for(log_normal, 2.0, 1) == -3.0
    assert metrics.threshold_for(log_normal, 3.0, 1) == -4.0


def test_threshold_is_not_raised_until_all_alarms_have_merged_into_one():
    # above -1 the lane alarms all the time, which is one alarm only
    flickering = lanes([-2.0, -1.0] * 50)
    assert metrics.threshold_for(flickering, 10.0, 1) == -2.0


def test_equal_lanes_never_alarm_together():
    assert metrics.threshold_for(np.full((10, 100), -3.0), 50.0, 1) == -3.0


def test_threshold_stops_at_certainty():
    assert metrics.threshold_for(lanes([-1.0, -1.0]), 0.1, 1) == 0.0


def test_alarm_before_or_at_onset_is_no_detection():
    rows = {  # onset at 0.25 s, between samples 2 and 3
        "standing": ([1, 1, 1, 1, 1, 1, 1, 1], 0.4, True),
        "over before": ([1, 1, 0, 0, 0, 0, 0, 0], 0.4, True),
        "standing, then again": ([0, 0, 1, 1, 0, 1, 1, 0], 0.25, False),
        "after": ([0, 0, 0, 1, 0, 0, 1, 0], 0.05, False),
        "beyond the horizon": ([0, 0, 0, 0, 0, 0, 0, 1], 0.4, True),
    }
    alarm = lanes(*(row[0] for row in rows.values())).astype(bool)
    found = metrics.detection_delay(alarm, np.full(len(rows), 0.25), 0.4)
    np.testing.assert_allclose(found.time, [row[1] for row in rows.values()])
    np.testing.assert_array_equal(found.censored, [row[2] for row in rows.values()])


def test_nothing_at_the_very_onset_is_found_though_samples_are_not_exact_multiples():
    onset = np.round(np.arange(1, 300) * 0.1, 2)
    # alarm and right answer begin in the sample of the onset
    at_onset = np.arange(650)[:, None] >= np.arange(1, 300)
    assert metrics.detection_delay(at_onset, onset, 30.0).censored.all()
    assert metrics.isolation_time(
        np.where(at_onset, 7, 0), np.full(299, 7), onset, 30.0
    ).censored.all()
    later = np.arange(650)[:, None] >= np.arange(2, 301)
    np.testing.assert_allclose(metrics.detection_delay(later, onset, 30.0).time, 0.1)


def test_isolated_is_the_last_stretch_that_is_right_up_to_the_horizon():
    rows = {  # onset at 0.15 s, horizon at 0.55 s: sample 5 is the last that counts
        "for good": ([0, 0, 2, 7, 7, 7, 7], 0.15, False),
        "lost and found": ([0, 0, 7, 7, 0, 7, 7], 0.35, False),
        "lost at the end": ([0, 0, 7, 7, 7, 0, 7], 0.4, True),
        "wrong after the horizon": ([0, 0, 7, 7, 7, 7, 0], 0.05, False),
        "right before onset": ([0, 7, 7, 7, 7, 7, 7], 0.4, True),
        "always right": ([7, 7, 7, 7, 7, 7, 7], 0.4, True),
        "never": ([0, 0, 0, 0, 0, 0, 7], 0.4, True),
    }
    decision = lanes(*(row[0] for row in rows.values()))
    found = metrics.isolation_time(decision, np.full(len(rows), 7), np.full(len(rows), 0.15), 0.4)
    np.testing.assert_allclose(found.time, [row[1] for row in rows.values()])
    np.testing.assert_array_equal(found.censored, [row[2] for row in rows.values()])


def test_delay_is_in_seconds_whatever_the_number_of_samples():
    alarm = (np.arange(650) >= 123)[:, None]
    assert metrics.detection_delay(alarm, np.array([10.0]), 30.0).time[0] == pytest.approx(2.3)


def test_misses_count_in_the_restricted_mean():
    times = Times(np.array([1.0, 3.0, 30.0, 30.0]), np.array([False, False, True, True]))
    assert metrics.restricted_mean(times) == 16.0  # the mean over the detected alone would say 2
    assert metrics.probability(times) == 0.5


def test_kaplan_meier_median_by_hand():
    # at risk 5, 4, 2, 1; survival 0.8 at 1, 0.6 at 2, then one censored at 3, 0.3 at 4
    times = Times(np.array([1.0, 2.0, 3.0, 4.0, 5.0]), np.array([False, False, True, False, True]))
    assert metrics.kaplan_meier_median(times) == 4.0
    even = Times(np.array([1.0, 2.0, 30.0, 30.0]), np.array([False, False, True, True]))
    assert metrics.kaplan_meier_median(even) == 2.0
    few = Times(np.array([1.0, 30.0, 30.0]), np.array([False, True, True]))
    assert metrics.kaplan_meier_median(few) == math.inf
    assert metrics.kaplan_meier_median(Times(np.full(2, 30.0), np.ones(2, bool))) == math.inf


def test_what_happens_at_the_very_horizon_does_not_outlive_those_where_nothing_does():
    onset = np.tile(np.round(np.arange(50, 300) * 0.1, 2), 5)
    # a fifth, at last
    right = (np.arange(650)[:, None] >= metrics.sample_at(onset + 30.0)) & (np.arange(1250) < 250)
    found = metrics.isolation_time(np.where(right, 7, 0), np.full(1250, 7), onset, 30.0)
    assert metrics.probability(found) == pytest.approx(0.2)
    assert found.time.max() == 30.0 and metrics.kaplan_meier_median(found) == math.inf


def test_confusion_and_macro_f1_by_hand():
    label = np.array([0, 0, 1, 1, 1, 2])
    decision = np.array([0, 1, 1, 1, 0, 1])
    matrix = metrics.confusion(label, decision, 4)
    np.testing.assert_array_equal(matrix, [[1, 1, 0, 0], [1, 2, 0, 0], [0, 1, 0, 0], [0, 0, 0, 0]])
    # F1 of 0: 2/4; of 1: 4/7; of 2: 0; class 3 never occurs
    assert metrics.macro_f1(matrix) == pytest.approx((0.5 + 4 / 7) / 3)


def test_a_class_that_is_never_the_truth_costs_only_the_wrong_decisions():
    # class 2, unknown, is decided twice: F1 of 0 is 2/2, of 1 is 2/(3 + 1), and no third one
    matrix = metrics.confusion(np.array([0, 1, 1, 1]), np.array([0, 1, 2, 2]), 3)
    assert metrics.macro_f1(matrix) == pytest.approx((1.0 + 0.5) / 2)


def test_weighted_confusion_is_that_of_repeated_lanes():
    label = np.array([0, 1, 2])
    decision = np.array([0, 2, 2])
    weights = np.array([[1, 1, 1], [0, 2, 1]])
    first, second = metrics.confusion(label, decision, 3, weights)
    np.testing.assert_array_equal(first, metrics.confusion(label, decision, 3))
    np.testing.assert_array_equal(
        second, metrics.confusion(label[[1, 1, 2]], decision[[1, 1, 2]], 3)
    )


def test_classes_are_matched_by_name():
    np.testing.assert_array_equal(
        metrics.class_order(("b", "normal", "a"), ("normal", "a", "b")), [1, 2, 0]
    )


@pytest.mark.parametrize(
    "given", [("normal", "a"), ("normal", "a", "c"), ("normal", "a", "b", "b")]
)
def test_other_classes_are_refused(given):
    with pytest.raises(InputError, match="classes of the belief"):
        metrics.class_order(given, ("normal", "a", "b"))


def test_severity_error_and_coverage_by_hand():
    estimate = np.array([0.5, 0.2])
    truth = np.array([0.6, 0.6])
    np.testing.assert_allclose(metrics.severity_error(estimate, truth), [0.1, 0.4])
    # 90 % of a normal distribution lie within 1.645 standard deviations
    std = np.array([0.1 / 1.644, 0.4 / 1.646])
    np.testing.assert_array_equal(metrics.covered(estimate, std, truth), [True, False])


def test_calibration_error_by_hand():
    confidence = np.array([0.9, 0.95, 1.0, 0.35])
    right = np.array([True, False, True, True])
    bins = metrics.reliability(confidence, right, n_bins=2)
    np.testing.assert_allclose(bins, [[0.25, 0.75], [0.35, 0.95], [1.0, 2 / 3]])
    expected = 0.25 * 0.65 + 0.75 * (0.95 - 2 / 3)
    assert metrics.expected_calibration_error(confidence, right, n_bins=2) == pytest.approx(
        expected
    )


def test_prior_is_calibrated_though_useless():
    assert (
        metrics.expected_calibration_error(np.full(4, 0.25), np.array([True, False, False, False]))
        == 0.0
    )


def test_brier_and_log_loss_by_hand():
    log_probability = np.log([[0.7, 0.2, 0.1], [0.5, 0.25, 0.25]])
    label = np.array([0, 1])
    # .09+.04+.01, .25+.5625+.0625
    assert metrics.brier(log_probability, label) == pytest.approx((0.14 + 0.875) / 2)
    assert metrics.log_loss(log_probability, label) == pytest.approx(
        -(math.log(0.7) + math.log(0.25)) / 2
    )
    with np.errstate(divide="ignore"):
        assert metrics.log_loss(np.log([[1.0, 0.0]]), np.array([1])) == math.inf


@pytest.mark.parametrize("kind", [np.float64, np.float32])
def test_log_loss_is_infinite_where_an_unknown_fault_was_held_impossible(kind):
    null = make("null")
    null.reset(2)
    belief = null.update(np.zeros((2, len(CHANNELS))))
    log_probability = belief.log_probability.astype(kind).astype(np.float64)
    normal = 0
    unknown = null.classes.index("unknown")
    # null: one of five is healthy
    found = metrics.log_loss(log_probability, np.array([normal, normal]))
    assert found == pytest.approx(math.log(5.0))
    assert metrics.log_loss(log_probability, np.array([normal, unknown])) == math.inf


def test_paired_interval_sees_what_the_lanes_share():
    random = np.random.default_rng(0)
    lane = random.uniform(0.0, 30.0, 400)
    a = lane + random.normal(0.0, 0.5, 400)
    b = lane + 1.0
    low, high = intervals.paired_bootstrap(a, b, seed=1)
    assert -1.1 < low < -1.0 < high < -0.9
    ours = intervals.interval(a, 1)
    theirs = intervals.interval(b, 1)
    assert ours[1] > theirs[0]  # unpaired they overlap


def test_interval_of_a_mean_is_about_two_standard_errors():
    values = np.random.default_rng(2).normal(5.0, 2.0, 900)
    low, high = intervals.interval(values, seed=3)
    assert high - low == pytest.approx(2 * 1.96 * values.std() / 30, rel=0.08)
    assert low < values.mean() < high
    assert intervals.interval(values, seed=3) == (low, high) != intervals.interval(values, seed=4)


def test_f1_intervals_hold_their_value_and_pair():
    random = np.random.default_rng(4)
    label = random.integers(0, 3, 300)
    wrong = random.uniform(size=300)
    good = np.where(wrong < 0.1, 0, label)
    bad = np.where(wrong < 0.2, 0, label)
    low, high = intervals.f1_interval(label, good, 3, seed=0)
    assert low < metrics.macro_f1(metrics.confusion(label, good, 3)) < high
    assert intervals.paired_f1(label, good, bad, 3, seed=0)[0] > 0.0
    assert intervals.paired_f1(label, good, good, 3, seed=0) == (0.0, 0.0)


def test_poisson_interval_of_the_tables():
    # Garwood 1936
    np.testing.assert_allclose(intervals.poisson_interval(10, 1.0), (4.795, 18.390), atol=1e-3)
    np.testing.assert_allclose(intervals.poisson_interval(0, 2.0), (0.0, 3.6889 / 2), atol=1e-4)


@pytest.mark.parametrize("persistence", [0, 1.5, True])
def test_persistence_is_a_whole_number(persistence):
    with pytest.raises(InputError, match="persistence"):
        metrics.alarms(np.zeros((3, 1)), -1.0, persistence)


def test_no_time_between_false_alarms_is_refused():
    with pytest.raises(InputError, match="mean time between false alarms"):
        metrics.threshold_for(np.zeros((3, 1)), 0.0, 1)
