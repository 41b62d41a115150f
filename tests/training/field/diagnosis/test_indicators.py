from dataclasses import replace

import numpy as np
import pytest

from auv_fault_env.channels import INDEX
from auv_fault_env.schedules import FaultEvent
from training.commands.diagnose import diagnosed_log
from training.field.diagnosis.diagnosis import THRESHOLDS, beliefs
from training.field.diagnosis.indicators import course_of, indicators
from training.field.diagnosis.log_figure import broken_line, log_figure
from training.field.diagnosis.page import Setting
from training.report.figures.registry import draw

from ..calibration.test_relation_fit import FILE, N_SAMPLES, ONSET, logs_of, model
from ..fleet_logs import log_of

DIRECTIONS = {
    "seal_friction:port": ("port load", 1.0),
    "propeller_loss:starboard": ("starboard load", -1.0),
    "increased_drag": ("drag", 1.0),
    "decreased_drag": ("drag", -1.0),
}


def setting(diagnoser="residuals"):
    vehicle = replace(FILE, relations=model())
    return Setting("", diagnoser, "as the test says", THRESHOLDS[diagnoser], vehicle)


def faulty_log(*names, severity=0.9):
    events = [FaultEvent(name, ONSET, 1.0 if "loss" in name else severity) for name in names]
    return logs_of(1, *events, first=300)[0]


@pytest.mark.parametrize("fault", DIRECTIONS)
def test_the_rule_of_an_alarm_agrees_in_direction_with_the_class(fault):
    one = diagnosed_log("log.csv", faulty_log(fault), setting(), {}).verdict
    name, sign = DIRECTIONS[fault]
    assert one.fault == fault
    assert [(cause.begin, cause.end) for cause in one.raised_by] == list(one.alarms)
    last = one.raised_by[-1]
    assert last.fault == fault and last.rule in (name, f"lasting {name}")
    assert sign * last.value > last.limit > 0.0
    indicator = one.indicators[name]
    assert sign * indicator["value"] > indicator["limit"] > indicator["std"] > 0.0


def test_a_healthy_log_has_no_faults_at_all():
    one = diagnosed_log("log.csv", logs_of(1, first=100)[0], setting(), {})
    verdict = one.verdict
    assert (verdict.top, verdict.raised_by, verdict.indicators) == ((), (), None)
    panels = log_figure(1, "log.csv", one, setting())["data"]["panels"]
    assert "probability" not in panels and "strength, 1 = limit" in panels


def test_the_indicators_are_within_their_band_until_the_onset_and_beyond_after_it():
    course = course_of(faulty_log("seal_friction:port"), model())
    load = indicators(course)["port load"]
    before = load.time < ONSET
    after = load.time > ONSET + 30.0
    assert np.mean(np.abs(load.value[before]) < load.limit[before]) > 0.99
    assert (load.value[after] > load.limit[after]).all()
    assert (load.std < load.limit).all()
    drag = indicators(course)["drag"]
    assert np.mean(np.abs(drag.value) < drag.limit) > 0.95


def test_every_segment_has_windows_of_its_own():
    observation = logs_of(1, first=100)[0].observation
    twice = np.concatenate([observation, observation])
    segments = (slice(0, N_SAMPLES), slice(N_SAMPLES, 2 * N_SAMPLES))
    course = course_of(log_of(twice, segments), model())
    n = len(course.time) // 2
    np.testing.assert_array_equal(course.strength[:n], course.strength[n:])
    np.testing.assert_allclose(course.time[n:] - course.time[:n], 0.1 * N_SAMPLES)
    belief = beliefs(log_of(twice, segments), "residuals", setting().vehicle)
    halves = np.split(belief.log_probability, 2)
    np.testing.assert_array_equal(*halves)


def test_the_figure_has_a_panel_with_a_healthy_band_per_indicator():
    log = faulty_log("seal_friction:port")
    for diagnoser, distance in (("residuals", "strength, 1 = limit"), ("cusum", "p(normal)")):
        one = diagnosed_log("log.csv", log, setting(diagnoser), {})
        panels = log_figure(1, "log.csv", one, setting(diagnoser))["data"]["panels"]
        assert {"drag [%]", "port load [%]", "starboard load [%]"} < set(panels)
        assert "estimate" not in panels and distance in panels
        (load,) = panels["port load [%]"].values()
        lengths = {len(load[key]) for key in ("time", "value", "width", "limit")}
        assert len(lengths) == 1
        assert max(value for value in load["value"] if value is not None) > 20.0


def test_a_line_of_windows_is_broken_where_the_vehicle_was_at_rest():
    time = np.array([20.0, 21.0, 22.0, 60.0, 61.0])
    line = broken_line(time, 1.0, {"value": np.arange(5.0)})
    assert line["value"] == [0.0, 1.0, 2.0, None, 3.0, 4.0]
    assert line["time"] == [20.0, 21.0, 22.0, None, 60.0, 61.0]


@pytest.mark.parametrize("channel", ["mission_speed", "speed", "port_rpm", "port_current"])
def test_a_log_at_rest_or_without_a_reading_has_a_figure(channel):
    """The mission speed at zero is rest; a reading never arrives."""
    observation = faulty_log("seal_friction:port").observation.copy()
    observation[:, INDEX[channel]] = 0.0 if channel == "mission_speed" else np.nan
    one = diagnosed_log("log.csv", log_of(observation), setting(), {})
    drawn = log_figure(1, "log.csv", one, setting())
    assert draw(drawn["plot"], drawn["data"]).axes
    for values in (one.verdict.indicators or {}).values():
        assert np.isfinite(list(values.values())).all()
