import numpy as np
import pytest

from training import metrics
from training.metrics import healthy_time
from training.metrics.records import PERSISTENCE, Record, healthy_outcome


def raised(changes, threshold):
    chosen = healthy_time.is_raised(changes.low, changes.high, threshold)
    return changes.sample[chosen], changes.lane[chosen]


def test_beginnings_and_ends_by_hand():
    depth = np.array([[-1.0, -1.0], [-5.0, -1.0], [-5.0, -4.0], [-1.0, -4.0]])
    assert [values.tolist() for values in raised(healthy_time.begins(depth), -2.0)] == [
        [1, 2],
        [0, 1],
    ]
    # the second lane is still in alarm at its end
    assert [values.tolist() for values in raised(healthy_time.ends(depth), -2.0)] == [
        [3, 4],
        [0, 1],
    ]


def test_time_in_alarm_is_that_of_the_samples_at_every_threshold():
    random = np.random.default_rng(2)
    log_normal = -np.abs(random.standard_normal((400, 20)).cumsum(axis=0)) - 0.2
    log_normal[300:, ::2] = np.inf  # lanes that end earlier
    depth = metrics.running_maximum(log_normal, PERSISTENCE)
    begin = healthy_time.begins(depth)
    end = healthy_time.ends(depth)
    for threshold in (-15.0, -6.0, -2.0, -0.3):
        found = healthy_time.time_in_alarm(raised(begin, threshold)[0], raised(end, threshold)[0])
        assert found == (depth < threshold).sum() > 0


def test_alarms_by_age_count_the_hours_that_lanes_have_reached():
    hours = np.array([0.5, 2.0])  # 30 and 120 minutes
    counted = healthy_time.by_age(np.array([10.0, 59.0, 60.0, 3000.0]), hours)
    assert counted.first.tolist() == [0, 1, 5, 15, 30, 60]
    assert counted.alarms.tolist() == [2, 1, 0, 0, 1, 0]
    np.testing.assert_allclose(counted.hours * 60, [2, 8, 20, 30, 30, 60])
    assert counted.hours.sum() == pytest.approx(hours.sum())


def test_alarms_by_quarter():
    assert healthy_time.by_quarter(np.array([0, 3, 3], np.int8)).tolist() == [1, 0, 0, 2]


def test_quarters_are_those_of_each_lane_and_its_end_ends_the_alarm():
    log_normal = np.full((800, 2), -0.01, np.float32)
    log_normal[300:305] = -9.0  # the first lane lasts 400 samples, the second 800
    log_normal[398:400, 0] = -9.0
    log_normal[400:, 0] = np.inf
    whole = [np.zeros((5, 2, 4), np.float32)] * 3
    record = Record(log_normal, np.ones((800, 2), np.int8), log_normal, *whole)
    left = healthy_outcome(record, np.zeros(2))
    assert left.begin.tolist() == pytest.approx([30.2, 30.2])
    assert left.quarter.tolist() == [3, 1]
    assert left.end.tolist() == pytest.approx([30.5, 30.5])
    np.testing.assert_allclose(left.hours * 3600, [40.0, 80.0])
