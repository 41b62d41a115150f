"""The channels of motors: measured, by command and supply, and as drawn from the battery."""

import numpy as np
import pytest

from tests.training.field.proposal.missions import LEGS, SIGNALS, SPEED, TIME
from training.field.logs.table import Table
from training.field.proposal.proposal import propose

BASE = {"t": TIME, "speed_mps": SPEED}


def proposal(**columns):
    return propose(Table(BASE | columns, ()), "otter")


def channels(**columns):
    return proposal(**columns).vehicle.columns


# the command of a motor, and its values at rest and full ahead
COMMANDS = {
    "pulses ahead and astern": (1500 + 400 * LEGS, 1500, 1900),
    "wide pulses": (1500 + 600 * LEGS, 1500, 2000),
    "pulses ahead only": (1100 + 800 * LEGS, 1100, 1900),
    "8 bits": (128 + np.round(127 * LEGS), 128, 255),
    "8 bits ahead only": (np.round(255 * LEGS), 0, 255),
    "percent": (100 * LEGS, 0, 100),
    "fraction": (LEGS, 0, 1),
    "thousandths": (1000 * LEGS, 0, 1000),
    "another rest": (40 + 50 * LEGS, 40, 80),
}


@pytest.mark.parametrize(("values", "rest", "full"), COMMANDS.values(), ids=COMMANDS)
def test_rest_and_full_of_a_command(values, rest, full):
    found = channels(pwm=values, vbat=SIGNALS["supply"], motor_current=SIGNALS["A"])
    column = found["port_voltage"]
    assert (column.name, column.times) == ("pwm", "vbat")
    duty = column.scale * np.array([rest, full]) + column.offset
    np.testing.assert_allclose(duty, [0.0, 1.0], atol=1e-9)


def test_a_command_of_at_most_one_percent_is_a_fraction():
    found = channels(**{"throttle [%]": LEGS, "vbat": SIGNALS["supply"], "rpm": SIGNALS["rpm"]})
    assert found["port_voltage"].scale == 1.0


def test_command_astern_shows_its_rest():
    speed = 0.4 * np.sin(TIME / 5)
    table = Table({"time": TIME, "u": speed, "pwm": 1500 + 1000 * speed}, ())
    column = propose(table, "rov").vehicle.columns["port_rpm"]
    assert -column.offset / column.scale == pytest.approx(1500)


def test_command_whose_rest_is_not_in_the_log_is_left_out():
    table = Table({"t": TIME, "pwm": 180 + np.round(20 * LEGS), "rpm": 900 + 100 * LEGS}, ())
    found = propose(table, "cruise")
    assert set(found.vehicle.columns) == {"port_rpm"}
    assert any("'pwm': its value at rest is not in the log" in line for line in found.left_out)


def test_voltage_that_stays_at_standstill_is_the_supplys():
    found = channels(esc_voltage=SIGNALS["supply"], rpm=SIGNALS["rpm"], throttle=100 * LEGS)
    assert found["port_voltage"].names == ("throttle", "esc_voltage")
    without_duty = proposal(esc_voltage=SIGNALS["supply"], rpm=SIGNALS["rpm"])
    assert "port_voltage" not in without_duty.vehicle.columns
    assert any("the supply's voltage" in line for line in without_duty.left_out)


def test_voltage_of_a_motor_that_never_rests_stays_that_of_the_motor():
    steady = Table(
        {"t": TIME, "motor_voltage": 80.9 + 0.01 * SPEED, "rpm": 350 + SPEED, "u": SPEED}, ()
    )
    vehicle = propose(steady, "boat").vehicle
    assert vehicle.columns["port_voltage"].scale == 1.0
    assert vehicle.vehicle.maximum_voltage >= 80.9


def test_voltage_with_an_offset_at_rest_is_the_motors_however_long_the_rest():
    is_moving = TIME > 40.0
    found = channels(
        speed_mps=np.where(is_moving, SPEED, 0.0),
        port_voltage=np.where(is_moving, SIGNALS["V"], 0.2),
        port_rpm=np.where(is_moving, SIGNALS["rpm"], 0.0),
    )
    assert found["port_voltage"].names == ("port_voltage",)


@pytest.mark.parametrize("volts", [5.0, 80.9, 251.0])
def test_size_alone_makes_no_other_unit_of_volts(volts):
    column = channels(motor_voltage=volts * (0.1 + LEGS))["port_voltage"]
    assert column.scale == 1.0


def test_supplys_current_is_that_of_the_only_motor_without_the_others():
    drawn = 0.85 + SIGNALS["A"]
    found = channels(Batt_Ampers=-drawn, rpm=SIGNALS["rpm"])
    assert found["port_current"].scale == -1.0
    assert found["port_current"].offset == pytest.approx(-0.85, rel=0.02)
    two = proposal(battery_current=drawn, rpm_port=SIGNALS["rpm"], rpm_stbd=SIGNALS["rpm 2"])
    assert not any("current" in channel for channel in two.vehicle.columns)
    assert any("'battery_current': the supply's current" in line for line in two.left_out)


def test_supplys_current_is_not_that_of_one_of_several_motors():
    aft = {"aft_rpm": SIGNALS["rpm 2"]}
    found = proposal(battery_current=0.85 + SIGNALS["A"], rpm=SIGNALS["rpm"], **aft)
    assert set(found.vehicle.columns) == {"speed", "port_rpm"}


def test_commanded_shaft_speed_has_its_own_unit():
    found = channels(rpm_cmd=SIGNALS["set rpm"])
    assert (found["port_rpm"].name, found["port_rpm"].scale) == ("rpm_cmd", 1.0)


SIDES = {
    "words": ("rpm_left", "rpm_right"),
    "port and starboard": ("port/rpm", "starb/rpm"),
    "p and s": ("n_p", "n_s"),
    "l and r": ("rpm_l", "rpm_r"),
    "from 0": ("rpm_0", "rpm_1"),
    "from 1": ("rpm1", "rpm2"),
    "in brackets": ("rpm[0]", "rpm[1]"),
    "numbered motors": ("motor0_rpm", "motor1_rpm"),
    "marks of motors": ("m1_rpm", "m2_rpm"),
    "the last two of many": ("esc[5].rpm", "esc[6].rpm"),
    "thrusters": ("T1_rpm", "T2_rpm"),
    "German": ("Drehzahl BB", "Drehzahl StB"),
    "French": ("regime_bd", "regime_td"),
    "Spanish": ("rpm_br", "rpm_er"),
    "Italian": ("giri sx", "giri dx"),
    "of pandas": ("RPM", "RPM.1"),
}


@pytest.mark.parametrize(("port", "starboard"), SIDES.values(), ids=SIDES)
def test_sides(port, starboard):
    columns = {starboard: SIGNALS["rpm 2"], port: SIGNALS["rpm"]}
    vehicle = proposal(**columns).vehicle
    assert vehicle.shafts == 2
    assert vehicle.columns["port_rpm"].name == port
    assert vehicle.columns["starboard_rpm"].name == starboard


def test_shafts_whose_sides_are_not_known_are_left_out():
    found = proposal(rpm_foo=SIGNALS["rpm"], rpm_new=SIGNALS["rpm 2"], rpm_old=SIGNALS["rpm"])
    assert not {"port_rpm", "starboard_rpm"} & set(found.vehicle.columns)
    assert any("which of 'foo' or 'new' or 'old' is port" in line for line in found.left_out)


def test_a_shaft_has_one_number_in_all_quantities():
    columns = {f"esc[{k}].rpm": SIGNALS["rpm"] for k in range(4)}
    columns |= {f"esc[{k}].current": SIGNALS["A"] for k in range(1, 4)}
    found = channels(**columns)
    assert found["starboard_rpm"].name == "esc[1].rpm"
    assert found["starboard_current"].name == "esc[1].current"
    assert "port_current" not in found


def test_quantities_may_count_two_shafts_from_0_and_from_1():
    signals = {"esc0_rpm": "rpm", "esc1_rpm": "rpm 2", "motor1_amps": "A", "motor2_amps": "A 2"}
    found = channels(**{name: SIGNALS[signal] for name, signal in signals.items()})
    assert found["port_rpm"].name == "esc0_rpm"
    assert found["port_current"].name == "motor1_amps"
    assert found["starboard_current"].name == "motor2_amps"


def test_one_shaft_has_no_starboard():
    vehicle = proposal(esc0_rpm=SIGNALS["rpm"], esc0_current=SIGNALS["A"]).vehicle
    assert vehicle.shafts == 1
    assert set(vehicle.columns) == {"speed", "port_current", "port_rpm"}


def test_of_eight_thrusters_two_are_described_and_six_named():
    columns = {f"T{k}_rpm": SIGNALS["rpm"] for k in range(1, 9)}
    found = proposal(**columns)
    assert found.vehicle.columns["starboard_rpm"].name == "T2_rpm"
    for k in range(3, 9):
        assert any(f"'T{k}_rpm': a further thruster" in line for line in found.left_out)
