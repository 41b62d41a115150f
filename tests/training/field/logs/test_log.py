import re
from dataclasses import replace

import numpy as np
import pytest

from auv_fault_env import CATALOGUE, CHANNELS, PRESETS, FaultEvent, Fleet
from auv_fault_env.errors import InputError
from training.field.logs.log import Log, read_log
from training.field.logs.plausible import other_unit
from training.field.vehicle_file import Column, VehicleFile
from training.logged_vehicle import observations_of

from ..calibration.test_relation_fit import model

INDEX = {name: k for k, name in enumerate(CHANNELS)}
# the thesis' vehicle at 0.4 m/s
SPEED = 0.4 + 0.001 * np.arange(7)
RPM = 350.0 + np.arange(7)


def vehicle(rate=10.0, time="t", **columns):
    columns = {"speed": Column("u"), "port_rpm": Column("n")} | columns
    return VehicleFile(PRESETS["thesis1992"], columns, time and Column(time), rate)


def write(tmp_path, time, u=None, n=None, **more):
    time = np.asarray(time, float)
    columns = {"t": time, "u": np.resize(SPEED, time.size) if u is None else u}
    columns |= {"n": np.resize(RPM, time.size) if n is None else n} | more
    path = tmp_path / "log.csv"
    rows = zip(*(np.asarray(column, float).tolist() for column in columns.values()), strict=True)
    path.write_text("\n".join([",".join(columns), *(",".join(map(str, row)) for row in rows)]))
    return path


def read(tmp_path, time, settings=None, **columns) -> Log:
    return read_log(write(tmp_path, time, **columns), settings or vehicle())


def channel(log, name):
    return log.observation[:, INDEX[name]]


def test_log_at_the_sample_rate_is_unchanged(tmp_path):
    log = read(tmp_path, 0.1 * np.arange(150) + 1e5)
    assert log.name == "log.csv"
    assert log.remarks == ()
    assert log.segments == (slice(0, 150),)
    np.testing.assert_allclose(log.time, 0.1 * np.arange(150), atol=1e-9)
    np.testing.assert_array_equal(channel(log, "speed"), np.resize(SPEED, 150))
    np.testing.assert_array_equal(channel(log, "port_rpm"), np.resize(RPM, 150))


def test_channels_that_do_not_exist_are_missing_and_fins_amidships(tmp_path):
    log = read(tmp_path, 0.1 * np.arange(150))
    for name in set(CHANNELS) - {"speed", "port_rpm", "rudder", "stern_plane"}:
        assert np.isnan(channel(log, name)).all()
    assert not channel(log, "rudder").any() and not channel(log, "stern_plane").any()


def test_units_scale_and_offset(tmp_path):
    settings = vehicle(speed=Column("u", -0.5, 0.25), port_rpm=Column("n", 60.0))
    log = read(
        tmp_path,
        0.1 * np.arange(150),
        settings,
        u=np.resize(-2 * SPEED, 150),
        n=np.resize(RPM / 60, 150),
    )
    np.testing.assert_allclose(channel(log, "speed"), np.resize(SPEED, 150) + 0.25)
    np.testing.assert_allclose(channel(log, "port_rpm"), np.resize(RPM, 150))


def test_a_unit_of_the_file_that_is_too_large_is_refused_and_none_named_where_two_fit(tmp_path):
    settings = vehicle(port_rpm=Column("n", 60.0))
    with pytest.raises(InputError, match=r"channels.port_rpm\], or"):
        read(tmp_path, 0.1 * np.arange(150), settings)


def test_a_rudder_in_degrees_is_refused_though_it_is_mostly_amidships(tmp_path):
    rudder = np.zeros(1000)
    rudder[500:520] = np.linspace(9.0, 10.0, 20)
    with pytest.raises(InputError, match=r"channels.rudder\] \(deg"):
        read(tmp_path, 0.1 * np.arange(1000), vehicle(rudder=Column("r")), r=rudder)
    rudder[500:520] = 999.0
    log = read(tmp_path, 0.1 * np.arange(1000), vehicle(rudder=Column("r")), r=rudder)
    assert "rudder: impossible values" in " ".join(log.remarks)


@pytest.mark.parametrize("one", ["mission_speed", "speed_command"])
def test_one_speed_command_replaces_the_other(one):
    rows = observations_of({one: np.array([0.3, 0.4]), "speed": np.array([0.1, 0.2])})
    np.testing.assert_array_equal(rows[:, INDEX["mission_speed"]], [0.3, 0.4])
    np.testing.assert_array_equal(rows[:, INDEX["speed_command"]], [0.3, 0.4])


def test_slow_log_has_gaps_in_readings_and_constant_commands(tmp_path):
    settings = vehicle(1.0, rudder=Column("r"))
    rudder = np.linspace(0.1, 0.2, 20)
    log = read(tmp_path, np.arange(20), settings, r=rudder)
    assert len(log.time) == 191
    read_rows = np.isfinite(channel(log, "speed"))
    np.testing.assert_array_equal(np.flatnonzero(read_rows), 10 * np.arange(20))
    np.testing.assert_array_equal(channel(log, "rudder"), np.repeat(rudder, 10)[:191])


def test_fast_log_keeps_the_nearest_row(tmp_path):
    time = 0.01 * np.arange(1500)
    log = read(tmp_path, time, vehicle(100.0), u=0.3 + time / 100)
    nearest = np.append(log.time[:-1], time[-1])
    assert log.time[-1] == pytest.approx(15.0)
    np.testing.assert_allclose(channel(log, "speed"), 0.3 + nearest / 100, atol=1e-12)
    assert log.remarks == ("time: rows come every 0.01 s; the nearest to each 0.1 s is kept",)


def test_jitter_neither_adds_nor_shifts_readings(tmp_path):
    time = np.append(
        0.0, 0.1 * np.arange(1, 300) + np.random.default_rng(1).uniform(-0.04, 0.04, 299)
    )
    u = 0.3 + time / 1000
    log = read(tmp_path, time, u=u)
    assert set(channel(log, "speed")) == set(u)
    assert abs(channel(log, "speed") - (0.3 + log.time / 1000)).max() <= 0.05 / 1000


def test_channels_that_come_at_different_times(tmp_path):
    time = np.sort(np.concatenate([0.1 * np.arange(150), 0.1 * np.arange(150) + 0.03]))
    u = np.resize(SPEED, 300)
    n = np.resize(RPM, 300)
    u[1::2] = np.nan
    n[::2] = np.nan
    log = read(tmp_path, time, vehicle(20.0), u=u, n=n)
    np.testing.assert_array_equal(channel(log, "speed"), u[::2])
    np.testing.assert_array_equal(channel(log, "port_rpm"), n[1::2])


def test_rows_of_other_instruments_are_left_out(tmp_path):
    time = 0.001 * np.arange(15_000)
    u = np.full(15_000, np.nan)
    n = np.full(15_000, np.nan)
    u[::100] = np.resize(SPEED, 150)
    n[::100] = np.resize(RPM, 150)
    log = read(tmp_path, time, u=u, n=n, depth=time)
    np.testing.assert_array_equal(channel(log, "speed"), u[::100])
    assert log.remarks == ()


def test_no_fault_makes_a_log_unusable(tmp_path):
    faults = list(CATALOGUE)
    fleet = Fleet(len(faults), healthy_band=0.0)
    fleet.reset(
        list(range(len(faults))), schedules=[(FaultEvent(name, 2.0, 1.0),) for name in faults]
    )
    samples = np.stack([fleet.step(np.full((len(faults), 3), [0.4, 0.0, 0.0])) for _ in range(120)])
    settings = VehicleFile(PRESETS["thesis1992"], {name: Column(name) for name in CHANNELS})
    for lane in range(len(faults)):
        np.savetxt(tmp_path / "log.csv", samples[:, lane], delimiter=",", header=",".join(CHANNELS))
        log = read_log(tmp_path / "log.csv", settings)
        np.testing.assert_allclose(log.observation, samples[:, lane], rtol=1e-12)


def test_log_without_time_counts_rows(tmp_path):
    log = read(tmp_path, np.full(150, 7.0), vehicle(time=None))
    np.testing.assert_allclose(log.time, 0.1 * np.arange(150))


def test_gap_begins_a_segment_and_counts_as_time(tmp_path):
    time = np.concatenate([0.1 * np.arange(150), 100 + 0.1 * np.arange(120)])
    log = read(tmp_path, time)
    assert log.segments == (slice(0, 150), slice(150, 270))
    np.testing.assert_allclose(log.time[[0, 149, 150, 269]], [0.0, 14.9, 100.0, 111.9])
    assert log.remarks == ("time: gaps of more than 5 s, after which a new segment begins (1)",)


def test_shorter_gap_stays_within_a_segment(tmp_path):
    time = np.concatenate([0.1 * np.arange(80), 12.0 + 0.1 * np.arange(80)])
    log = read(tmp_path, time)
    assert log.segments == (slice(0, 200),)
    assert np.isnan(channel(log, "speed")[80:120]).all()
    assert np.isfinite(channel(log, "speed")[120:]).all()


@pytest.mark.parametrize("restart", [0.0, 2e9], ids=["set back", "set to the date"])
def test_clock_that_is_set_begins_a_segment(tmp_path, restart):
    time = np.concatenate([0.1 * np.arange(150), restart + 0.1 * np.arange(120)])
    log = read(tmp_path, time)
    assert log.segments == (slice(0, 150), slice(150, 270))
    np.testing.assert_allclose(log.time, 0.1 * np.arange(270), atol=1e-6)
    assert "a new segment begins (1)" in log.remarks[0]


def test_short_segment_is_left_out(tmp_path):
    time = np.concatenate([0.1 * np.arange(50), 100 + 0.1 * np.arange(120)])
    log = read(tmp_path, time)
    assert log.segments == (slice(0, 120),)
    assert log.time[0] == 0.0
    assert log.remarks[-1] == "time: segments shorter than 10 s left out (1)"


def test_rows_between_coarse_ticks_are_distributed_evenly(tmp_path):
    log = read(tmp_path, np.repeat(np.arange(20), 10))
    assert len(log.time) == 200
    assert np.isfinite(channel(log, "speed")).all()
    assert log.remarks == (
        "time: the clock ticks every 1 s only; the rows between are spread evenly",
    )


def test_repeated_rows_are_no_coarse_clock(tmp_path):
    time = np.repeat(0.1 * np.arange(150), 2)
    u = np.resize(SPEED, 300)
    log = read(tmp_path, time, u=u)
    np.testing.assert_array_equal(channel(log, "speed"), u[1::2])
    assert log.remarks == ("time: rows with the stamp of a later row left out (150)",)


@pytest.mark.parametrize("order", ["reversed", "shuffled"])
def test_rows_in_no_order_are_sorted(tmp_path, order):
    time = (
        0.1 * np.arange(150)[::-1]
        if order == "reversed"
        else 0.1 * np.random.default_rng(2).permutation(150)
    )
    log = read(tmp_path, time, u=0.3 + time / 100)
    np.testing.assert_allclose(channel(log, "speed"), 0.3 + log.time / 100)
    assert log.remarks == ("time: the rows are in no order; sorted by their stamps",)


def test_wrong_but_possible_readings_are_accepted(tmp_path):
    u = np.resize(SPEED, 150).copy()
    u[75:] = 0.0
    log = read(tmp_path, 0.1 * np.arange(150), u=u)
    np.testing.assert_array_equal(channel(log, "speed"), u)
    assert log.remarks == ()


def test_a_duty_times_the_supply_is_the_voltage_of_the_motor(tmp_path):
    k = np.arange(200)
    pwm = 1500.0 + 2.0 * k
    supply = 15.0 - 0.001 * k
    column = Column("pwm", 0.0025, -3.75, "supply")
    log = read(tmp_path, 0.1 * k, vehicle(port_voltage=column), pwm=pwm, supply=supply)
    np.testing.assert_allclose(channel(log, "port_voltage"), 0.005 * k * supply, atol=1e-9)
    wrong = vehicle(port_voltage=column._replace(times="supplies"))
    with pytest.raises(InputError, match="supplies"):
        read(tmp_path, 0.1 * k, wrong, pwm=pwm, supply=supply)


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        (
            {"n": RPM / 60},
            r"speed is 6\d(\.\d)? times what port_rpm gives with these constants, "
            r"as if with shaft speed in rev/s; are",
        ),
        (
            {"u": SPEED * 3.6},
            r"speed is 3\.\d+ times what port_rpm gives with these constants; "
            r"are the units right\?",
        ),
        (
            {"u": SPEED / 50},
            r"speed is 0\.02\d* times what port_rpm gives with these constants; "
            r"are the units right\?",
        ),
    ],
    ids=["rev/s", "km/h or ft/s or kn", "none"],
)
def test_disagreeing_units_are_reported_with_an_explanation(tmp_path, columns, words):
    log = read(
        tmp_path,
        0.1 * np.arange(150),
        **{name: np.resize(values, 150) for name, values in columns.items()},
    )
    assert len(log.remarks) == 1
    assert re.match(words, log.remarks[0])


def test_a_calibrated_vehicle_is_compared_more_closely(tmp_path):
    speed = np.resize(SPEED, 150)
    calibrated = replace(vehicle(), relations=model())
    assert read(tmp_path, 0.1 * np.arange(150), calibrated, u=speed).remarks == ()
    # in knots, where the vehicle file says m/s
    for settings, n_remarks in ((vehicle(), 0), (calibrated, 1)):
        log = read(tmp_path, 0.1 * np.arange(150), settings, u=speed * 3600 / 1852)
        assert len(log.remarks) == n_remarks
    assert re.match(
        r"speed is [12]\.\d+ times what port_rpm gives .* as if with speed in kn; are",
        log.remarks[0],
    )


@pytest.mark.parametrize(("sign", "n_remarks"), [(1.0, 0), (-1.0, 1)])
def test_a_current_with_the_wrong_sign_gets_a_remark(tmp_path, sign, n_remarks):
    settings = vehicle(port_current=Column("i"))
    current = sign * (0.8 + 0.01 * np.arange(150))
    # a braking shaft may feed back for a while
    current[:20] *= -1.0
    log = read(tmp_path, 0.1 * np.arange(150), settings, i=current)
    words = "port_current: negative while its shaft turns forward; is its sign right?"
    assert list(log.remarks) == [words] * n_remarks


def test_vehicle_without_thrust_is_not_compared(tmp_path):
    settings = replace(vehicle(), vehicle=replace(PRESETS["thesis1992"], beta=0.0))
    assert read(tmp_path, 0.1 * np.arange(150), settings).remarks == ()


def test_missing_column_is_refused_with_the_nearest(tmp_path):
    settings = vehicle(speed=Column("nn"))
    with pytest.raises(
        InputError, match="column of speed: got 'nn'; allowed is one of t, u, n; did you mean 'n'"
    ):
        read(tmp_path, 0.1 * np.arange(150), settings)


def test_bag_with_topics_at_different_times(tmp_path):
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    typesys = pytest.importorskip("rosbags.typesys")
    types = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    kind = "std_msgs/msg/Float64"
    with rosbag2.Writer(
        tmp_path / "bag", version=9, storage_plugin=rosbag2.StoragePlugin.MCAP
    ) as bag:
        topics = {
            name: bag.add_connection(name, kind, typestore=types) for name in ("/u", "/n", "/depth")
        }
        for k in range(150):
            for late, (name, value) in enumerate(
                {"/u": SPEED[k % 7], "/n": RPM[k % 7], "/depth": 3.0}.items()
            ):
                message = types.serialize_cdr(types.types[kind](data=value), kind)
                bag.write(
                    topics[name],
                    1_700_000_000_000_000_000 + 100_000_000 * k + 20_000_000 * late,
                    message,
                )
    settings = vehicle(time="time", speed=Column("/u/data"), port_rpm=Column("/n/data"))
    log = read_log(tmp_path / "bag", settings)
    assert len(log.time) == 150
    np.testing.assert_array_equal(channel(log, "speed"), np.resize(SPEED, 150))
    np.testing.assert_array_equal(channel(log, "port_rpm"), np.resize(RPM, 150))


def read_of(tmp_path, settings, **columns):
    columns = {name: np.resize(values, 150) for name, values in columns.items()}
    return read(tmp_path, 0.1 * np.arange(150), settings, **columns)


def test_a_unit_is_not_named_that_the_voltage_contradicts(tmp_path):
    torque_constant = vehicle().vehicle.torque_constant
    settings = vehicle(port_voltage=Column("V"))
    voltage = torque_constant * RPM * np.pi / 30
    log = read_of(tmp_path, settings, n=RPM / 60, u=SPEED, V=voltage / 60)
    (remark,) = [one for one in log.remarks if one.startswith("speed is")]
    assert "as if" not in remark


def test_the_speed_is_in_no_other_unit_where_it_agrees_with_one_of_the_shafts():
    settings = replace(vehicle(starboard_rpm=Column("s")), relations=model())
    log = {"speed": np.resize(SPEED, 150), "port_rpm": np.resize(RPM, 150)}
    knots = 1852 / 3600
    slow = log | {"port_rpm": knots * log["port_rpm"], "starboard_rpm": log["port_rpm"]}
    assert other_unit(slow, settings) is None
    of_both = slow | {"starboard_rpm": slow["port_rpm"]}
    assert other_unit(of_both, settings) == ("speed", "kn")


def test_a_unit_is_named_in_place_of_that_of_the_file(tmp_path):
    settings = vehicle(port_rpm=Column("n", 30 / np.pi))
    log = read_of(tmp_path, settings, n=RPM / 60)
    (remark,) = log.remarks
    assert "as if with shaft speed in rev/s; are" in remark
