from dataclasses import replace

import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS, READINGS
from auv_fault_env.errors import InputError
from auv_fault_env.faults import UNKNOWN, classes
from diagnosers import Belief, make
from training.field.diagnosis.diagnosis import (
    FAULT,
    HEALTHY,
    THRESHOLDS,
    alarm_intervals,
    beliefs,
    diagnoser_for,
    is_alarmed,
    persistence,
    verdict,
)
from training.field.diagnosis.page import verdicts_section
from training.field.logs.resolution import resolution
from training.field.vehicle_file import VEHICLE_DIAGNOSERS, Column

from ..fleet_logs import NAMES, VEHICLE, episode, log_of

THRESHOLD = THRESHOLDS["filter_bank"]
ONE_SHAFT = replace(
    VEHICLE,
    vehicle=replace(VEHICLE.vehicle, shafts=1),
    sample_rate=1.0,
    columns={
        name: VEHICLE.columns[name]
        for name in ("speed_command", "speed", "port_voltage", "port_current")
    },
)


def judged(log, vehicle=VEHICLE, name="filter_bank"):
    belief = beliefs(log, name, vehicle)
    return verdict(
        "log.csv",
        log,
        belief,
        is_alarmed(log, belief, THRESHOLDS[name], persistence(vehicle)),
        vehicle,
    )


def of_vehicle(observations, vehicle):
    """The log as a vehicle with fewer channels and a lower rate has it."""
    seen = np.full(observations.shape, np.nan)
    columns = [NAMES.index(name) for name in vehicle.columns]
    step = round(10 / vehicle.sample_rate)
    seen[::step, columns] = observations[::step, columns]
    return seen


def test_a_healthy_log_is_healthy():
    one = judged(log_of(episode()))
    assert one.verdict == HEALTHY
    assert one.alarm_time is None and one.fault is None and one.severity is None
    assert one.duration == pytest.approx(19.9)


@pytest.mark.parametrize(
    ("fault", "name", "side", "sign"),
    [
        ("seal_friction:port", "seal_friction:port", "port", 1),
        ("propeller_loss:starboard", "propeller_loss:starboard", "starboard", -1),
        ("sensor_bias:acceleration", "sensor:acceleration", None, 0),
    ],
)
def test_a_fault_is_named_with_side_severity_and_sign_of_the_load(fault, name, side, sign):
    one = judged(log_of(episode(fault)))
    assert (one.verdict, one.fault, one.side) == (FAULT, name, side)
    assert 5.0 < one.alarm_time < 12.0
    assert one.severity_low <= 0.9 <= one.severity_high
    assert one.top[0][0] == name and one.top[0][1] > 0.5
    loads = dict(one.load)
    if side:
        assert sign * loads.pop(side) > 0.1
    assert all(abs(load) < 0.1 for load in loads.values())


def test_every_diagnoser_diagnoses_a_log():
    log = log_of(episode("propeller_loss:port", n_samples=100))
    for name in VEHICLE_DIAGNOSERS:
        belief = beliefs(log, name, VEHICLE)
        np.testing.assert_allclose(np.exp(belief.log_probability).sum(axis=1), 1.0, rtol=1e-5)


def test_each_segment_begins_anew():
    observations = episode("seal_friction:port")
    whole = log_of(np.concatenate([observations, observations]), (slice(0, 200), slice(200, 400)))
    belief = beliefs(whole, "filter_bank", VEHICLE)
    np.testing.assert_array_equal(belief.log_probability[:200], belief.log_probability[200:])
    assert len(judged(whole).alarms) == 2


def test_intervals_end_with_the_alarm_or_the_segment():
    log = log_of(np.zeros((10, len(NAMES))), (slice(0, 6), slice(6, 10)))
    alarmed = np.array([0, 1, 1, 0, 1, 1, 1, 0, 0, 1], bool)
    spans = [(0.1, 0.2), (0.4, 0.5), (0.6, 0.6), (0.9, 0.9)]
    np.testing.assert_allclose(alarm_intervals(log, alarmed), spans)


def test_an_alarm_does_not_reach_from_one_segment_into_the_next():
    log = log_of(np.zeros((8, len(NAMES))), (slice(0, 4), slice(4, 8)))
    belief = beliefs(log, "filter_bank", VEHICLE)
    belief.log_probability[:, 0] = [0, 0, -99, -99, -99, 0, 0, 0]
    assert not is_alarmed(log, belief, THRESHOLD, 3).any()
    assert is_alarmed(log, belief, THRESHOLD, 2).tolist() == [False, False, False, True] + 4 * [
        False
    ]


def test_the_parameters_of_the_vehicle_file_are_used():
    """What is healthy for one vehicle is a fault of another, whose seals bind less."""
    friction = VEHICLE.vehicle.coulomb_friction / 2.5
    one = judged(
        log_of(episode()),
        replace(VEHICLE, vehicle=replace(VEHICLE.vehicle, coulomb_friction=friction)),
    )
    assert one.verdict == FAULT and one.alarm_time < 10.0
    assert one.load["port"] > 0.1 and one.load["starboard"] > 0.1


def test_one_shaft_at_one_hertz_without_rpm():
    healthy, faulty = (
        of_vehicle(episode(fault, severity=0.5, n_samples=600), ONE_SHAFT)
        for fault in (None, "seal_friction:port")
    )
    assert judged(log_of(healthy), ONE_SHAFT).verdict == HEALTHY
    one = judged(log_of(faulty), ONE_SHAFT)
    assert one.verdict == FAULT and one.side == "port" and one.alarm_time > 5.0
    assert one.load["port"] > 0.1 and set(one.load) == {"port"}


def test_an_unknown_fault_has_neither_side_nor_severity():
    log = log_of(episode(n_samples=20))
    shape = 20, len(classes())
    belief = Belief(np.full(shape, -9.0), np.full(shape, 0.5), np.full(shape, 0.1))
    belief.log_probability[:, classes().index(UNKNOWN)] = -0.1
    alarmed = np.ones(20, bool)
    one = verdict("log.csv", log, belief, alarmed, VEHICLE)
    assert (one.verdict, one.fault, one.side) == (FAULT, UNKNOWN, None)
    assert one.severity is None and one.severity_low is None and one.severity_high is None
    assert "severity (95 %)" not in verdicts_section([("log.csv", one)])["table"]["columns"]


def test_faults_of_absent_channels_are_no_hypotheses():
    belief = beliefs(log_of(of_vehicle(episode(), ONE_SHAFT)), "filter_bank", ONE_SHAFT)
    absent = [name for name in READINGS if name not in ONE_SHAFT.columns]
    impossible = [
        k for k, name in enumerate(classes()) if "starboard" in name or name[7:] in absent
    ]
    assert len(impossible) == 9
    assert not np.exp(belief.log_probability[:, impossible]).any()


@pytest.mark.parametrize(
    "vehicle", [ONE_SHAFT, replace(VEHICLE, sample_rate=5.0)], ids=["channels", "rate"]
)
def test_other_diagnosers_refuse_missing_readings(vehicle):
    with pytest.raises(InputError, match="filter_bank for a vehicle without"):
        diagnoser_for("limits", vehicle, {})


def test_a_log_without_a_shaft_is_refused():
    columns = {
        name: column for name, column in VEHICLE.columns.items() if not name.startswith("port")
    }
    with pytest.raises(InputError, match="port_voltage or port_rpm"):
        diagnoser_for("filter_bank", replace(VEHICLE, columns=columns), {})


def test_an_unknown_diagnoser_is_refused_with_the_nearest_one():
    with pytest.raises(InputError, match="did you mean 'filter_bank'"):
        diagnoser_for("filterbank", VEHICLE, {})


@pytest.mark.parametrize("voltage", [1, 2])
def test_a_coarse_log_is_no_stuck_sensor(voltage):
    places = {"m/s": 2, "m/s^2": 3, "V": voltage, "A": 2, "rpm": 0}
    coarse = episode(n_samples=600).copy()
    for name in READINGS:
        coarse[:, NAMES.index(name)] = coarse[:, NAMES.index(name)].round(
            places[CHANNELS[name].unit]
        )
    assert judged(log_of(coarse)).verdict == HEALTHY
    # so coarse that a bank of an exact model takes repeated values for a stuck sensor
    unaware = make("gaussian_bank")
    unaware.reset(1)
    deepest = min(unaware.update(row[None]).log_probability[0, 0] for row in coarse)
    assert deepest < THRESHOLD


def test_resolution_is_the_step_of_a_grid_that_the_values_lie_on():
    random = np.random.default_rng(1)
    values = random.normal(1.0, 0.1, 400)
    assert resolution(values, noise=1.0) == 0.0
    assert resolution(values.round(3) * 0.3048, noise=1.0) == pytest.approx(3.048e-4)
    assert resolution(
        np.where(random.random(400) < 0.9, np.nan, values.round(2)), noise=1.0
    ) == pytest.approx(0.01)
    assert resolution(np.full(9, 3.0), noise=0.1) == pytest.approx(0.25)
    assert resolution(values.round(1), noise=0.001) == pytest.approx(0.0025)


@pytest.mark.parametrize(("std", "severity"), [(0.29, None), (0.1, 0.5)])
def test_a_severity_that_may_be_anything_is_none(std, severity):
    log = log_of(episode(n_samples=100))
    shape = 100, len(classes())
    log_probability = np.full(shape, np.log(0.1 / (shape[1] - 1)))
    log_probability[:, 1] = np.log(0.9)
    belief = Belief(log_probability, np.full(shape, 0.5), np.full(shape, std))
    one = verdict("log.csv", log, belief, np.ones(100, bool), VEHICLE)
    assert (one.fault, one.severity) == (classes()[1], severity)


def test_a_voltage_computed_from_the_supply_is_no_sensor_that_fails():
    computed = {"port_voltage": Column("duty", 0.01, 0.0, "supply")}
    vehicle = replace(VEHICLE, columns=dict(VEHICLE.columns) | computed)
    faults = diagnoser_for("filter_bank", vehicle, {}).faults
    assert "sensor_scale:port_current" in faults
    assert not any("port_voltage" in name for name in faults)
