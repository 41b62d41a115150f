import math

from diagnosers import NAMES
from training.benchmark.thresholds import ONE_PER_10_HOURS, ONE_PER_HOUR


def test_every_diagnoser_has_thresholds_and_the_rarer_alarm_the_lower_one():
    assert ONE_PER_HOUR.keys() == ONE_PER_10_HOURS.keys() == NAMES
    assert all(ONE_PER_10_HOURS[name] <= ONE_PER_HOUR[name] < math.log(0.5) for name in NAMES)
