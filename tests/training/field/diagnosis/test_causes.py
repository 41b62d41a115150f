import numpy as np

from auv_fault_env.faults import classes
from diagnosers import Belief
from training.field.diagnosis.causes import LOAD_LIMIT, PROBABILITY, by_rule, causes
from training.field.diagnosis.indicators import LogCourse

from ..fleet_logs import NAMES, log_of


def test_an_alarm_is_raised_by_the_probability_or_by_the_limit_on_a_load():
    log = log_of(np.zeros((10, len(NAMES))))
    log_probability = np.full((10, len(classes())), -9.0)
    log_probability[:5, 3] = 0.0
    log_probability[5:, 4] = 0.0
    belief = Belief(log_probability, log_probability, log_probability)
    is_improbable = np.arange(10) > 6
    alarms = [(0.2, 0.4), (0.7, 0.9)]
    found = causes(log, alarms, belief, is_improbable)
    assert [cause.rule for cause in found] == [LOAD_LIMIT, PROBABILITY]
    assert [cause.fault for cause in found] == [classes()[3], classes()[4]]
    assert [(cause.begin, cause.end) for cause in found] == alarms
    assert [cause.text for cause in found] == [LOAD_LIMIT, PROBABILITY]


def test_the_rule_is_the_strongest_at_the_begin_with_its_value_beyond_the_limit():
    n = 20
    is_late = np.arange(n) >= 10
    load = np.where(is_late, -0.6, 0.01)
    load[15] = 0.05  # within the limit for a window
    zeros = np.where(is_late, 0.4, 0.0)
    strength = np.where(is_late[:, None], [6.0, 1.3], 0.1)
    strength[16:] = [1.5, 9.0]
    course = LogCourse(
        rules=("port load", "zeros of port_rpm"),
        n_residuals=1,
        time=14.0 + np.arange(n),
        value=np.stack([load, zeros], axis=1),
        limit=np.full((n, 2), [0.1, 0.3]),
        std=np.full((n, 1), 0.03),
        strength=strength,
        step=1.0,
    )
    first = by_rule(28.2, 33.0, "seal_friction:port", course)
    assert first.text == "port load -60 % (limit ±10 %)"
    later = by_rule(30.5, 33.0, "sensor:port_rpm", course)
    assert later.text == "zeros of port_rpm 40 % (limit 30 %)"
