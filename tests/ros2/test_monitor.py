"""The part of the ROS 2 package that needs no ROS."""

import math

import numpy as np
import pytest

from auv_fault_diagnosis.monitor import (
    ERROR,
    OK,
    STALE,
    WARN,
    Monitor,
    Settings,
    component_of,
    monitor_of,
)
from auv_fault_env.channels import CHANNELS
from auv_fault_env.errors import InputError
from auv_fault_env.faults import classes
from diagnosers import Belief
from diagnosers.references import Null

NAMES = classes()
READINGS = np.arange(len(CHANNELS)) * 0.1
FAULT = "seal_friction:port"
SETTINGS = Settings(declared_probability=0.9, declared_time=0.5, stale_time=2.0)


class Scripted(Null):
    """Believes what it is told sample by sample; nothing else is wrong with the vehicle."""

    def __init__(self, script):
        self.script = script
        self.heard = []
        self.n_resets = 0

    def reset(self, n_lanes):
        assert n_lanes == 1
        self.n_resets += 1

    def update(self, observation):
        self.heard.append(observation[0].copy())
        name, probability = self.script(len(self.heard) - 1)
        rest = (1.0 - probability) / (len(NAMES) - 1)
        log_probability = np.full((1, len(NAMES)), math.log(max(rest, 1e-12)))
        log_probability[0, NAMES.index(name)] = math.log(probability)
        severity = np.full((1, len(NAMES)), 0.4)
        return Belief(log_probability, severity, 0.1 + 0.0 * severity)


def monitored(script, settings=SETTINGS, **more):
    diagnoser = Scripted(script)
    return Monitor(diagnoser, settings, threshold=math.log(0.2), n_alarm=3, **more), diagnoser


def after(monitor, n_samples, now=0.0):
    for k in range(n_samples):
        monitor.update(READINGS, 0.1 * k)
    return {one.name: one for one in monitor.statuses(0.1 * (n_samples - 1) + now)}


def levels(statuses):
    return {name: one.level for name, one in statuses.items()}


def test_every_class_but_normal_and_unknown_belongs_to_a_component():
    components = {name: component_of(name) for name in NAMES}
    assert [name for name, component in components.items() if component is None] == [
        "normal",
        "unknown",
    ]
    assert components["propeller_loss:port"] == "port motor"
    assert components["motor_overheating:starboard"] == "starboard motor"
    assert components["increased_drag"] == "hull"
    assert components["sensor:port_rpm"] == components["sensor:speed"] == "sensors"


def test_a_healthy_vehicle_is_ok():
    monitor, _ = monitored(lambda k: ("normal", 0.99))
    statuses = after(monitor, 10, now=0.05)
    assert list(statuses) == ["propulsion", "port motor", "starboard motor", "hull", "sensors"]
    assert set(levels(statuses).values()) == {OK}
    assert {one.message for one in statuses.values()} == {"normal"}
    assert statuses["hull"].values["delay [s]"] == "0.05"
    assert "alarm for [s]" not in statuses["hull"].values


def test_an_alarm_warns_of_one_component_and_a_declaration_makes_it_an_error():
    monitor, _ = monitored(lambda k: (FAULT, 0.95) if k >= 10 else ("normal", 0.99))
    quiet = [OK] * 5
    assert list(levels(after(monitor, 12)).values()) == quiet
    monitor, _ = monitored(lambda k: (FAULT, 0.95) if k >= 10 else ("normal", 0.99))
    statuses = after(monitor, 13)
    assert levels(statuses) == {
        "propulsion": WARN,
        "port motor": WARN,
        "starboard motor": OK,
        "hull": OK,
        "sensors": OK,
    }
    monitor, _ = monitored(lambda k: (FAULT, 0.95) if k >= 10 else ("normal", 0.99))
    statuses = after(monitor, 15)
    port = statuses["port motor"]
    assert port.level == statuses["propulsion"].level == ERROR and port.message == FAULT
    assert port.values == {
        "class": FAULT,
        "probability": "0.95",
        "probability of the component": "0.958",
        "severity": "0.4",
        "severity std": "0.1",
        "delay [s]": "0.00",
        "alarm for [s]": "0.2",
    }


def test_a_class_that_is_not_sure_stays_a_warning_and_passes():
    script = {**dict.fromkeys(range(5, 30), (FAULT, 0.85))}
    monitor, _ = monitored(lambda k: script.get(k, ("normal", 0.99)))
    assert levels(after(monitor, 30))["port motor"] == WARN
    monitor, _ = monitored(lambda k: script.get(k, ("normal", 0.99)))
    assert levels(after(monitor, 31))["port motor"] == OK


def test_classes_in_turn_are_not_declared():
    turns = ("increased_drag", "decreased_drag")
    monitor, _ = monitored(lambda k: (turns[k % 2], 0.99))
    assert levels(after(monitor, 40))["hull"] == WARN


def test_an_unknown_fault_is_said_of_the_whole():
    monitor, _ = monitored(lambda k: ("unknown", 0.99))
    statuses = after(monitor, 20)
    assert levels(statuses) == {
        "propulsion": ERROR,
        "port motor": OK,
        "starboard motor": OK,
        "hull": OK,
        "sensors": OK,
    }
    assert statuses["propulsion"].message == "unknown"


def test_without_readings_the_diagnosis_is_stale():
    monitor, diagnoser = monitored(lambda k: ("normal", 0.99))
    assert {one.level for one in monitor.statuses(5.0)} == {STALE}
    monitor.update(np.full(len(CHANNELS), np.nan), 5.0)
    assert {one.level for one in monitor.statuses(5.0)} == {STALE} and not diagnoser.heard
    monitor.update(READINGS, 5.0)
    assert {one.level for one in monitor.statuses(7.0)} == {OK}
    assert {one.level for one in monitor.statuses(7.1)} == {STALE}


def test_lost_messages_are_predicted_and_hasty_ones_left_out():
    monitor, diagnoser = monitored(lambda k: ("normal", 0.99))
    for time in (0.0, 0.02, 0.1, 0.5):
        monitor.update(READINGS + time, time)
    heard = np.array(diagnoser.heard)
    assert len(heard) == 6 and np.isnan(heard[2:5]).all()
    np.testing.assert_allclose(heard[[0, 1, 5], 0], [0.0, 0.1, 0.5])
    assert diagnoser.n_resets == 1
    monitor.update(READINGS, 6.0)
    assert diagnoser.n_resets == 2 and len(diagnoser.heard) == 7
    monitor.update(READINGS, 3.0)
    assert diagnoser.n_resets == 3 and len(diagnoser.heard) == 8


@pytest.mark.parametrize("readings", [[], [1.0] * 11, [[1.0] * 12]])
def test_another_number_of_readings_is_refused(readings):
    monitor, diagnoser = monitored(lambda k: ("normal", 0.99))
    with pytest.raises(InputError, match="number of readings"):
        monitor.update(readings, 0.0)
    assert not diagnoser.heard


def test_a_vehicle_with_one_shaft_has_one_motor():
    monitor, _ = monitored(lambda k: ("normal", 0.99), sides=("port",))
    assert list(after(monitor, 1)) == ["propulsion", "port motor", "hull", "sensors"]


@pytest.mark.parametrize(
    "fields",
    [
        {"alarm_probability": 2.0},
        {"declared_probability": 0.1},
        {"declared_time": -1.0},
        {"stale_time": 0.0},
        {"stale_time": math.nan},
    ],
)
def test_settings_that_cannot_be_are_refused(fields):
    with pytest.raises(InputError, match=next(iter(fields))):
        Settings(**fields)


def test_a_monitor_of_names_and_files(tmp_path):
    monitor = monitor_of(Settings(diagnoser="null", alarm_probability=0.5))
    assert monitor.threshold == math.log(0.5) and len(monitor.sides) == 2
    with pytest.raises(InputError, match="did you mean 'filter_bank'"):
        monitor_of(Settings(diagnoser="filter_bang"))
    with pytest.raises(InputError, match=r"absent\.toml"):
        monitor_of(Settings(vehicle_file=str(tmp_path / "absent.toml")))
    path = tmp_path / "vehicle.toml"
    columns = ("speed_command", "speed", "port_voltage", "port_current", "port_rpm")
    tables = [f'[channels.{name}]\ncolumn = "{name}"\n' for name in columns]
    vehicle = '[vehicle]\nname = "mine"\npreset = "remus100"\nsample_rate = 10.0\n'
    path.write_text(vehicle + "".join(tables))
    monitor = monitor_of(Settings(vehicle_file=str(path)))
    assert monitor.sides == ("port",) and monitor.diagnoser.name == "filter_bank"
