from dataclasses import replace

import numpy as np
import pytest

from auv_fault_env.channels import INDEX
from auv_fault_env.parameters import PRESETS
from training.field.calibration.calibration import (
    NAMES,
    calibrate,
    calibrate_samples,
    larger_maxima,
    refitted,
    side_differences,
)
from training.field.calibration.checks import leave_one_out, prediction_errors
from training.field.calibration.robust_fit import LARGEST_STD
from training.field.calibration.samples import samples_of
from training.field.vehicle_file import BAND, VehicleFile
from training.studies.calibration import SAMPLED, CalibrationStudy, study

from ..fleet_logs import VEHICLE, episode, log_of
from ..healthy_missions import FILE, OFF, PRESET, healthy_logs, kept

MOTOR = ("torque_constant", "resistance", "coulomb_friction", "propeller_torque")
SURGE = ("alpha", "beta")


@pytest.fixture(scope="module")
def logs():
    return healthy_logs()


@pytest.fixture(scope="module")
def calibration(logs):
    return calibrate(logs, FILE)


def was_fitted(calibration, name):
    return calibration.is_fitted(name)


def test_vehicles_of_foreign_logs_are_found_within_their_intervals():
    results = study(CalibrationStudy(vehicles=6, seed=1000))
    for name in SAMPLED:
        row = results["parameters"][name]
        # fewer of 6 has probability 0.002 for one parameter if intervals are honest
        assert row["inside"] >= 4, name
        assert row["half_width"] < 0.06 and row["error"] < 0.03 < 0.08 < row["error_before"]
    assert sum(results["parameters"][name]["inside"] for name in SAMPLED) >= 26  # of 30


def test_the_fit_without_a_mission_is_that_of_the_other_missions_alone(logs, calibration):
    others = samples_of(logs[1:])
    quick = refitted(others, calibration)
    alone = calibrate_samples(others, FILE)
    for name in NAMES:
        assert quick.is_fitted(name) == alone.is_fitted(name)
        if quick.is_fitted(name):
            difference = quick.parameter(name).value - alone.parameter(name).value
            assert abs(difference) < 0.2 * alone.parameter(name).std, name


@pytest.mark.parametrize("name", (*SURGE, *MOTOR))
def test_estimates_are_near_the_truth_and_go_into_the_file(calibration, name):
    truth = 1.0 if name == "propeller_torque" else getattr(OFF, name)
    estimate = calibration.parameter(name)
    assert estimate.low < estimate.value < estimate.high
    assert abs(estimate.value - truth) < 4 * estimate.std < 0.2 * abs(truth)
    if name != "propeller_torque":
        assert estimate.value == getattr(calibration.vehicle.vehicle, name)
        assert estimate.before == getattr(PRESET, name)


def test_noise_and_disturbance_are_those_of_the_plant(calibration):
    for name, std in FILE.noise.items():
        doubt = 0.25 if name.endswith("rpm") else 0.1
        assert calibration.vehicle.noise[name] == pytest.approx(std, rel=doubt), name
    assert calibration.vehicle.vehicle.disturbance_std == pytest.approx(
        PRESET.disturbance_std, rel=0.35
    )


def test_model_without_noise_predicts_the_plant_itself():
    samples = samples_of(healthy_logs(noise=0.0, n=2))
    left = prediction_errors(samples, replace(FILE, vehicle=OFF))
    assert np.nanmax(abs(left["speed"])) < 2e-3  # m/s, in 90 s of free simulation
    for side in ("port", "starboard"):  # the motors get the speed as a mean over two seconds
        assert np.nanstd(left[f"{side}_rpm"]) < 0.15
        assert np.nanstd(left[f"{side}_current"]) < 2e-3


def test_constant_speed_identifies_only_the_ratio_of_thrust_to_drag():
    found = calibrate(healthy_logs(mission=0.4), FILE)
    assert not was_fitted(found, "alpha")
    assert found.vehicle.vehicle.alpha == PRESET.alpha
    assert "%" in found.parameter("alpha").why or "hardly" in found.parameter("alpha").why
    assert "speed steps" in found.parameter("alpha").remedy
    vehicle = found.vehicle.vehicle
    assert vehicle.beta / vehicle.alpha == pytest.approx(OFF.beta / OFF.alpha, rel=0.02)


def test_only_rudder_or_planes_identify_gamma(calibration):
    assert not was_fitted(calibration, "gamma")
    assert calibration.parameter("gamma").why == "rudder and planes do not move"
    assert calibration.vehicle.vehicle.gamma == PRESET.gamma
    truth = replace(OFF, gamma=1.5 * OFF.gamma)
    found = calibrate(healthy_logs(truth, rudder=0.35, n_samples=1200), FILE)
    estimate = found.parameter("gamma")
    assert was_fitted(found, "gamma")
    assert abs(estimate.value - truth.gamma) < 4 * estimate.std
    assert estimate.std < LARGEST_STD * abs(truth.gamma)


@pytest.mark.parametrize(
    ("channels", "why"),
    [
        (("speed", "port_rpm", "starboard_rpm"), "no current"),
        (("speed", "port_current"), "neither a shaft speed nor a voltage"),
    ],
)
def test_motors_without_their_readings_keep_the_file(logs, channels, why):
    found = calibrate(kept(logs, channels), FILE)
    for name in MOTOR:
        assert not was_fitted(found, name)
        assert why in found.parameter(name).why
        assert found.parameter(name).value == found.parameter(name).before
    assert found.vehicle.vehicle.resistance == PRESET.resistance


def test_without_speed_no_hull_parameter_is_fitted(logs):
    found = calibrate(kept(logs, ("port_voltage", "port_current", "port_rpm")), FILE)
    assert all(not was_fitted(found, name) for name in SURGE)
    assert "no speed reading" in found.parameter("alpha").why
    assert was_fitted(found, "torque_constant")  # with the commanded speed


def test_one_shaft_at_one_hertz_without_rpm(logs):
    """The thrust rests on shaft speeds that the motors' fit makes of the voltage, and its interval
    knows of it.
    """
    truth = replace(
        PRESET, coulomb_friction=1.3 * PRESET.coulomb_friction, alpha=1.2 * PRESET.alpha
    )
    poor = kept(healthy_logs(truth, n=12), ("speed", "port_voltage", "port_current"), every=10)
    columns = {name: FILE.columns[name] for name in ("speed", "port_voltage", "port_current")}
    found = calibrate(poor, VehicleFile(replace(PRESET, shafts=1), columns, sample_rate=1.0))
    assert not was_fitted(found, "viscous_friction")
    friction = found.parameter("coulomb_friction")
    assert (
        abs(friction.value - truth.coulomb_friction)
        < 4 * friction.std
        < 0.3 * truth.coulomb_friction
    )
    for name in SURGE:
        estimate = found.parameter(name)
        assert (
            abs(estimate.value - getattr(truth, name))
            < 4 * estimate.std
            < 0.5 * abs(getattr(truth, name))
        )
    assert found.vehicle.shafts == 1


def test_band_is_the_files_after_one_mission_and_that_of_the_missions_after_many():
    few = calibrate(healthy_logs(n=1, n_samples=1500), FILE)
    # three times as wide as the file says
    many = calibrate(healthy_logs(n=16, n_samples=600, band=3.0), FILE)
    for name in MOTOR[:3]:
        assert few.vehicle.band[name] > 0.85 * BAND[name]  # both shafts together tell a little
        assert 1.5 * BAND[name] < many.vehicle.band[name] < 6.0 * BAND[name], name
    assert few.vehicle.band["c1"] == few.vehicle.band["c2"]


def test_equal_sides_differ_by_no_more_than_their_errors(calibration):
    for name, (difference, std) in side_differences(calibration).items():
        assert abs(difference) < 4 * std, name


def test_a_difference_of_the_sides_is_reported():
    logs = healthy_logs()
    # a port current sensor that reads 10 % more looks like more friction and less resistance
    for log in logs:
        log.observation[:, list(FILE.columns).index("port_current")] *= 1.1
    difference, std = side_differences(calibrate(logs, FILE))["coulomb_friction"]
    assert difference > 4 * std


def test_a_different_mission_changes_the_fit_without_it():
    logs = [
        *healthy_logs(n=4),
        *healthy_logs(replace(OFF, alpha=1.5 * OFF.alpha), n=2, seed=50)[1:],
    ]
    samples = samples_of(logs)
    rows = leave_one_out(samples, calibrate(logs, FILE), [log.name for log in logs])
    assert len(rows) == 5
    *usual, last = [row.error_without["speed"] for row in rows]
    assert last > 1.5 * max(usual)
    assert rows[-1].error["speed"] < last
    assert leave_one_out(samples_of(logs[:1]), calibrate(logs[:1], FILE), ["only"]) == []


def test_every_parameter_is_either_fitted_or_explained(calibration):
    for name in NAMES:
        assert was_fitted(calibration, name) != bool(calibration.parameter(name).why), name


def test_file_of_another_preset_finds_the_same_vehicle(logs, calibration):
    other = calibrate(logs, replace(FILE, vehicle=PRESETS["thesis1992"]))
    for name in (*SURGE, *MOTOR[:3]):
        one = other.parameter(name)
        two = calibration.parameter(name)
        assert one.value == pytest.approx(two.value, abs=0.1 * two.std), name


def test_maxima_grow_to_what_the_logs_reach_and_not_by_noise():
    rows = episode().copy()
    commands = [INDEX["mission_speed"], INDEX["speed_command"]]

    def maxima():
        return larger_maxima(samples_of([log_of(rows)]), VEHICLE.vehicle)

    assert maxima() == {}
    rows[:, INDEX["port_voltage"]] = 1.04 * VEHICLE.vehicle.maximum_voltage
    rows[:, INDEX["speed"]] = 3.0
    assert maxima() == {}
    rows[:, commands] = 2.0
    assert maxima() == {"maximum_speed": 2.0}
    rows[:, commands] = np.nan
    assert maxima() == {"maximum_speed": 3.0}
