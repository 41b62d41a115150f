"""Charged fins and residual actions: what an agent can learn from."""

import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env

from auv_fault_env.channels import INDEX
from auv_fault_env.env import PropulsionEnv, PropulsionVectorEnv
from auv_fault_env.errors import InputError
from auv_fault_env.missions import follow_mission

NAME = "auv_fault_env/Propulsion-v0"
LEARNT = {"action": "residual", "reward_weights": {"deflection": 0.1}}


def test_both_checkers_pass_without_a_warning():
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check_env(gym.make(NAME, **LEARNT).unwrapped, skip_render_check=True)
        checker.check_env(gym.make(NAME, **LEARNT))
    assert not caught, [str(one.message) for one in caught]


def test_the_reward_is_the_documented_formula():
    weights = {"speed": 2.0, "energy": 0.5, "deflection": 0.3}
    env = PropulsionEnv(reward_weights=weights, truth="full")
    env.reset(seed=3)
    for rudder in (0.0, 0.3, 5.0):
        _, reward, _, _, info = env.step([0.4, rudder, -0.1])
        deviation = info["truth"]["state"]["speed"] - info["mission_speed"]
        squared = min(rudder, 0.4) ** 2 + 0.1**2  # commands are clipped
        expected = -2.0 * deviation**2 - 0.5 * info["energy"] - 0.3 * squared
        assert reward == pytest.approx(expected, rel=1e-12) and type(reward) is float


def test_no_weights_are_the_reward_of_the_version_bit_for_bit():
    usual, given = (
        PropulsionVectorEnv(5, reward_weights=weights)
        for weights in (None, {"speed": 1.0, "energy": 0.01, "deflection": 0.0})
    )
    for env in (usual, given):
        env.reset(seed=1)
    for _ in range(50):
        actions = np.full((5, 3), 0.4)
        assert usual.step(actions)[1].tobytes() == given.step(actions)[1].tobytes()


def total(policy, **settings):
    """Mean sum of rewards over an episode of 64 healthy vehicles that slow down now and then."""
    env = PropulsionVectorEnv(64, truth=False, **settings)
    mission = [(0.0, 0.6), (10.0, 0.2), (25.0, 0.6), (40.0, 0.2)]
    observation, _ = env.reset(seed=3, options={"schedule": [], "mission": mission})
    rewards = []
    for _ in range(599):
        observation, reward, *_ = env.step(policy(observation))
        rewards.append(reward)
    return np.sum(rewards, axis=0).mean()


def braking(observation):
    """The mission speed, and fins in proportion to a speed that is too high."""
    actions = follow_mission(observation)
    excess = observation[:, INDEX["speed"]] - observation[:, INDEX["mission_speed"]]
    actions[:, 1:] = np.clip(4.0 * excess, 0.0, 0.4)[:, None]
    return actions


@pytest.mark.parametrize("preset", ["thesis1992", "remus100"])
def test_braking_with_the_fins_pays_only_where_they_are_free(preset):
    free, charged = ({"preset": preset}, {"preset": preset, "reward_weights": {"deflection": 0.1}})
    assert total(braking, **free) > total(follow_mission, **free)
    assert total(braking, **charged) < total(follow_mission, **charged)
    assert total(follow_mission, **charged) == pytest.approx(total(follow_mission, **free))


def test_no_residual_follows_the_mission():
    followed = total(follow_mission)
    residual = total(lambda observation: np.zeros((64, 3)), action="residual")
    assert residual == pytest.approx(followed, rel=1e-6)


@pytest.mark.parametrize("preset", ["thesis1992", "remus100"])
def test_a_residual_is_a_share_of_the_vehicle_s_range_and_clipped(preset):
    env = PropulsionEnv(preset=preset, action="residual")
    assert env.action_space == gym.spaces.Box(-1.0, 1.0, (3,), np.float32)
    largest = env.fleet.vehicle.maximum_speed
    env.reset(seed=1, options={"mission": 0.5 * largest})
    for residual, speed, rudder in ((1.0, 0.75, 0.4), (-0.5, 0.375, -0.2), (-9.0, 0.25, -0.4)):
        observation, *_ = env.step([residual, residual, 0.0])
        assert observation[1:4] == pytest.approx([speed * largest, rudder, 0.0])
    env.reset(options={"mission": 0.9 * largest})
    assert env.step([1.0, 0.0, 0.0])[0][1] == pytest.approx(largest)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_lanes_are_the_single_environments(mode):
    many = PropulsionVectorEnv(3, 5, autoreset_mode=mode, **LEARNT)
    make = lambda: gym.make(NAME, max_episode_steps=5, **LEARNT)  # noqa: E731
    singles = gym.vector.SyncVectorEnv([make] * 3, autoreset_mode=mode)
    ours, _ = many.reset(seed=1)
    theirs, _ = singles.reset(seed=1)
    random = np.random.default_rng(0)
    for _ in range(14):
        assert ours.tobytes() == theirs.tobytes()
        actions = random.uniform(-1.0, 1.0, (3, 3)).astype(np.float32)
        ours, *results, _ = many.step(actions)
        theirs, *expected, _ = singles.step(actions)
        for values, same in zip(results, expected, strict=True):
            assert values.tolist() == same.tolist()


def test_the_spec_keeps_both_through_json():
    for make, again in ((gym.make, gym.make), (gym.make_vec, gym.make_vec)):
        env = again(EnvSpec.from_json(make(NAME, **LEARNT).spec.to_json()))
        env.reset(seed=1)
        action = np.ones(env.action_space.shape, np.float32)
        assert np.all(env.step(action)[1] < -0.1 * 2 * 0.16)


WRONG = {
    "kind": ({"action": "resdual"}, "action: got 'resdual'.*did you mean 'residual'"),
    "name": ({"reward_weights": {"rudder": 1.0}}, "reward weight: got 'rudder'"),
    "sign": ({"reward_weights": {"energy": -1.0}}, "reward weight energy: got -1.0.*from 0"),
    "form": ({"reward_weights": [1.0]}, r"reward_weights: got \[1.0\]; allowed is a mapping"),
}


@pytest.mark.parametrize("maker", [PropulsionEnv, PropulsionVectorEnv])
@pytest.mark.parametrize(("settings", "message"), WRONG.values(), ids=WRONG)
def test_wrong_settings_are_refused(maker, settings, message):
    with pytest.raises(InputError, match=message):
        maker(**settings)
