import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS, INDEX, READINGS
from auv_fault_env.errors import InputError
from auv_fault_env.faults import classes
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import Mission
from auv_fault_env.schedules import FaultEvent
from diagnosers.diagnoser import last_values
from diagnosers.relations.episode import episode_windows
from diagnosers.relations.windows import Layout, Typical, weights
from diagnosers.residuals import Residuals
from training.field.calibration.relation_fit import fit_relations
from training.field.diagnosis.diagnosis import diagnoser_for
from training.field.vehicle_file import Column, VehicleFile, read_vehicle, write_vehicle
from training.learning.relation_fit import fit_relation
from training.rollouts import roll_out
from training.seeds import seeds

from ..fleet_logs import log_of
from ..healthy_missions import OFF

# rest, legs, and rest again
LEGS = ((0.0, 0.0), (15.0, 0.3), (75.0, 0.5), (140.0, 0.25), (200.0, 0.4), (260.0, 0.0))
N_SAMPLES = 2800
ONSET = 100.0  # s
FILE = VehicleFile(OFF, {name: Column(name) for name in CHANNELS})
FIRST_SEED = 90_000
LOG_ALARM = math.log(0.5)


def logs_of(n, *events, vehicle=OFF, first=0, legs=LEGS, n_samples=N_SAMPLES):
    lanes = seeds("calibration", n, FIRST_SEED + first)
    fleet = Fleet(n, vehicle, realism=1.0)
    rolled = roll_out(fleet, lanes, n_samples, None, [events] * n, [Mission(legs)] * n)
    return [log_of(rolled.observations[:, k].astype(float)) for k in range(n)]


@cache
def model():
    return fit_relations(logs_of(6), FILE)


def beliefs_of(logs, of):
    """Log probabilities, (n_samples, n_lanes, n_classes), of logs as lanes."""
    diagnoser = Residuals(of)
    diagnoser.reset(len(logs))
    observations = np.stack([log.observation for log in logs], axis=1)
    return np.stack([diagnoser.update(one).log_probability for one in observations])


def test_the_rate_of_a_line_is_its_slope_and_that_of_a_constant_is_zero():
    weight, derivative = weights(75, 5.0)
    time = np.arange(75) / 5.0
    assert weight.sum() == pytest.approx(1.0)
    assert (3.0 + 0.2 * time) @ derivative == pytest.approx(0.2, rel=1e-3)
    assert np.ones(75) @ derivative == pytest.approx(0.0, abs=1e-12)


def test_the_coefficients_of_a_known_vehicle_are_found():
    thrust = 0.6
    of_advance = 0.2
    quadratic = 0.12
    linear = 0.01
    rows = np.zeros((6000, len(CHANNELS)))
    speed = 1.0
    for k in range(len(rows)):
        rows[k, INDEX["speed"]] = speed
        for part in range(10):
            time = k + part / 10.0
            shaft = 0.8 + 0.4 * math.sin(time / 90.0) + 0.3 * math.sin(time / 31.0)
            if part == 0:
                rows[k, INDEX["port_rpm"]] = 1000.0 * shaft
            force = thrust * shaft**2 - of_advance * shaft * speed
            speed += 0.01 * (force - quadratic * speed**2 - linear * speed)
    rows[:, INDEX["mission_speed"]] = 1.0
    rows[:, [INDEX["port_current"], INDEX["port_voltage"]]] = 1.0
    layout = Layout(("port",), has_shaft_speed=True, sample_rate=10.0)
    part = episode_windows(rows, layout, {"port": Typical(1.0, 1.0)})
    found = fit_relation("push", [part], layout)
    np.testing.assert_allclose(found[:3], [thrust, of_advance, quadratic], rtol=0.05)
    assert found[3] == pytest.approx(linear, abs=0.01)


def test_a_missing_reading_is_the_last_one():
    rows = np.array([[1.0, math.nan], [math.nan, 2.0], [3.0, math.nan]])
    np.testing.assert_array_equal(last_values(rows), [[1.0, math.nan], [1.0, 2.0], [3.0, 2.0]])


def test_healthy_missions_that_were_left_out_raise_no_alarm():
    log_normal = beliefs_of(logs_of(8, first=100), model())[:, :, 0]
    assert (log_normal > LOG_ALARM).all()


def test_a_healthy_mission_of_two_hours_with_stops_raises_no_alarm():
    pattern = (0.0, 0.4, 0.2, 0.0, 0.5, 0.3)
    legs = tuple((120.0 * k, pattern[k % len(pattern)]) for k in range(60))
    log = logs_of(2, first=500, legs=legs, n_samples=72_000)
    log_normal = beliefs_of(log, model())[:, :, 0]
    assert (log_normal > LOG_ALARM).all()


def test_a_payload_is_no_fault():
    loaded = replace(OFF, alpha=1.1 * OFF.alpha)
    log_normal = beliefs_of(logs_of(4, vehicle=loaded, first=200), model())[:, :, 0]
    assert (log_normal > LOG_ALARM).all()


@pytest.mark.parametrize(
    ("fault", "severity"),
    [
        ("seal_friction:port", 0.9),
        ("propeller_loss:starboard", 1.0),
        ("sensor_scale:speed", 0.9),
        ("sensor_dropout:port_rpm", 0.9),
        ("sensor_stuck:starboard_current", 1.0),
    ],
)
def test_a_fault_raises_an_alarm_after_its_onset_and_is_named(fault, severity):
    belief = beliefs_of(logs_of(4, FaultEvent(fault, ONSET, severity), first=300), model())
    is_alarm = belief[:, :, 0] < LOG_ALARM
    assert not is_alarm[: int(10 * ONSET)].any()
    assert is_alarm.any(axis=0).all()
    kind, _, place = fault.partition(":")
    right = f"sensor:{place}" if kind.startswith("sensor") else fault
    named = []
    for lane in range(4):
        last = np.flatnonzero(is_alarm[:, lane])[-1]
        named.append(classes()[1 + int(belief[last, lane, 1:].argmax())])
    assert named.count(right) >= 3, named


def with_gaps(observation):
    """A log with rows without readings, readings that lack, and one that is impossible."""
    random = np.random.default_rng(3)
    gappy = observation.copy()
    readings = np.array([INDEX[name] for name in READINGS])
    is_lost = random.random((len(gappy), len(readings))) < 0.2
    gappy[:, readings] = np.where(is_lost, np.nan, gappy[:, readings])
    gappy[np.ix_(np.arange(7, len(gappy), 9), readings)] = np.nan
    gappy[1500, INDEX["speed"]] = 1e300
    return gappy


@pytest.mark.parametrize("change", [np.copy, with_gaps, lambda log: log[:100], lambda log: log[:0]])
def test_the_course_of_an_episode_is_what_it_gives_sample_by_sample(change):
    log = logs_of(1, FaultEvent("seal_friction:port", ONSET, 0.9), first=300)[0]
    observation = change(log.observation)
    diagnoser = Residuals(model())
    course = diagnoser.course(observation)
    found = diagnoser.beliefs(course, len(observation))
    diagnoser.reset(1)
    for k, row in enumerate(observation):
        belief = diagnoser.update(row[None])
        for values, one in zip(found, belief, strict=True):
            np.testing.assert_allclose(values[k], one[0], rtol=1e-9, atol=1e-9)
    state = diagnoser.running.state
    if len(course.last):
        np.testing.assert_allclose(state.value[0], course.value[-1], rtol=1e-9)
        np.testing.assert_allclose(state.limit[0], course.limit[-1], rtol=1e-9)
        assert diagnoser.strongest(state) == course.strength[-1].argmax()


def test_a_course_names_the_rule_that_is_strongest():
    log = logs_of(1, FaultEvent("seal_friction:port", ONSET, 0.9), first=300)[0]
    diagnoser = Residuals(model())
    course = diagnoser.course(log.observation)
    strongest = diagnoser.rules[int(course.strength[-1].argmax())]
    assert strongest.endswith("port_load")
    load = diagnoser.rules.index("port_load")
    is_late = course.last > 10 * (ONSET + 30.0)
    assert (course.value[is_late, load] > course.limit[is_late, load]).all()
    assert 0.03 < np.median(course.limit[:, load]) < 0.5
    assert 0.005 < np.median(course.std[:, load]) < 0.1


def test_probabilities_sum_to_one_and_severity_is_given_for_faults_alone():
    diagnoser = Residuals(model())
    diagnoser.reset(2)
    belief = diagnoser.update(np.full((2, len(CHANNELS)), np.nan))
    np.testing.assert_allclose(np.exp(belief.log_probability).sum(axis=1), 1.0)
    assert (belief.severity_mean[:, [0, -1]] == 0.0).all()
    assert np.exp(belief.log_probability[:, 0]).min() > 0.9


def test_an_hour_of_rest_raises_no_alarm():
    diagnoser = Residuals(model())
    diagnoser.reset(1)
    for _ in range(600):
        belief = diagnoser.update(np.zeros((1, len(CHANNELS))))
    assert belief.log_probability[0, 0] > LOG_ALARM


def test_the_vehicle_file_keeps_the_relations(tmp_path):
    path = tmp_path / "vehicle.toml"
    write_vehicle(path, replace(FILE, relations=model()))
    read = read_vehicle(path).relations
    for name, coefficients in model().coefficients.items():
        np.testing.assert_array_equal(read.coefficients[name], coefficients)
    assert replace(read, coefficients={}) == replace(model(), coefficients={})


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("has_shaft_speed = true", 'has_shaft_speed = "yes"', "has_shaft_speed"),
        ("push = [", "push = [nan, ", "coefficients.push"),
        ("sample_rate = 10.0", "", "sample_rate"),
        ("lasting = {", "lasting = { drag = 1.0,", "lasting"),
        ("shafts = 2\nhas", "shafts = 3\nhas", "shafts"),
    ],
)
def test_a_wrong_table_of_relations_is_refused_by_name(tmp_path, old, new, named):
    path = tmp_path / "vehicle.toml"
    write_vehicle(path, replace(FILE, relations=model()))
    before, table = path.read_text().split("[relations]")
    assert old in table or old in before
    table = table.replace("  # Hz", "").replace(old, new, 1)
    path.write_text(f"{before}[relations]{table}")
    with pytest.raises(InputError, match=named):
        read_vehicle(path)


def test_without_relations_the_remedy_is_calibration():
    with pytest.raises(InputError, match="calibrate"):
        diagnoser_for("residuals", FILE, {})


def test_without_currents_there_are_no_relations():
    columns = {name: Column(name) for name in CHANNELS if "current" not in name}
    assert fit_relations(logs_of(1), VehicleFile(OFF, columns)) is None


def test_a_drag_beyond_the_smallest_change_is_found_and_one_far_below_is_not():
    smallest = model().smallest_changes()["push"]
    assert 0.2 < smallest < 1.0
    for factor, found in ((0.5, False), (2.0, True)):
        draggy = replace(OFF, alpha=(1.0 + factor * smallest) * OFF.alpha)
        log_normal = beliefs_of(logs_of(3, vehicle=draggy, first=400), model())[:, :, 0]
        assert ((log_normal < LOG_ALARM).any(axis=0) == found).all()
