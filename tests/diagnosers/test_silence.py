"""The Gaussian bank with silent readings, one shaft, other noise and coarse readings."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS, READINGS
from auv_fault_env.errors import InputError
from auv_fault_env.faults import CATALOGUE, classes
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS, follow_mission
from auv_fault_env.parameters import PARAMETERS, PRESETS, SHAFT
from auv_fault_env.schedules import FaultEvent
from diagnosers import load
from diagnosers.gaussian_bank import GaussianBank
from training.rollouts import roll_out

CLASSES = list(classes())
NAMES = list(CHANNELS)


@cache
def observations(fault: str | None = None, n_samples: int = 300) -> np.ndarray:
    """One lane, (n_samples, 1, n_channels); the fault begins at 5 s."""
    schedule = (FaultEvent(fault, 5.0, 0.8),) if fault else ()
    rolled = roll_out(Fleet(1), [3], n_samples, schedules=[schedule], missions=[MISSIONS["thesis"]])
    return rolled.observations.astype(np.float64)


def log_probability(bank: GaussianBank, rows: np.ndarray) -> np.ndarray:
    """(n_samples, n_classes)."""
    bank.reset(1)
    return np.concatenate([bank.update(row).log_probability for row in rows])


def silenced(rows: np.ndarray, *channels: str) -> np.ndarray:
    rows = rows.copy()
    rows[:, :, [NAMES.index(name) for name in channels]] = np.nan
    return rows


def test_silent_readings_change_nothing_but_the_age():
    normal = log_probability(GaussianBank(), silenced(observations()[:50], *READINGS))[:, 0]
    np.testing.assert_allclose(normal, np.arange(1, 51) * np.log(1.0 - 1e-3), rtol=1e-9)


@pytest.mark.parametrize("channel", READINGS)
def test_a_silent_reading_is_no_sensor_fault(channel):
    rows = silenced(observations()[:100], channel)
    belief = log_probability(GaussianBank(), rows)
    assert belief[-1, 0] > np.log(0.5)
    # the hazard of ten seconds, and no more
    assert np.exp(belief[-1, CLASSES.index(f"sensor:{channel}")]) < 0.02


def test_a_reading_in_ten_detects_a_fault():
    rows = observations("seal_friction:port").copy()
    rows[np.arange(len(rows)) % 10 != 0, :, 4:] = np.nan
    belief = log_probability(GaussianBank(), rows)
    assert CLASSES[belief[-1].argmax()] == "seal_friction:port"
    assert belief[50, 0] > np.log(0.9) and belief[-1, 0] < -20.0


def test_between_two_readings_the_voltage_is_the_last_one():
    """Voltages a second apart and no shaft speed: the currents of healthy motors fit."""
    rows = silenced(observations()[:100], "port_rpm", "starboard_rpm")
    quiet = np.arange(len(rows)) % 10 != 0
    rows[quiet] = silenced(rows[quiet], "port_voltage", "starboard_voltage")
    assert log_probability(GaussianBank(), rows)[-1, 0] > np.log(0.9)
    rows[60:, :, NAMES.index("port_current")] += 0.3
    assert log_probability(GaussianBank(), rows)[-1, 0] < -10.0


def test_without_rpm_and_acceleration_a_lost_propeller_is_found():
    missing = "port_rpm", "starboard_rpm", "acceleration"
    possible = tuple(name for name in CATALOGUE if not name.endswith(missing))
    rows = silenced(observations("propeller_loss:starboard"), *missing)
    belief = log_probability(GaussianBank(faults=possible), rows)
    assert CLASSES[belief[-1].argmax()] == "propeller_loss:starboard"
    assert belief[-1, 0] < -10.0


def test_one_shaft_has_all_the_thrust():
    bank = GaussianBank(shafts=1)
    names = list(PARAMETERS)
    healthy = bank.healthy
    assert healthy[names.index("port_beta")] == PRESETS["thesis1992"].beta
    assert healthy[names.index("starboard_beta")] == 0.0
    starboard = [name for name in NAMES if name.startswith("starboard")]
    rows = silenced(observations(), *starboard)
    own = tuple(name for name in CATALOGUE if "starboard" not in name)
    assert log_probability(GaussianBank(shafts=1, faults=own), rows)[-1, 0] > np.log(0.9)
    # half of the thrust would be missing
    assert log_probability(GaussianBank(faults=own), rows)[-1, 0] < np.log(0.5)


def test_the_shafts_are_those_of_the_vehicle():
    one = replace(PRESETS["thesis1992"], shafts=1)
    bank = GaussianBank(one)
    assert bank.fault_names == tuple(name for name in CATALOGUE if "starboard" not in name)
    # readings of a shaft that does not exist are not used, whatever they are
    rows = observations("seal_friction:port")[:150]
    told = log_probability(GaussianBank(shafts=1, faults=bank.fault_names), rows)
    np.testing.assert_array_equal(log_probability(bank, rows), told)
    starboard = [name for name in NAMES if name.startswith("starboard")]
    np.testing.assert_array_equal(log_probability(bank, silenced(rows, *starboard)), told)
    np.testing.assert_array_equal(
        log_probability(GaussianBank(one, shafts=2), rows),
        log_probability(GaussianBank(), rows),
    )
    assert GaussianBank(one).healthy[list(PARAMETERS).index("port_beta")] == one.beta


def test_settings_at_their_defaults_change_nothing():
    bands = {name: PARAMETERS[f"port_{name}"].band for name in SHAFT} | {
        "alpha": PARAMETERS["alpha"].band
    }
    noise = {name: CHANNELS[name].noise for name in READINGS}
    rows = observations("sensor_stuck:speed", 100)
    same = GaussianBank(band=bands, noise=noise, resolution=dict.fromkeys(READINGS, 0.0), shafts=2)
    np.testing.assert_array_equal(
        log_probability(same, rows), log_probability(GaussianBank(), rows)
    )


@pytest.mark.parametrize("name", ["beta", "resistance", "coulomb_friction"])
def test_a_wider_band_makes_an_unusual_vehicle_normal(name):
    """A vehicle 40 % off nominal in one parameter."""
    fleet = Fleet(1, healthy_band=0.0)
    row = fleet.reset([3], schedules=[()], missions=[MISSIONS["thesis"]])
    healthy = fleet.plan.healthy.copy()
    healthy[:, [list(PARAMETERS).index(f"{side}_{name}") for side in ("port", "starboard")]] *= 1.4
    fleet.set_healthy(healthy)
    rows = [row := fleet.step(follow_mission(row)) for _ in range(300)]
    narrow, wide = (
        log_probability(GaussianBank(band={name: width}), rows)[-1, 0] for width in (0.01, 0.6)
    )
    assert wide > narrow + 3.0


def test_more_noise_is_normal_where_it_is_a_setting():
    rows = observations()[:100].copy()
    rows[:, :, NAMES.index("port_current")] += 0.15 * np.random.default_rng(2).normal(size=(100, 1))
    assert log_probability(GaussianBank(), rows)[-1, 0] < -10.0
    assert log_probability(GaussianBank(noise={"port_current": 0.152}), rows)[-1, 0] > np.log(0.5)


def test_repeated_values_of_a_coarse_sensor_are_not_stuck():
    rows = observations()[:100].copy()
    column = NAMES.index("port_rpm")
    rows[:, :, column] = rows[:, :, column].round()
    assert log_probability(GaussianBank(), rows)[-1, 0] < -10.0
    assert log_probability(GaussianBank(resolution={"port_rpm": 1.0}), rows)[-1, 0] > np.log(0.5)


def test_it_is_stored_with_its_settings(tmp_path):
    bank = GaussianBank(
        PRESETS["npsnet1995"],
        band={"alpha": 0.1},
        noise={"speed": 0.02},
        resolution={"speed": 0.01},
    )
    bank.save(tmp_path / "bank.safetensors")
    assert load(tmp_path / "bank.safetensors") == bank
    assert json.dumps(bank.settings())


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"band": {"aplha": 0.1}}, "did you mean 'alpha'"),
        ({"band": {"alpha": 1.5}}, "healthy band of alpha"),
        ({"noise": {"speed": 0.0}}, "noise of speed"),
        ({"noise": {"rudder": 0.1}}, "reading"),
        ({"resolution": {"speed": -1.0}}, "resolution of speed"),
        ({"shafts": 3}, "shafts"),
    ],
)
def test_a_setting_out_of_range_is_refused(settings, words):
    with pytest.raises(InputError, match=words):
        GaussianBank(**settings)
