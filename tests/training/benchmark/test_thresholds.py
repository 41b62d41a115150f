import math

from diagnosers import NAMES
from training.benchmark.thresholds import ONE_PER_10_HOURS, ONE_PER_HOUR

SHIPPED = {
    *("limits", "cusum", "rules", "residuals", "filter_bank", "gaussian_bank"),
    *("raw_network", "kalman_network", "parallel", "integrated", "oracle", "null", "random"),
}


def test_diagnosers_have_two_thresholds_and_the_rarer_alarm_has_the_lower_one():
    assert SHIPPED <= ONE_PER_HOUR.keys() == ONE_PER_10_HOURS.keys() <= NAMES
    for name, threshold in ONE_PER_HOUR.items():
        assert ONE_PER_10_HOURS[name] <= threshold < math.log(0.5)
