"""The residuals are zero on the nominal vehicle, as noisy as they say, and of a fault's physical
size under it.
"""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS
from auv_fault_env.faults import CATALOGUE
from auv_fault_env.fleet import Fleet
from auv_fault_env.parameters import PRESETS
from auv_fault_env.schedules import FaultEvent
from diagnosers.symptoms.residuals import RESIDUALS, residuals
from training.rollouts import roll_out

VEHICLE = PRESETS["thesis1992"]
COLUMN = {name: index for index, name in enumerate(CHANNELS)}
MOVED = {  # residuals that each kind of fault enters; the others must stay
    "increased_drag": {"surge"},
    "decreased_drag": {"surge"},
    "propeller_damage:port": {"port_torque", "surge"},
    "propeller_loss:port": {"port_torque", "surge"},
    "seal_friction:starboard": {"starboard_torque"},
    "motor_overheating:starboard": {"starboard_voltage", "starboard_torque"},
    "sensor_bias:speed": {"port_torque", "starboard_torque", "surge"},
    "sensor_bias:acceleration": {"surge"},
    "sensor_bias:port_voltage": {"port_voltage"},
    "sensor_scale:port_current": {"port_voltage", "port_torque"},
    "sensor_bias:starboard_rpm": {"starboard_voltage", "starboard_torque", "surge"},
}


def run(n_lanes=64, n_samples=150, schedule=(), mission="thesis", **scales):
    """Observations (n_samples, n_lanes, n_channels) of nominal vehicles."""
    fleet = Fleet(n_lanes, **{"disturbance": 0.0, "healthy_band": 0.0, **scales})
    rollout = roll_out(
        fleet, range(n_lanes), n_samples, None, [schedule] * n_lanes, [mission] * n_lanes
    )
    return rollout.observations.astype(np.float64)


def normalised(observations):
    """(n_samples - 1, n_lanes, 5)."""
    pairs = itertools.pairwise(observations)
    return np.array(
        [(found := residuals(one, two, VEHICLE)).values / found.std for one, two in pairs]
    )


def test_noise_gives_zero_mean_and_the_standard_deviation_that_is_claimed():
    observations = run(256, 300)
    z = normalised(observations)
    turning = observations[1:, :, [COLUMN["port_rpm"], COLUMN["starboard_rpm"]]].min(axis=2) > 20.0
    assert turning.mean() > 0.5
    assert np.abs(z[turning].mean(axis=0)).max() < 0.03
    np.testing.assert_allclose(z[turning].std(axis=0), 1.0, atol=0.03)


@pytest.mark.parametrize("mission", ["thesis", "acceleration"])
def test_without_noise_nothing_is_left_but_the_shafts_transients(mission):
    observations = run(1, 300, mission=mission, sensor_noise=0.0)
    assert np.abs(normalised(observations)).max() < 0.5


@pytest.mark.parametrize("fault", MOVED)
def test_a_fault_moves_its_residuals_and_no_others(fault):
    assert fault in CATALOGUE
    z = normalised(run(1, 100, (FaultEvent(fault, 5.0, 1.0),), mission=0.45, sensor_noise=0.0))[
        -20:, 0
    ].mean(axis=0)
    assert {name for name, value in zip(RESIDUALS, z, strict=True) if abs(value) > 0.2} == MOVED[
        fault
    ]


@pytest.mark.parametrize(
    ("fault", "residual", "size"),
    [
        ("sensor_bias:port_voltage", "port_voltage", lambda row: 1.0),  # V, faults.BIAS
        ("sensor_bias:acceleration", "surge", lambda row: 0.03),  # m/s^2, faults.BIAS
        ("motor_overheating:port", "port_voltage", lambda row: 0.4 * 1.01 * row["port_current"]
         - 0.2 * VEHICLE.torque_constant * row["port_rpm"] * np.pi / 30),
        ("increased_drag", "surge", lambda row: VEHICLE.alpha * row["speed"] ** 2),
        ("propeller_loss:port", "surge", lambda row: -0.5 * VEHICLE.beta * row["port_rpm"] ** 2),
        ("seal_friction:port", "port_torque", lambda row: 2 * VEHICLE.coulomb_friction
         + 2e-4 * row["port_rpm"] * np.pi / 30),
    ],
)  # fmt: skip
def test_a_residual_is_as_large_as_the_fault(fault, residual, size):
    observations = run(1, 100, (FaultEvent(fault, 5.0, 1.0),), mission=0.45, sensor_noise=0.0)
    got = residuals(observations[-2], observations[-1], VEHICLE).values[
        0, RESIDUALS.index(residual)
    ]
    assert got == pytest.approx(
        size(dict(zip(CHANNELS, observations[-1, 0], strict=True))), rel=0.02
    )


def test_friction_holds_a_standing_shaft_up_to_its_torque():
    at_rest = np.zeros((2, len(CHANNELS)))
    at_rest[:, COLUMN["port_current"]] = (
        np.array([0.5, 1.5]) * VEHICLE.coulomb_friction / VEHICLE.torque_constant
    )
    torque = residuals(at_rest, at_rest, VEHICLE).values[:, RESIDUALS.index("port_torque")]
    np.testing.assert_allclose(torque, [0.0, 0.5 * VEHICLE.coulomb_friction], atol=1e-12)


def test_batch_is_lanes_one_by_one_and_inputs_stay():
    observations = run(5, 20, mission="acceleration")
    before = observations.copy()
    batch = residuals(observations[-2], observations[-1], VEHICLE)
    assert (observations == before).all()
    for lane in range(5):
        single = residuals(observations[-2, [lane]], observations[-1, [lane]], VEHICLE)
        assert all((one[0] == many[lane]).all() for one, many in zip(single, batch, strict=True))


def test_the_vehicle_is_the_one_that_is_given():
    observations = run(1, 5, sensor_noise=0.0)
    other = replace(VEHICLE, resistance=2 * VEHICLE.resistance)
    moved = (
        residuals(observations[-2], observations[-1], other).values
        - residuals(*observations[-2:], VEHICLE).values
    )
    current = observations[-1, 0, COLUMN["port_current"]]
    assert moved[0, 0] == pytest.approx(-VEHICLE.resistance * current, rel=1e-6)


def test_wrong_shapes_are_refused():
    good = np.zeros((2, len(CHANNELS)))
    for pair in ((good, good[:1]), (good, good[:, 1:]), (good[0], good[0])):
        with pytest.raises(ValueError, match="shapes of observations"):
            residuals(*pair, VEHICLE)
