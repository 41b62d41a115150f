import numpy as np
import pytest

from auv_fault_env import CHANNELS
from auv_fault_env.parameters import Vehicle
from training.field.logs.table import Table
from training.field.proposal.proposal import propose
from training.field.vehicle_file import Column, read_vehicle, write_vehicle

PHASE = np.linspace(0, 6, 300)
SPEED = 0.4 + 0.1 * np.sin(PHASE)  # m/s
RPM = 350 + 90 * np.sin(PHASE)
TIME = 0.1 * np.arange(300)
KNOT = 1852 / 3600


@pytest.mark.parametrize("channel", CHANNELS)
def test_every_channel_is_found_by_its_own_name(channel):
    columns = {"time": TIME, "speed": SPEED, channel: RPM / 30}
    assert propose(Table(columns, ()), "own").vehicle.columns[channel].name == channel


def proposal(**columns):
    return propose(Table({"t": TIME, "u": SPEED} | columns, ()), "otter")


def test_a_log_of_an_unknown_vehicle():
    table = Table(
        {
            "Time [ms]": 1000 * TIME,
            "Speed [kn]": SPEED / KNOT,
            "rpm_port": -RPM,
            "n_stbd": RPM / 60,
            "thruster1_current_A": 0.3 + RPM / 1000,
            "V_bat": 24 - TIME / 100,
            "depth": TIME,
            "mode": np.full(300, np.nan),
        },
        (),
    )
    vehicle, comments, missing, *_ = propose(table, "otter")
    assert vehicle.vehicle.name == "otter"
    assert vehicle.time == Column("Time [ms]", 1e-3)
    assert (vehicle.sample_rate, vehicle.shafts) == (10.0, 2)
    assert vehicle.columns == {
        "speed": Column("Speed [kn]", KNOT),
        "port_current": Column("thruster1_current_A"),
        "port_rpm": Column("rpm_port", -1.0),
        "starboard_rpm": Column("n_stbd", 60.0),
    }
    assert "sign reversed" in comments["channels.port_rpm.column"]
    assert "rev/s by the size of its values" in comments["channels.starboard_rpm.column"]
    assert missing["port_voltage"].startswith("no column")
    assert "starboard_rpm" not in missing


def test_proposal_is_written_with_its_guesses_and_read_back_equal(tmp_path):
    vehicle, comments, *_ = proposal(rpm=RPM)
    path = tmp_path / "vehicle.toml"
    write_vehicle(path, vehicle, comments)
    assert read_vehicle(path) == vehicle
    text = path.read_text()
    for comment in comments.values():
        assert f"{comment}\n" in text


def test_one_shaft_needs_no_starboard():
    vehicle, _, missing, *_ = proposal(rpm=RPM)
    assert vehicle.shafts == 1
    assert not any("starboard" in line for line in missing)


EPOCH = 1_772_366_400.0
TIMES = {
    "seconds": (TIME, 1.0, 10.0),
    "milliseconds": (1e3 * TIME, 1e-3, 10.0),
    "microseconds": (1e6 * TIME, 1e-6, 10.0),
    "nanoseconds": (1e9 * TIME, 1e-9, 10.0),
    "since 1970 in seconds": (EPOCH + TIME, 1.0, 10.0),
    "since 1970 in milliseconds": (1e3 * (EPOCH + TIME), 1e-3, 10.0),
    "since 1970 in microseconds": (1e6 * (EPOCH + TIME), 1e-6, 10.0),
    "since 1970 in nanoseconds": (1e9 * (EPOCH + TIME), 1e-9, 10.0),
    "once a second": (10 * TIME, 1.0, 1.0),
    "once a second in milliseconds": (1e4 * TIME, 1e-3, 1.0),
    "hundred times a second": (TIME / 10, 1.0, 100.0),
    "days since 1900": (45_413.4 + TIME / 86_400, 86_400.0, pytest.approx(10.0, abs=0.1)),
    "days since the year 0": (739_373.4 + TIME / 86_400, 86_400.0, pytest.approx(10.0, abs=0.1)),
    "coarse clock": (np.floor(TIME), 1.0, pytest.approx(10.3, abs=0.1)),
    "with gaps and repetitions": (np.where(np.arange(300) % 50 == 3, TIME - 0.1, TIME), 1.0, 10.0),
}


@pytest.mark.parametrize(("stamps", "scale", "rate"), TIMES.values(), ids=TIMES)
def test_unit_of_time_and_sample_rate(stamps, scale, rate):
    vehicle = propose(Table({"t": stamps, "u": SPEED}, ()), "otter").vehicle
    assert vehicle.time.scale == scale
    assert vehicle.sample_rate == rate


MISNAMED = {
    "a date in seconds, called ms": ("time_ms", EPOCH + TIME, 1.0),
    "milliseconds, called s": ("time_s", 1e3 * TIME, 1e-3),
    "a date in milliseconds, called s": ("time_s", 1e3 * (EPOCH + TIME), 1e-3),
}


@pytest.mark.parametrize(("name", "stamps", "scale"), MISNAMED.values(), ids=MISNAMED)
def test_unit_of_time_that_cannot_be_is_not_believed(name, stamps, scale):
    vehicle, comments, *_ = propose(Table({name: stamps, "u": SPEED}, ()), "otter")
    assert (vehicle.time.scale, vehicle.sample_rate) == (scale, 10.0)
    assert "as its name says" in comments["time.column"]


def test_log_without_time_has_a_remark():
    found = propose(Table({"u": SPEED, "depth": 3 + SPEED}, ()), "otter")
    assert found.vehicle.time is None
    assert found.missing["time"].startswith("no column")
    assert found.rate_is_known
    found = propose(Table({"u": SPEED, "time": np.full(300, np.nan)}, ()), "otter")
    assert found.missing["time"].startswith("'time' cannot be read as a time")
    assert not found.rate_is_known


UNITS = {
    "degrees": ("rudder", 20 * np.sin(PHASE), np.pi / 180),
    "radians": ("rudder", 0.3 * np.sin(PHASE), 1.0),
    "centimetres per second": ("speed", 100 * SPEED, 0.01),
    "millivolts": ("port_voltage", 5000 + RPM, 1e-3),
    "revolutions per second": ("n", RPM / 60, 60.0),
}


@pytest.mark.parametrize(("name", "values", "scale"), UNITS.values(), ids=UNITS)
def test_unit_by_size(name, values, scale):
    columns = {"t": TIME, "acceleration": SPEED - 0.4, name: values}
    found = propose(Table(columns, ()), "otter").vehicle.columns.values()
    assert Column(name, pytest.approx(scale)) in found


@pytest.mark.parametrize("mark", [99.99, -9999.0, 32767.0, -999.9])
def test_a_number_for_missing_makes_no_other_unit(mark):
    columns = {"t": TIME, "speed": SPEED.copy(), "motor_current": RPM / 100}
    for values in (columns["speed"], columns["motor_current"]):
        values[::7] = mark
    vehicle = propose(Table(columns, ()), "otter").vehicle
    assert [column.scale for column in vehicle.columns.values()] == [1.0, 1.0]
    assert vehicle.vehicle == Vehicle("otter", shafts=1)


def test_signs_follow_the_speed():
    found = proposal(u=-SPEED, rpm_port=-RPM, n_stbd=RPM, i_port=-0.2 - SPEED).vehicle.columns
    signs = {channel: np.sign(column.scale) for channel, column in found.items()}
    assert signs == {"speed": -1, "port_current": -1, "port_rpm": -1, "starboard_rpm": 1}


def test_constant_and_second_columns_are_left_out_with_a_remark():
    vehicle, _, _, left, _ = proposal(rpm=RPM, n=RPM, V_port=np.full(300, 12.0))
    assert "port_voltage" not in vehicle.columns
    assert any("'V_port': it is constant at 12" in line for line in left)
    assert any("'n': port rpm is 'rpm'" in line for line in left)


def test_setpoint_is_mission_speed_and_speed_command():
    found = proposal(speed_setpoint=SPEED).vehicle.columns
    assert found["mission_speed"] == found["speed_command"] == Column("speed_setpoint")


def test_motor_command_replaces_what_is_not_measured():
    vehicle, comments, *_ = proposal(throttle=100 * SPEED)
    assert vehicle.columns["port_rpm"] == Column("throttle", 15.0)
    assert "replaces the shaft speed" in comments["channels.port_rpm.column"]
    vehicle, comments, *_ = proposal(throttle=100 * SPEED, rpm=RPM)
    assert vehicle.columns["port_rpm"].name == "rpm"
    assert vehicle.columns["port_voltage"] == Column("throttle", pytest.approx(0.24))
    assert "write the supply's voltage" in comments["channels.port_voltage.column"]
    vehicle, _, _, left, _ = proposal(throttle=100 * SPEED, V_port=12 + SPEED)
    assert set(vehicle.columns) == {"speed", "port_voltage"}
    assert any(line.startswith("'throttle': a command") for line in left)


def test_the_shortest_pulse_is_rest():
    pwm = 1100 + 800 * PHASE / PHASE.max()
    column = proposal(pwm1=pwm).vehicle.columns["port_rpm"]
    np.testing.assert_allclose(column.scale * pwm[[0, -1]] + column.offset, [0, 1500], atol=1e-6)
