"""The motor filter estimates the shafts' parameters on the simulated fleet, errors included."""

from dataclasses import replace

import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import follow_mission
from auv_fault_env.parameters import PARAMETERS, PRESETS
from auv_fault_env.schedules import FaultEvent
from diagnosers.motor_filter import MotorFilter

VEHICLE = PRESETS["thesis1992"]
# a mission that changes the speed
LEGS = tuple((6.0 * leg, (0.2, 0.45, 0.3, 0.55)[leg % 4]) for leg in range(20))
CHANGES = {
    "nominal": {},
    "resistance": {"port_resistance": 1.2},
    "torque_constant": {"port_torque_constant": 0.9},
    "coulomb_friction": {"port_coulomb_friction": 2.0},
    "propeller_torque": {"port_c1": 0.7, "port_c2": 0.7},
}
ESTIMATED = {
    "resistance": 1.2,
    "torque_constant": 0.9,
    "coulomb_friction": 2.0,
    "propeller_torque": 0.7,
}


def run(change=None, n_lanes=32, n_samples=600, schedule=()):
    """Observations (n_samples, n_lanes, n_channels) of vehicles with factors on parameters."""
    fleet = Fleet(n_lanes, healthy_band=0.0)
    rows = [fleet.reset(range(n_lanes), schedules=[schedule] * n_lanes, missions=[LEGS] * n_lanes)]
    healthy = fleet.plan.healthy.copy()
    for name, factor in (change or {}).items():
        healthy[:, list(PARAMETERS).index(name)] *= factor
    fleet.set_healthy(healthy)
    while len(rows) < n_samples:
        rows.append(fleet.step(follow_mission(rows[-1])))
    return np.array(rows, np.float64)


def follow(motors, observations):
    estimate = motors.initial(observations.shape[1])
    for observation in observations:
        estimate = motors.update(estimate, observation)
        yield estimate


@pytest.mark.parametrize("change", CHANGES)
def test_changed_parameters_are_found_within_their_uncertainty(change):
    *_, estimate = follow(MotorFilter(), run(CHANGES[change]))
    truth = np.ones((2, 4))
    if change in ESTIMATED:
        truth[0, MotorFilter.states.index(change)] = ESTIMATED[change]
    std = np.sqrt(np.einsum("lsii->lsi", estimate.covariance))
    assert (np.abs(estimate.mean.mean(axis=0) - truth) < std.mean(axis=0)).all()
    assert (np.abs(estimate.mean - truth) < 3 * std).mean() > 0.97
    assert std.max() < 0.2


def test_innovations_are_as_large_as_claimed():
    estimates = list(follow(MotorFilter(), run(n_lanes=64, n_samples=300)))
    innovation, variance = (
        np.array([getattr(e, name) for e in estimates])
        for name in ("innovation", "innovation_variance")
    )
    moving = innovation != 0.0
    nis = (innovation**2 / variance)[moving].mean()
    assert 0.7 < nis < 1.1  # below 1, because the random walk allows for faults that do not come


def test_a_fault_on_one_side_is_followed_within_ten_seconds_of_speed_changes():
    run_with_fault = run(
        schedule=(FaultEvent("seal_friction:starboard", 10.0, 0.5),), n_samples=300
    )
    *_, estimate = follow(MotorFilter(), run_with_fault)
    friction = MotorFilter.states.index("coulomb_friction")
    assert 1.7 < estimate.mean[:, 1, friction].mean() < 2.3  # severity 0.5 doubles it
    assert 0.9 < estimate.mean[:, 0, friction].mean() < 1.1


def test_at_standstill_nothing_is_learnt():
    rest = np.zeros((20, 3, len(CHANNELS)))
    *_, estimate = follow(MotorFilter(), rest)
    assert (estimate.mean == 1.0).all() and (estimate.innovation == 0.0).all()
    assert (estimate.innovation_variance > 0.0).all()


def test_update_is_pure_and_a_batch_is_its_lanes():
    observations = run(n_lanes=4, n_samples=50)
    motors = MotorFilter()
    *_, batch = follow(motors, observations)
    before = [values.copy() for values in batch]
    motors.update(batch, observations[0])
    assert all((now == then).all() for now, then in zip(batch, before, strict=True))
    for lane in range(4):
        *_, single = follow(motors, observations[:, [lane]])
        assert all((one[0] == many[lane]).all() for one, many in zip(single, batch, strict=True))


def test_hostile_readings_leave_estimates_finite():
    rng = np.random.default_rng(0)
    low, high = np.array([(channel.low, channel.high) for channel in CHANNELS.values()]).T
    for estimate in follow(MotorFilter(), rng.uniform(low, high, (300, 16, len(CHANNELS)))):
        assert all(np.isfinite(values).all() for values in estimate)
    assert (np.linalg.eigvalsh(estimate.covariance) > -1e-12).all()


@pytest.mark.parametrize(
    "settings", [dict(sensor_noise=0.0), dict(prior_std=(0, 1, 1, 1)), dict(walk_std=(-1, 1, 1, 1))]
)
def test_wrong_settings_are_refused(settings):
    with pytest.raises(ValueError, match="allowed"):
        MotorFilter(**settings)


def test_wrong_observations_are_refused():
    motors = MotorFilter(replace(VEHICLE, resistance=1.2))
    start = motors.initial(2)
    for wrong in (np.zeros((1, len(CHANNELS))), np.full((2, len(CHANNELS)), np.nan)):
        with pytest.raises(ValueError, match="observation"):
            motors.update(start, wrong)
