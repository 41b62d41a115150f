"""The presets: their published cruise, and the ranges that follow from a vehicle's limits."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest

from auv_fault_env import CHANNELS, PRESETS, Fleet, MissionSampler
from auv_fault_env.errors import InputError
from auv_fault_env.missions import follow_mission
from auv_fault_env.parameters import channels_of
from auv_fault_env.realism import EFFECTS, IMPERFECTIONS, conversion
from auv_fault_env.truth import FleetTruth

ID = "auv_fault_env/Propulsion-v0"
QUIET = dict(sensor_noise=0.0, disturbance=0.0, healthy_band=0.0)
TWO_SHAFTS = ("thesis1992", "npsnet1995")
# published speed [m/s], published shaft speed [rpm], tolerance: see docs/vehicle.md
CRUISE = {
    "remus100": (1.51, 1500.0, 0.03),
    "torpedo_1hz": (1.0, 300.0, 0.07),
}
# sum of the rewards, and mission speed and readings, after 300 samples of seed 11
GOLDEN = {
    "thesis1992": (
        -11.29917234,
        [0.530887, 0.495801, 0.000358772, 3.9007, 0.612857, 511.151, 3.67696, 0.396454, 512.142],
    ),
    "npsnet1995": (
        -12.73666119,
        [0.530887, 0.494202, 2.27824e-5, 5.15345, 0.953105, 653.795, 4.76558, 0.566384, 655.773],
    ),
}


def steady_state(preset, speed, n_steps=600):
    """The noise-free state after a minute at a commanded speed, by name."""
    fleet = Fleet(1, preset, **QUIET)
    row = fleet.reset([0], schedules=[()], missions=[speed])
    for _ in range(n_steps):
        row = fleet.step(follow_mission(row))
    return {name: float(value[0]) for name, value in FleetTruth(fleet)["state"].items()}


@pytest.mark.parametrize("preset", GOLDEN)
def test_vehicles_with_two_shafts_are_what_they_were(preset):
    fleet = Fleet(1, preset)
    row = fleet.reset([11])
    total = 0.0
    for _ in range(300):
        row = fleet.step(follow_mission(row))
        total += fleet.outcomes[0, 0]
    reward, last = GOLDEN[preset]
    assert total == pytest.approx(reward, rel=1e-8)
    mission_speed_and_readings = row[0, [0, *range(4, 12)]]
    np.testing.assert_allclose(mission_speed_and_readings, last, rtol=2e-5, atol=1e-7)


@pytest.mark.parametrize("preset", CRUISE)
def test_the_published_cruise_speed_is_reached_at_the_published_shaft_speed(preset):
    speed, rpm, tolerance = CRUISE[preset]
    state = steady_state(preset, min(speed, PRESETS[preset].maximum_speed))
    assert state["speed"] == pytest.approx(speed, rel=tolerance)
    at_published_rpm = state["speed"] * rpm / state["port_rpm"]
    assert at_published_rpm == pytest.approx(speed, rel=tolerance)


@pytest.mark.parametrize("preset", PRESETS)
def test_the_largest_speed_command_is_within_reach(preset):
    vehicle = PRESETS[preset]
    state = steady_state(preset, vehicle.maximum_speed)
    assert state["speed"] == pytest.approx(vehicle.maximum_speed, rel=0.02)
    assert state["port_rpm"] < vehicle.maximum_rpm
    assert state["port_voltage"] < 0.95 * vehicle.maximum_voltage
    assert state["port_current"] < 0.8 * vehicle.maximum_current


@pytest.mark.parametrize("preset", TWO_SHAFTS)
def test_the_first_presets_have_the_ranges_of_the_channels(preset):
    assert channels_of(PRESETS[preset]) == CHANNELS


def test_ranges_grow_with_the_largest_values_of_the_vehicle():
    vehicle = replace(
        PRESETS["thesis1992"],
        maximum_speed=2.0,
        maximum_rpm=4500.0,
        maximum_voltage=96.0,
        maximum_current=50.0,
    )
    grown = channels_of(vehicle)
    factors = {"m/s": 2.0, "rpm": 3.0, "V": 4.0, "A": 2.0}
    for name, channel in CHANNELS.items():
        factor = factors.get(channel.unit, 1.0)
        ends = (factor * channel.low, factor * channel.high)
        assert (grown[name].low, grown[name].high) == pytest.approx(ends), name
        assert grown[name].noise == channel.noise
    env = gym.make(ID, preset=vehicle)
    assert env.action_space.high[0] == 2.0
    high = [channel.high for channel in grown.values()]
    np.testing.assert_array_equal(env.observation_space.high, np.float32(high))
    np.testing.assert_array_equal(env.unwrapped.fleet.limits[:, 1], high)


def test_a_converter_covers_the_range_of_the_vehicle():
    datum = IMPERFECTIONS["port_voltage"]
    for factor in (1.0, 2.0):
        found = conversion("port_voltage", 1.0, tuple(EFFECTS), factor)
        assert (found.high, found.step) == (factor * datum.high, factor * datum.step)
    fast = replace(PRESETS["thesis1992"], maximum_voltage=48.0, torque_constant=0.12)
    fleet = Fleet(1, fast, realism=1.0)
    row = fleet.reset([0], schedules=[()], missions=[1.0])
    for _ in range(100):
        row = fleet.step(follow_mission(row))
    assert fleet.limits[6, 1] == 60.0


def test_sampled_missions_are_shares_of_the_largest_speed():
    vehicle = replace(PRESETS["thesis1992"], maximum_speed=2.0)
    sampler = MissionSampler(speed=(0.25, 0.5))
    speeds = []
    for preset in ("thesis1992", vehicle):
        fleet = Fleet(50, preset, missions=sampler)
        fleet.reset(range(50))
        speeds.append(fleet.plan.legs[:, :, 1])
    np.testing.assert_allclose(speeds[1], 2.0 * speeds[0])
    assert speeds[1].min() >= 0.5 and speeds[1].max() <= 1.0


def test_a_mission_beyond_the_vehicle_is_refused_and_one_within_is_taken():
    fast = gym.make(ID, preset="remus100")
    fast.reset(seed=1, options={"mission": 1.4, "schedule": []})
    with pytest.raises(InputError, match=r"mission speed: got 1.6; .* 0 to 1.5"):
        fast.reset(seed=1, options={"mission": 1.6})
    with pytest.raises(InputError, match=r"mission speed: got 1.4; .* 0 to 1;"):
        gym.make(ID).reset(seed=1, options={"mission": 1.4})


def test_commands_are_clipped_at_the_largest_speed():
    env = gym.make(ID, preset="remus100")
    env.reset(seed=1, options={"mission": 1.4, "schedule": []})
    observation, *_ = env.unwrapped.step([9.0, 0.0, 0.0])
    assert observation[1] == np.float32(1.5)
