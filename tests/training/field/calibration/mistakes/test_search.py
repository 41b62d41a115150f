from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import Mission
from auv_fault_env.parameters import PRESETS
from auv_fault_env.schedules import FaultEvent
from training.field.calibration.mistakes.search import find_mistakes
from training.field.units import GRAVITY, KNOT
from training.field.vehicle_file import Column, VehicleFile
from training.rollouts import roll_out
from training.seeds import seeds

from ...fleet_logs import log_of
from ...healthy_missions import OFF, kept

FILE = VehicleFile(OFF, {name: Column(name) for name in CHANNELS})
ONE_SHAFT = replace(OFF, shafts=1)
N_SAMPLES = 3000
LEGS = (
    (0.0, 0.0),
    (30.0, 0.3),
    (70.0, 0.5),
    (120.0, 0.7),
    (170.0, 0.4),
    (220.0, 0.6),
    (270.0, 0.0),
)
OTHER_LEGS = ((0.0, 0.0), (15.0, 0.6), (90.0, 0.3), (150.0, 0.65), (200.0, 0.45), (260.0, 0.0))
FIRST_SEED = 95_000
MOTOR = ("port_voltage", "port_current", "port_rpm")
SIDES = ("port", "starboard")


@cache
def observations(n=4, vehicle=OFF, realism=1.0, events=(), first=0, legs=LEGS, n_samples=N_SAMPLES):
    fleet = Fleet(n, vehicle, realism=realism)
    lanes = seeds("calibration", n, FIRST_SEED + first)
    rolled = roll_out(fleet, lanes, n_samples, None, [events] * n, [Mission(legs)] * n)
    return rolled.observations.astype(float)


def logs_of(*arguments, **settings):
    """Logs whose observations may be changed."""
    lanes = np.moveaxis(observations(*arguments, **settings), 1, 0)
    return [
        log_of(lane.copy())._replace(name=f"{settings.get('first', 0) + k}.csv")
        for k, lane in enumerate(lanes)
    ]


def column(log, channel):
    return log.observation[:, INDEX[channel]]


def scaled(factors, offsets=None):
    """Healthy logs with some channels multiplied and shifted."""
    logs = logs_of()
    for log in logs:
        for name, factor in factors.items():
            column(log, name)[:] *= factor
        for name, offset in (offsets or {}).items():
            column(log, name)[:] += offset
    return logs


def file_with(file=FILE, **columns):
    return replace(file, columns=dict(file.columns) | columns)


def only(findings):
    assert len(findings) == 1, list(map(str, findings))
    return findings[0]


@pytest.mark.parametrize("preset", PRESETS.values(), ids=PRESETS)
@pytest.mark.parametrize("realism", [0.0, 1.0])
@pytest.mark.parametrize("legs", [LEGS, OTHER_LEGS, ((0.0, 0.3),)], ids=["legs", "other", "one"])
def test_a_right_file_has_no_mistake(preset, realism, legs):
    absent = "" if preset.shafts == len(SIDES) else "starboard"
    columns = {name: Column(name) for name in CHANNELS if name.partition("_")[0] != absent}
    logs = logs_of(4, preset, realism, legs=legs)
    assert find_mistakes(logs, VehicleFile(preset, columns)) == []


@pytest.mark.parametrize(
    "absent",
    [
        ("mission_speed", "speed_command"),
        ("speed",),
        ("port_rpm", "starboard_rpm"),
        ("port_voltage", "starboard_voltage"),
        ("port_current", "starboard_current"),
        ("mission_speed", "speed_command", "port_rpm", "starboard_rpm"),
        tuple(name for name in CHANNELS if name != "speed"),
    ],
    ids=" ".join,
)
def test_channels_that_a_vehicle_does_not_have_are_no_mistake(absent):
    file = replace(FILE, columns={n: c for n, c in FILE.columns.items() if n not in absent})
    logs = logs_of()
    for log in logs:
        for name in absent:
            column(log, name)[:] = np.nan
    assert find_mistakes(logs, file) == []


def test_one_shaft_at_one_hertz_without_rpm_has_no_mistake():
    names = ("speed", "port_voltage", "port_current")
    columns = {name: Column(name) for name in ("mission_speed", *names)}
    file = VehicleFile(ONE_SHAFT, columns, sample_rate=1.0)
    assert find_mistakes(kept(logs_of(), names, every=10), file) == []


@pytest.mark.parametrize("has_rest", [True, False])
def test_the_voltage_of_the_supply_is_named(has_rest):
    logs = logs_of()
    for k, log in enumerate(logs):
        currents = column(log, "port_current") + column(log, "starboard_current")
        column(log, "port_voltage")[:] = 24.0 - 0.1 * k - 0.2 * currents
        if not has_rest:
            rows = slice(310, 2690)
            logs[k] = log_of(log.observation[rows])._replace(name=log.name)
    finding = only(find_mistakes(logs, FILE))
    assert finding.channels == ("port_voltage",)
    assert "supply" in finding.cause and "[channels.port_voltage]" in finding.remedy
    words = "at rest" if has_rest else "hardly follows port_rpm"
    assert words in finding.evidence and "%" in finding.evidence
    assert not finding.is_fatal


@pytest.mark.parametrize(
    ("channels", "factor", "unit"),
    [
        (("speed",), 1 / KNOT, "kn"),
        (("speed",), 0.01, None),
        (("speed",), 3.6, "km/h"),
        (("port_rpm", "starboard_rpm"), 1 / 60.0, "rev/s"),
        (("starboard_rpm",), 1 / 60.0, "rev/s"),
        (("port_rpm", "starboard_rpm"), np.pi / 30.0, "rad/s"),
        (("port_current",), 1000.0, "mA"),
        (("port_current", "starboard_current"), 1000.0, "mA"),
        (("port_voltage", "starboard_voltage"), 1000.0, "mV"),
    ],
)
def test_a_unit_that_is_off_is_named(channels, factor, unit):
    finding = only(find_mistakes(scaled(dict.fromkeys(channels, factor)), FILE))
    assert set(channels) <= set(finding.channels)
    if unit:
        tables = " and ".join(f"[channels.{name}]" for name in channels)
        assert f'unit = "{unit}" in {tables}' in finding.remedy


def test_a_unit_in_the_file_that_is_too_much_is_named():
    current = {f"{side}_current": Column(f"{side}_current", 1e-3) for side in SIDES}
    logs = scaled(dict.fromkeys(current, 1e-3))
    finding = only(find_mistakes(logs, file_with(**current)))
    assert (
        'unit = "A" in [channels.port_current] and [channels.starboard_current]' in finding.remedy
    )


def test_a_duty_is_no_voltage():
    finding = only(find_mistakes(scaled(dict.fromkeys(MOTOR[:1], 1 / 24.0)), FILE))
    assert finding.channels == ("port_voltage",)
    assert "duty" in finding.cause and "times" in finding.remedy


def test_a_diameter_that_cannot_be_is_named():
    vehicle = replace(OFF, diameter=10.0 * OFF.diameter)
    finding = only(find_mistakes(logs_of(), replace(FILE, vehicle=vehicle)))
    assert finding.channels == ("diameter",)
    assert "[parameters]" in finding.remedy


@pytest.mark.parametrize("offset", [0.8, -0.6])
def test_a_current_at_rest_is_the_offset_to_write(offset):
    finding = only(find_mistakes(scaled({}, {"port_current": offset}), FILE))
    assert finding.channels == ("port_current",)
    assert "A at rest" in finding.evidence
    assert ("hotel load" in finding.cause) == (offset > 0.0)
    written = float(finding.remedy.partition("offset = ")[2].split()[0])
    assert written == pytest.approx(-offset, abs=0.05)


@pytest.mark.parametrize(
    ("channel", "offset"), [("port_voltage", 3.0), ("speed", 0.15), ("port_rpm", 150.0)]
)
def test_other_readings_that_are_not_zero_at_rest_have_their_offset_named(channel, offset):
    finding = only(find_mistakes(scaled({}, {channel: offset}), FILE))
    assert finding.channels == (channel,)
    written = float(finding.remedy.partition("offset = ")[2].split()[0])
    assert written == pytest.approx(-offset, rel=0.3)


@pytest.mark.parametrize(
    "channel", ["mission_speed", "speed", "port_voltage", "starboard_current", "port_rpm"]
)
def test_a_sign_that_is_turned_is_fatal(channel):
    names = ("mission_speed", "speed_command") if channel == "mission_speed" else (channel,)
    finding = only(find_mistakes(scaled(dict.fromkeys(names, -1.0)), FILE))
    assert finding.channels == (channel,)
    assert finding.is_fatal and "sign" in finding.remedy


@pytest.mark.parametrize(
    ("kinds", "named"), [(("current",), "current"), (("voltage",), "voltage"), (("rpm",), "rpm")]
)
def test_swapped_sides_are_found_where_the_sides_differ(kinds, named):
    logs = logs_of()
    others = logs_of(legs=OTHER_LEGS)
    for log, other in zip(logs, others, strict=True):
        for kind in ("voltage", "current", "rpm"):
            column(log, f"starboard_{kind}")[:] = column(other, f"starboard_{kind}")
        for kind in kinds:
            port, starboard = (column(log, f"{side}_{kind}") for side in SIDES)
            of_port = port.copy()
            port[:] = starboard
            starboard[:] = of_port
    found = [one for one in find_mistakes(logs, FILE) if "swapped" in one.cause]
    assert only(found).channels == (f"port_{named}", f"starboard_{named}")


def test_sides_that_differ_are_not_swapped():
    logs = logs_of()
    for log, other in zip(logs, logs_of(legs=OTHER_LEGS), strict=True):
        for kind in ("voltage", "current", "rpm"):
            column(log, f"starboard_{kind}")[:] = column(other, f"starboard_{kind}")
    assert not any("swapped" in one.cause for one in find_mistakes(logs, FILE))


@pytest.mark.parametrize(
    ("one", "other", "is_fatal"),
    [
        ("mission_speed", "speed", True),
        ("port_current", "starboard_current", False),
        ("port_voltage", "port_current", False),
    ],
)
def test_a_column_that_serves_two_channels_is_named(one, other, is_fatal):
    logs = logs_of()
    for log in logs:
        column(log, other)[:] = column(log, one)
        if one == "mission_speed":
            column(log, "speed_command")[:] = column(log, one)
    finding = find_mistakes(logs, file_with(**{other: Column(one)}))[0]
    assert finding.channels == (one, other) and finding.is_fatal == is_fatal
    assert repr(one) in finding.evidence
    copied = find_mistakes(logs, FILE)[0]
    equal = "equal" in copied.evidence
    assert equal and copied.channels[-1] == other


def test_a_motor_command_may_be_voltage_and_shaft_speed():
    file = file_with(port_voltage=Column("throttle"), port_rpm=Column("throttle"))
    assert find_mistakes(logs_of(), file) == []


def test_a_vehicle_without_a_starboard_side_has_one_shaft():
    names = {name: Column(name) for name in CHANNELS if not name.startswith("starboard")}
    finding = only(find_mistakes(logs_of(), replace(FILE, columns=names)))
    assert "shafts = 1" in finding.remedy
    assert find_mistakes(logs_of(), VehicleFile(ONE_SHAFT, names)) == []


def test_a_sensor_that_is_stuck_in_one_log_is_of_the_log():
    logs = logs_of()
    current = column(logs[1], "port_current")
    current[800:] = current[800]
    finding = only(find_mistakes(logs, FILE))
    assert finding.log == "1.csv" and "port_current stays" in finding.evidence


def test_a_sensor_that_is_stuck_in_all_logs_is_of_the_file():
    logs = logs_of()
    for log in logs:
        column(log, "speed")[:] = 0.4
    finding = only(find_mistakes(logs, FILE))
    assert finding.channels == ("speed",) and not finding.log


def test_readings_that_fall_to_zero_are_of_the_log():
    logs = logs_of()
    is_lost = np.random.default_rng(1).random(N_SAMPLES) < 0.4
    column(logs[2], "port_rpm")[is_lost] = 0.0
    finding = only(find_mistakes(logs, FILE))
    assert finding.log == "2.csv" and "port_rpm is zero" in finding.evidence


def test_values_that_are_held_have_their_rate_named():
    logs = logs_of(realism=0.0)
    for log in logs:
        speed = column(log, "speed")
        speed[:] = np.repeat(speed[::5], 5)
    finding = only(find_mistakes(logs, FILE))
    assert finding.channels == ("speed",)
    assert "5 rows" in finding.evidence and "2 come a second" in finding.evidence


@pytest.mark.parametrize("stated", [5.0, 0.5])
def test_the_rate_of_another_log_is_named(stated):
    names = ("speed", *MOTOR, "starboard_voltage", "starboard_current", "starboard_rpm")
    logs = kept(logs_of(), names, every=5)
    findings = find_mistakes(logs, replace(FILE, sample_rate=stated))
    assert "sample_rate = 2 " in findings[0].remedy
    columns = {name: FILE.columns[name] for name in ("mission_speed", *names)}
    assert find_mistakes(logs, replace(FILE, columns=columns, sample_rate=2.0)) == []


def test_degrees_as_radians_are_named():
    logs = logs_of()
    column(logs[0], "rudder")[1000:1100] = 2.5
    finding = only(find_mistakes(logs, FILE))
    assert finding.channels == ("rudder",) and '"deg"' in finding.remedy


@pytest.mark.parametrize(
    ("factor", "words"), [(1 / GRAVITY, 'unit = "g"'), (-1.0, "sign"), (5.0, "check unit")]
)
def test_an_acceleration_that_is_no_change_of_the_speed_is_named(factor, words):
    logs = logs_of(realism=0.0)
    for log in logs:
        column(log, "acceleration")[:] *= factor
    finding = only(find_mistakes(logs, FILE))
    assert finding.channels == ("acceleration",) and words in finding.remedy


@pytest.mark.parametrize(
    ("fault", "severity", "words"),
    [
        ("seal_friction:port", 0.9, "the load of port"),
        ("propeller_damage:starboard", 0.9, "the load of starboard"),
        ("increased_drag", 0.9, "the drag"),
    ],
)
def test_a_fault_within_a_healthy_log_is_of_the_log(fault, severity, words):
    (faulty,) = logs_of(1, events=(FaultEvent(fault, onset=140.0, severity=severity),), first=50)
    finding = only(find_mistakes([*logs_of(), faulty], FILE))
    assert finding.log == faulty.name and words in finding.evidence
    time = float(finding.evidence.partition("at about ")[2].split()[0])
    assert time == pytest.approx(140.0, abs=30.0)


def test_a_fault_in_the_whole_of_a_log_is_of_the_log():
    (faulty,) = logs_of(1, events=(FaultEvent("seal_friction:port", 0.0, 0.9),), first=50)
    finding = only(find_mistakes([*logs_of(), faulty], FILE))
    assert finding.log == faulty.name
    assert "the load of port differs" in finding.evidence


def test_of_two_logs_that_differ_one_is_of_the_log():
    (faulty,) = logs_of(1, events=(FaultEvent("seal_friction:port", 0.0, 0.9),), first=50)
    finding = only(find_mistakes([*logs_of()[:1], faulty], FILE))
    assert "against the other log" in finding.evidence


def test_a_step_in_a_single_log_is_found():
    event = FaultEvent("seal_friction:port", onset=140.0, severity=0.9)
    finding = only(find_mistakes(logs_of(1, events=(event,), first=50), FILE))
    assert "the load of port changes" in finding.evidence


def test_a_payload_is_no_mistake():
    (loaded,) = logs_of(1, replace(OFF, alpha=1.1 * OFF.alpha), first=60)
    assert find_mistakes([*logs_of(), loaded], FILE) == []


def test_a_zero_error_of_one_log_is_no_step_where_the_speed_falls():
    legs = ((0.0, 0.0), (20.0, 0.35), (45.0, 0.7), (150.0, 0.35), (280.0, 0.0))
    logs = logs_of(legs=legs)
    column(logs[1], "port_current")[:] += 0.25
    finding = only(find_mistakes(logs, FILE))
    assert finding.log == "1.csv" and "the load of port differs" in finding.evidence


def test_a_copy_of_a_log_is_named():
    logs = logs_of()
    copy = logs[1]._replace(name="copy.csv")
    finding = only(find_mistakes([*logs, copy], FILE))
    assert finding.log == "copy.csv" and "1.csv" in finding.evidence


def test_a_speed_over_ground_in_a_current_is_named():
    logs = logs_of()
    for k, log in enumerate(logs):
        column(log, "speed")[:1450] += 0.12 * (-1) ** k
        column(log, "speed")[1450:] -= 0.12 * (-1) ** k
    findings = find_mistakes(logs, FILE)
    assert any("over ground" in one.cause and "drag" in one.remedy for one in findings)
    assert not any("the drag" in one.evidence for one in findings)


@pytest.mark.parametrize("value", [np.nan, 0.0, 1.7])
@pytest.mark.parametrize("channels", [MOTOR, ("speed",), ("mission_speed", "port_current")])
def test_channels_without_content_end_in_findings_and_no_error(channels, value):
    logs = logs_of()
    for log in logs:
        for name in channels:
            column(log, name)[:] = value
    assert all(str(one) for one in find_mistakes(logs, FILE))
