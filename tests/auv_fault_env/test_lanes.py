"""A lane is the same vehicle, bit for bit, in any fleet, block and thread; its disturbance is what
it claims.
"""

import math
import pickle

import numpy as np
import pytest

from auv_fault_env import FaultEvent, Fleet, Mission, layout
from auv_fault_env.channels import CHANNELS
from auv_fault_env.parameters import PRESETS
from auv_fault_env.truth import FleetTruth

EDGE = layout.LANES  # where one block of lanes ends and the next begins
LIMITS = np.array([[channel.low, channel.high] for channel in list(CHANNELS.values())[1:4]])


def actions_of(seeds, n_steps):
    """Random commands that change every second, some beyond the limits, (n_steps, n_lanes, 3)."""
    draws = np.stack(
        [np.random.default_rng(seed).uniform(-0.1, 1.1, (-(-n_steps // 10), 3)) for seed in seeds],
        axis=1,
    )
    return np.repeat(LIMITS[:, 0] + draws * (LIMITS[:, 1] - LIMITS[:, 0]), 10, axis=0)[:n_steps]


def history(seeds, n_steps, parallel=False, keep=slice(None)):
    """Observations and outcomes of the lanes `keep`, (n_steps + 1, n_kept, n_channels) and
    (n_steps, n_kept, 4).
    """
    fleet = Fleet(len(seeds), parallel=parallel)
    if parallel and fleet.table.shape[0] > 1:
        middle = fleet.table.shape[0] // 2
        last = fleet.table.shape[0]
        fleet._block_ranges = [(0, middle), (middle, last)]  # two threads even on one core
    observations = [fleet.reset(seeds=seeds)[keep].copy()]
    outcomes = []
    for actions in actions_of(seeds, n_steps):
        observations.append(fleet.step(actions)[keep].copy())
        outcomes.append(fleet.outcomes.T[keep].copy())
    return np.array(observations), np.array(outcomes)


def same(one, two):
    return all(np.array_equal(a, b) for a, b in zip(one, two, strict=True))


def test_serial_equals_parallel():
    seeds = range(777)
    assert same(history(seeds, 120, parallel=False), history(seeds, 120, parallel=True))


def test_lane_of_a_thousand_equals_a_fleet_of_one():
    seeds = [7919 * k % 10_007 for k in range(1000)]
    picked = [0, 1, EDGE - 1, EDGE, EDGE + 1, 2 * EDGE - 1, 2 * EDGE, 3 * EDGE, 895, 998, 999]
    observations, outcomes = history(seeds, 700, parallel=True, keep=picked)
    assert np.isfinite(observations).all() and np.isfinite(outcomes).all()
    for column, lane in enumerate(picked):
        alone = history([seeds[lane]], 700)
        assert same((observations[:, [column]], outcomes[:, [column]]), alone), f"lane {lane}"


@pytest.mark.parametrize("n_lanes", [1, EDGE - 1, EDGE, EDGE + 1, 2 * EDGE + 1])
@pytest.mark.parametrize("parallel", [False, True])
def test_fleets_that_fill_their_blocks_or_not(n_lanes, parallel):
    whole = history(range(2 * EDGE + 2), 50, keep=slice(n_lanes))
    assert same(history(range(n_lanes), 50, parallel=parallel), whole)


def test_later_episode_is_the_same_alone_and_in_a_fleet():
    def second_episode(seeds, lane):
        fleet = Fleet(len(seeds))
        fleet.reset(seeds=seeds)
        for actions in actions_of(seeds, 30):
            fleet.step(actions)
        fleet.reset(lanes=np.array([lane]))
        return np.array([fleet.step(actions)[lane] for actions in actions_of(seeds, 300)])

    assert np.array_equal(second_episode(range(EDGE + 30), EDGE + 7), second_episode([EDGE + 7], 0))


@pytest.mark.parametrize("factor", [1.0, 3.0])
def test_disturbance_has_the_stated_deviation_and_correlation_time(factor):
    vehicle = PRESETS["thesis1992"]
    n_lanes = 4096
    n_steps = 101
    fleet = Fleet(n_lanes, disturbance=factor)
    pushes = []
    fleet.reset(seeds=range(n_lanes), schedules=[()] * n_lanes)
    for actions in np.zeros((n_steps, n_lanes, 3)):
        pushes.append(fleet.table[:, layout.DISTURBANCE].ravel().copy())
        fleet.step(actions)
    pushes = np.array(pushes)
    std = factor * vehicle.disturbance_std
    # stationary from the start
    assert np.abs(pushes.std(axis=1) / std - 1).max() < 5 / math.sqrt(2 * n_lanes)
    assert np.abs(pushes.mean(axis=1)).max() < 5 * std / math.sqrt(n_lanes)
    for lag in (1, 10, 50, 100):
        product = np.mean(pushes[lag:] * pushes[:-lag]) / std**2
        assert product == pytest.approx(math.exp(-0.1 * lag / vehicle.disturbance_time), abs=0.06)


def test_no_disturbance_if_switched_off():
    fleet = Fleet(3, disturbance=0.0)
    fleet.reset(seeds=range(3))
    fleet.step(np.zeros((3, 3)))
    assert not fleet.table[:, layout.DISTURBANCE].any()


def test_resetting_a_lane_leaves_the_truth_of_the_others_alone():
    fleet = Fleet(2)
    fleet.reset([1, 2], schedules=[(), (FaultEvent("increased_drag", 1.0, 0.5),)])
    for _ in range(10):
        fleet.step(np.zeros((2, 3)))
    before = FleetTruth(fleet)["parameters"]["alpha"][1]
    fleet.reset(lanes=np.array([0]))
    assert (
        FleetTruth(fleet)["label"][1] == "normal"
        and FleetTruth(fleet)["parameters"]["alpha"][1] == before
    )
    fleet.step(np.zeros((2, 3)))
    assert FleetTruth(fleet)["label"][1] == "increased_drag"


def test_a_fleet_can_be_copied_after_a_step_in_parallel():
    fleet = Fleet(600, parallel=True)
    fleet.reset(range(600))
    fleet.step(np.zeros((600, 3)))
    twin = pickle.loads(pickle.dumps(fleet))
    assert np.array_equal(fleet.step(np.full((600, 3), 0.2)), twin.step(np.full((600, 3), 0.2)))


def test_a_fleet_is_reset_before_it_steps():
    with pytest.raises(ValueError, match="call reset"):
        Fleet(1).step(np.zeros((1, 3)))


def test_the_steady_start_stays_within_supply_and_command():
    schedule = tuple(
        FaultEvent(f"propeller_loss:{side}", 0.0, 0.98) for side in ("port", "starboard")
    )
    fleet = Fleet(1, sensor_noise=0.0)
    observation = dict(
        zip(
            CHANNELS,
            fleet.reset([1], schedules=[schedule], missions=[Mission(((0.0, 1.0),))])[0],
            strict=True,
        )
    )
    assert observation["port_voltage"] <= 24.0 and observation["port_rpm"] <= 1500.0
