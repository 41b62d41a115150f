"""A vehicle with one shaft: that of port, with all the thrust; nothing of starboard exists."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from auv_fault_env import CATALOGUE, CHANNELS, PRESETS, Fleet, ScheduleSampler
from auv_fault_env.channels import INDEX
from auv_fault_env.errors import InputError
from auv_fault_env.missions import follow_mission
from auv_fault_env.parameters import PARAMETERS, nominal
from auv_fault_env.truth import FleetTruth

ID = "auv_fault_env/Propulsion-v0"
TWO = PRESETS["thesis1992"]
ONE = replace(TWO, shafts=1)
STARBOARD = [INDEX[name] for name in CHANNELS if name.startswith("starboard")]
HEALTHY = dict(schedules=[()])


def rollout(fleet, n_steps=200, **plan):
    rows = [fleet.reset(range(fleet.n_lanes), **plan)]
    for _ in range(n_steps):
        rows.append(fleet.step(follow_mission(rows[-1])))
    return np.array(rows)


@pytest.mark.parametrize("realism", [0.0, 1.0])
def test_starboard_readings_are_zero_and_those_of_port_are_not(realism):
    rows = rollout(Fleet(4, ONE, realism=realism), schedules=[()] * 4, missions=[0.4] * 4)
    assert not rows[:, :, STARBOARD].any()
    port = rows[20:, :, [INDEX[name] for name in ("port_voltage", "port_current", "port_rpm")]]
    assert (port > 0.0).all()


def test_beta_is_the_thrust_of_all_shafts():
    one, two = (nominal(vehicle) for vehicle in (ONE, TWO))
    assert one["port_beta"] == two["port_beta"] + two["starboard_beta"] == TWO.beta
    assert one["starboard_beta"] == 0.0
    quiet = dict(sensor_noise=0.0, disturbance=0.0, healthy_band=0.0)
    rows = [rollout(Fleet(1, v, **quiet), missions=[0.4], **HEALTHY) for v in (ONE, TWO)]
    np.testing.assert_allclose(*(row[:, :, INDEX["speed"]] for row in rows), rtol=1e-3)
    np.testing.assert_allclose(*(row[:, :, INDEX["port_rpm"]] for row in rows), rtol=1e-2)


def test_the_energy_is_that_of_one_motor():
    quiet = dict(sensor_noise=0.0, disturbance=0.0, healthy_band=0.0)
    energy = []
    for vehicle in (ONE, TWO):
        fleet = Fleet(1, vehicle, **quiet)
        rollout(fleet, missions=[0.4], **HEALTHY)
        energy.append(fleet.outcomes[1, 0])
    assert energy[0] == pytest.approx(energy[1] / 2, rel=1e-2) and energy[0] > 0.0


def test_no_fault_of_starboard_is_drawn_and_all_others_are():
    fleet = Fleet(2000, ONE)
    fleet.reset(range(2000))
    names = np.array(list(CATALOGUE))
    drawn = {str(name) for name in names[fleet.plan.fault[fleet.plan.fault >= 0]]}
    assert drawn == {name for name in CATALOGUE if "starboard" not in name}
    assert not any("starboard" in label for label in FleetTruth(fleet)["label"])


@pytest.mark.parametrize(
    "name", ["seal_friction:starboard", "sensor_bias:starboard_rpm", "worn_brushes:starboard"]
)
def test_a_fault_of_starboard_is_refused_by_name(name):
    env = gym.make(ID, preset=ONE, truth="full")
    event = {"fault": name, "onset": 1.0, "severity": 0.5}
    with pytest.raises(InputError, match=f"fault: got '{name}'; allowed is one of port"):
        env.reset(seed=1, options={"schedule": [event]})
    env.reset(seed=1, options={"schedule": []})
    with pytest.raises(InputError, match=name):
        env.unwrapped.fleet.replan(schedules=[[event]])
    gym.make(ID).reset(seed=1, options={"schedule": [event]})


@pytest.mark.parametrize("name", ["increased_drag", "seal_friction:port", "fouled_propellers"])
def test_faults_of_what_exists_are_taken(name):
    event = {"fault": name, "onset": 1.0, "severity": 0.5}
    env = gym.make(ID, preset=ONE, truth="full")
    env.reset(seed=1, options={"schedule": [event]})
    for _ in range(15):
        *_, info = env.step([0.4, 0.0, 0.0])
    assert info["truth"]["label"] != "normal"


def test_a_prior_without_a_possible_fault_is_refused():
    only_starboard = ScheduleSampler(prior={"seal_friction:starboard": 1.0})
    Fleet(1, schedules=only_starboard).reset([1])
    with pytest.raises(InputError, match=r"prior.*weigh a class of port"):
        Fleet(1, ONE, schedules=only_starboard).reset([1])


@pytest.mark.parametrize("shafts", [0, 3, 1.0, True, "1", None])
def test_other_numbers_of_shafts_are_refused(shafts):
    with pytest.raises(InputError, match=r"shafts: .*allowed is 1 or 2"):
        replace(TWO, shafts=shafts)


# the action is a speed in m/s, which may exceed 1
@pytest.mark.filterwarnings("ignore:.*symmetric and normalized")
@pytest.mark.parametrize("preset", [name for name in PRESETS if PRESETS[name].shafts == 1])
@pytest.mark.parametrize("realism", [0.0, 1.0])
def test_the_environment_passes_the_checker(preset, realism):
    env = gym.make(ID, preset=preset, realism=realism)
    check_env(env.unwrapped, skip_render_check=True)
    assert env.observation_space.shape == (len(CHANNELS),)


def test_a_frame_shows_one_propeller_on_the_centre_line():
    env = gym.make(ID, preset="remus100", render_mode="rgb_array")
    env.reset(seed=1, options={"schedule": [], "mission": 1.0})
    one = env.render()
    env = gym.make(ID, render_mode="rgb_array")
    env.reset(seed=1, options={"schedule": [], "mission": 1.0})
    assert one.std() > 5.0 and (one != env.render()).any()


def test_a_lane_of_a_batch_is_the_single_environment():
    vector = gym.make_vec(ID, num_envs=3, vectorization_mode="vector_entry_point", preset=ONE)
    many, _ = vector.reset(seed=5)
    single = gym.make(ID, preset=ONE, truth="full")
    one, _ = single.reset(seed=6)
    for _ in range(50):
        np.testing.assert_array_equal(many[1], one)
        many, *_ = vector.step(follow_mission(many))
        one, *_ = single.step(follow_mission(one[None])[0])


def test_the_truth_has_no_starboard_thrust_and_state():
    _, info = gym.make(ID, preset="remus100", truth="full").reset(seed=3, options={"schedule": []})
    assert info["truth"]["parameters"]["starboard_beta"] == 0.0
    state = info["truth"]["state"]
    assert not any(state[f"starboard_{name}"] for name in ("voltage", "current", "rpm"))
    assert set(info["truth"]["parameters"]) == set(PARAMETERS)
