"""A vehicle as its logs show it: rows, channels and commands, and what two of them differ by."""

from dataclasses import replace

import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.parameters import PARAMETERS, PRESETS
from training.logged_vehicle import THESIS, LoggedVehicle, logged_rows

ONE_SHAFT = LoggedVehicle(
    PRESETS["remus100"],
    noise={"speed": 0.02},
    channels=("mission_speed", "speed", "port_voltage", "port_current", "port_rpm"),
    sample_rate=4.0,
    hidden=("acceleration_", "starboard_"),
)


def observations(n_samples=30, n_lanes=2):
    random = np.random.default_rng(0)
    shape = n_samples, n_lanes, len(CHANNELS)
    return random.uniform(0.1, 1.0, shape).astype(np.float32)


def test_a_log_of_everything_is_the_simulation_itself():
    simulated = observations()
    assert THESIS.as_logged(simulated) is simulated


@pytest.mark.parametrize(
    ("rate", "rows"), [(10.0, [0, 1, 2, 3]), (50.0, [0, 1, 2, 3]), (4.0, [0, 2]), (1.0, [0])]
)
def test_a_log_has_the_rows_of_its_rate(rate, rows):
    assert logged_rows(4, rate).tolist() == rows


def test_a_slow_log_has_readings_at_its_rows_only_and_holds_its_commands():
    simulated = observations()
    logged = ONE_SHAFT.as_logged(simulated)
    rows = logged_rows(len(simulated), 4.0)
    speed = logged[:, :, INDEX["speed"]]
    np.testing.assert_array_equal(speed[rows], simulated[rows, :, INDEX["speed"]])
    between = np.setdiff1d(np.arange(len(simulated)), rows)
    assert between.size and np.isnan(speed[between]).all()
    for absent in ("acceleration", "starboard_rpm"):
        assert np.isnan(logged[:, :, INDEX[absent]]).all()
    command = logged[:, :, INDEX["speed_command"]]
    np.testing.assert_array_equal(command[1], simulated[0, :, INDEX["speed_command"]])
    np.testing.assert_array_equal(command, logged[:, :, INDEX["mission_speed"]])
    assert (logged[:, :, INDEX["rudder"]] == 0.0).all()


def test_its_fleet_has_its_noise_and_band():
    wide = replace(THESIS, band={"alpha": 0.5}, noise={"speed": 0.05})
    healthy = []
    for vehicle in (THESIS, wide):
        fleet = vehicle.fleet(200, 0.0)
        fleet.reset(range(200))
        healthy.append(fleet.plan.healthy)
    names = list(PARAMETERS)
    ratio = healthy[1] / PRESETS["thesis1992"].alpha
    assert np.ptp(ratio[:, names.index("alpha")]) > 0.8
    assert (healthy[1][:, names.index("speed_noise")] == 0.05).all()
    assert (healthy[0][:, names.index("speed_noise")] == CHANNELS["speed"].noise).all()
    others = [k for k, name in enumerate(names) if name not in ("alpha", "speed_noise")]
    np.testing.assert_array_equal(healthy[0][:, others], healthy[1][:, others])


def test_its_fleet_has_the_chosen_imperfections_and_no_others():
    rpm = []
    for imperfections in (("resolution",), ("offsets",)):
        fleet = THESIS.fleet(4, 1.0, imperfections)
        rpm.append(fleet.reset(range(4))[:, INDEX["port_rpm"]])
    in_steps, continuous = rpm
    assert (in_steps == np.round(in_steps)).all()
    assert (continuous != np.round(continuous)).all()


def test_only_faults_that_the_logs_show_are_drawn_and_known_to_the_bank():
    assert "seal_friction:port" in ONE_SHAFT.faults
    assert not [fault for fault in ONE_SHAFT.faults if "starboard" in fault]
    assert "sensor_bias:acceleration" not in ONE_SHAFT.faults
    assert ONE_SHAFT.bank["faults"] == list(ONE_SHAFT.faults)
    assert THESIS.bank == {}


@pytest.mark.parametrize(
    "change",
    [
        {"noise": {"speed": 0.03}},
        {"band": {"alpha": 0.2}},
        {"sample_rate": 5.0},
        {"channels": ("speed",)},
        {"vehicle": replace(ONE_SHAFT.vehicle, alpha=-0.1)},
    ],
    ids=lambda change: next(iter(change)),
)
def test_another_vehicle_has_another_digest(change):
    assert replace(ONE_SHAFT, **change).digest != ONE_SHAFT.digest
    assert replace(ONE_SHAFT).digest == ONE_SHAFT.digest


def test_only_a_vehicle_with_both_sides_can_be_mirrored():
    assert THESIS.is_symmetric
    assert not ONE_SHAFT.is_symmetric
