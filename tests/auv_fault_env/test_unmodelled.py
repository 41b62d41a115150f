"""Faults outside the catalogue: schedules take them by name, no class knows them."""

import math

import numpy as np
import pytest

from auv_fault_env import CATALOGUE, UNMODELLED, FaultEvent, Fleet, ScheduleSampler, classes
from auv_fault_env.channels import INDEX
from auv_fault_env.env import PropulsionEnv
from auv_fault_env.errors import InputError
from auv_fault_env.faults import UNKNOWN
from auv_fault_env.noise import episode_keys
from auv_fault_env.schedules import events_of, from_json, schedules_of, to_json
from auv_fault_env.truth import FleetTruth

QUIET = dict(sensor_noise=0.0, disturbance=0.0, healthy_band=0.0)
PORT_CHANGES = {
    "fouled_propellers": {"port_beta": 0.8, "starboard_beta": 0.8, "port_c1": 1.25},
    "added_mass": {"alpha": 1 / 1.3, "gamma": 1 / 1.3, "port_beta": 1 / 1.3},
    "worn_brushes:port": {"port_resistance": 1.5, "starboard_resistance": 1.0},
    "weak_magnets:port": {"port_torque_constant": 0.8, "port_resistance": 1.0},
    "ventilating_propeller:port": {"port_beta": 0.3, "port_c1": 0.3, "port_c2": 0.3},
    "greater_inertia:port": {"port_inertia": 2.0, "starboard_inertia": 1.0},
}


def parameters(schedule):
    fleet = Fleet(1, healthy_band=0.0)
    fleet.reset([0], schedules=[schedule], missions=[0.4])
    fleet.step(np.zeros((1, 3)))
    return FleetTruth(fleet)["parameters"]


@pytest.mark.parametrize("name", PORT_CHANGES)
def test_a_fault_changes_its_parameters(name):
    before = parameters(())
    after = parameters((FaultEvent(name, 0.0, 1.0),))
    for parameter, factor in PORT_CHANGES[name].items():
        assert after[parameter] == pytest.approx(factor * before[parameter]), parameter


def readings(schedule, channel):
    fleet = Fleet(1, **QUIET)
    values = [fleet.reset([0], schedules=[schedule], missions=[0.4])]
    true = [FleetTruth(fleet)["state"][channel]]
    for k in range(100):
        command = 0.4 + 0.2 * math.sin(k / 9.0)
        values.append(fleet.step(np.array([[command, 0.0, 0.0]])))
        true.append(FleetTruth(fleet)["state"][channel])
    return np.array(values)[:, 0, INDEX[channel]], np.array(true)[:, 0]


@pytest.mark.parametrize(("severity", "late"), [(1.0, 3), (0.4, 1)])
def test_a_late_counter_reports_the_past(severity, late):
    rpm, true = readings((FaultEvent("late_counter:port", 2.0, severity),), "port_rpm")
    assert np.array_equal(rpm[:21], np.float32(true[:21]))
    assert np.array_equal(rpm[21:], np.float32(true[21 - late : -late]))


def test_a_ripple_is_a_sine_of_its_frequency_and_amplitude():
    event = FaultEvent("current_ripple:starboard", 2.0, 1.0)
    current, true = readings((event,), "starboard_current")
    time = np.arange(101) / 10.0
    expected = np.where(time > 2.0, 0.15 * np.sin(2 * math.pi * 1.3 * time), 0.0)
    assert current - true == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("name", UNMODELLED)
def test_no_class_knows_it_and_the_truth_calls_it_unknown(name):
    fault = UNMODELLED[name]
    assert fault.name == name and fault.about and fault.source
    assert fault.diagnosis == UNKNOWN and name not in CATALOGUE and name not in classes()
    env = PropulsionEnv(truth="full")
    env.reset(seed=1, options={"schedule": [FaultEvent(name, 0.0, 0.7)]})
    *_, info = env.step([0.4, 0.0, 0.0])
    assert info["truth"]["label"] == UNKNOWN and info["truth"]["onset"] == 0.0
    assert {key: s for key, s in info["truth"]["severity"].items() if s} == {UNKNOWN: 0.7}
    fleet = Fleet(2)
    schedules = [(), (FaultEvent(name, 0.0, 0.7),)]
    fleet.reset([1, 1], schedules=schedules)
    fleet.step(np.zeros((2, 3)))
    assert FleetTruth(fleet)["label"].tolist() == ["normal", UNKNOWN]
    severity = FleetTruth(fleet)["severity"]
    assert tuple(severity) == classes()[1:] and severity[UNKNOWN].tolist() == [0.0, 0.7]
    assert not any(severity[name].any() for name in classes()[1:-1])


def test_schedules_and_their_json_name_it():
    schedule = (FaultEvent("ventilating_propeller:port", 3.0, 1.0, period=4.0, duty=0.5),)
    assert from_json(to_json(schedule)) == schedule
    assert schedules_of(events_of([schedule])) == [schedule]
    with pytest.raises(InputError, match="did you mean 'worn_brushes:port'"):
        FaultEvent("worn_brushes:prot", 0.0, 1.0)


def test_no_sampler_draws_it():
    key = episode_keys(np.arange(5000, dtype=np.uint64), np.zeros(5000, np.uint64))
    events = ScheduleSampler().sample_events(key)
    assert events.fault.max() == len(CATALOGUE) - 1
