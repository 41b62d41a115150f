"""Ends and resets of the vector environment, against gymnasium's own over single environments."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from auv_fault_env.env import PropulsionEnv, PropulsionVectorEnv
from auv_fault_env.errors import InputError

NAME = "auv_fault_env/Propulsion-v0"
N = 3
LIMIT = 4
MODES = [mode.value for mode in AutoresetMode]


def pair(mode, **settings):
    """The fleet, and what it must equal."""
    fleet = PropulsionVectorEnv(N, LIMIT, autoreset_mode=mode, **settings)
    make = lambda: gym.make(NAME, max_episode_steps=LIMIT, **settings)  # noqa: E731
    return fleet, SyncVectorEnv([make] * N, autoreset_mode=mode)


def assert_same_info(ours, theirs):
    """The same names and masks, and the same values on the lanes of the masks."""
    assert set(ours) == set(theirs)
    for name in theirs:
        if name.startswith("_"):
            np.testing.assert_array_equal(ours[name], theirs[name])
        elif isinstance(theirs[name], dict):
            assert_same_info(ours[name], theirs[name])
        else:
            for lane in np.flatnonzero(theirs[f"_{name}"]):
                np.testing.assert_array_equal(ours[name][lane], theirs[name][lane])


@pytest.mark.parametrize("level", ["label", "full"])
@pytest.mark.parametrize("mode", MODES)
def test_every_step_equals_gymnasium_s_own_vector_environment(mode, level):
    envs = pair(mode, truth=level)
    assert [env.metadata["autoreset_mode"].value for env in envs] == [mode] * 2
    (ours, our_info), (theirs, info) = (env.reset(seed=7) for env in envs)
    random = np.random.default_rng(0)
    ended = 0
    for _ in range(3 * LIMIT):
        np.testing.assert_array_equal(ours, theirs)
        assert_same_info(our_info, info)
        actions = random.uniform(-0.5, 1.0, (N, 3)).astype(np.float32)
        (ours, *our_rest, our_info), (theirs, *rest, info) = (env.step(actions) for env in envs)
        for values, expected in zip(our_rest, rest, strict=True):
            np.testing.assert_array_equal(values, expected)
        done = rest[1] | rest[2]
        ended += done.sum()
        if mode == "Disabled" and done.any():
            np.testing.assert_array_equal(ours, theirs)
            options = [{"reset_mask": done.copy()} for _ in envs]
            (ours, our_info), (theirs, info) = (
                env.reset(options=one) for env, one in zip(envs, options, strict=True)
            )
    assert ended >= 2 * N


def test_final_values_are_those_of_the_end():
    env = PropulsionVectorEnv(2, LIMIT, autoreset_mode="SameStep", truth="full")
    env.reset(seed=1, options={"schedules": [[], [{**LOSS, "onset": 0.0}]]})
    for _ in range(LIMIT):
        observation, reward, _, truncated, info = env.step(np.full((2, 3), 0.3))
    assert truncated.all() and (reward < 0.0).all()
    assert info["final_info"]["truth"]["label"].tolist() == ["normal", LOSS["fault"]]
    assert (info["final_info"]["energy"] > 0.0).all() and (info["energy"] == 0.0).all()
    assert info["final_obs"][1][2] == np.float32(0.3) and observation[1, 2] == 0.0


LOSS = {"fault": "propeller_loss:port", "onset": 0.1, "severity": 1.0}


def test_a_mask_resets_its_lanes_and_leaves_the_others():
    env = PropulsionVectorEnv(3, autoreset_mode="Disabled")
    twin = PropulsionVectorEnv(3)
    for one in (env, twin):
        one.reset(seed=5)
        one.step(np.full((3, 3), 0.2))
    options = {"reset_mask": np.array([False, True, False]), "schedule": [LOSS]}
    observation, info = env.reset(seed=20, options=options)
    expected, _ = PropulsionEnv().reset(seed=21, options={"schedule": [LOSS]})
    assert observation[1].tobytes() == expected.tobytes()
    assert info["_energy"].tolist() == [False, True, False]
    observation, *_ = env.step(np.full((3, 3), 0.4))
    others, *_ = twin.step(np.full((3, 3), 0.4))
    assert observation[[0, 2]].tobytes() == others[[0, 2]].tobytes()
    assert options["reset_mask"] is not None  # the caller's options stay as they are


@pytest.mark.parametrize(
    "mask",
    [[True, False], np.array([1, 0]), np.array([True]), np.zeros(2, bool)],
    ids=["list", "numbers", "too short", "nothing"],
)
def test_wrong_masks_are_refused(mask):
    env = PropulsionVectorEnv(2)
    env.reset(seed=1)
    with pytest.raises(InputError, match=r"reset_mask: got .*bool array \(2,\) with a True"):
        env.reset(options={"reset_mask": mask})


def test_the_first_reset_is_of_all_lanes():
    with pytest.raises(InputError, match=r"reset_mask.*all lanes at first"):
        PropulsionVectorEnv(2).reset(options={"reset_mask": np.array([True, False])})


def test_a_step_after_the_end_is_refused_without_autoreset():
    env = PropulsionVectorEnv(2, 1, autoreset_mode="Disabled")
    env.reset(seed=1)
    env.step(np.zeros((2, 3)))
    with pytest.raises(
        gym.error.ResetNeeded, match=r"ended episodes on lanes \[0, 1\].*reset_mask"
    ):
        env.step(np.zeros((2, 3)))


def test_unknown_mode_is_refused():
    with pytest.raises(InputError, match="autoreset_mode: got 'Never'; allowed is one of NextStep"):
        PropulsionVectorEnv(2, autoreset_mode="Never")


@pytest.mark.parametrize("limit", [None, 20])
def test_the_spec_says_the_time_limit_and_makes_an_equal_environment(limit):
    given = {} if limit is None else {"max_episode_steps": limit}
    mode = AutoresetMode.SAME_STEP
    env = gym.make_vec(NAME, 2, "vector_entry_point", autoreset_mode=mode, **given)
    assert env.spec.max_episode_steps == env.max_episode_steps == (limit or 600)
    again = gym.make_vec(EnvSpec.from_json(env.spec.to_json()))
    assert again.spec.max_episode_steps == env.max_episode_steps and again.num_envs == 2
    assert again.metadata["autoreset_mode"] is mode
    assert env.reset(seed=1)[0].tobytes() == again.reset(seed=1)[0].tobytes()


def test_an_unseeded_reset_can_be_repeated_from_the_seed_that_it_drew():
    for maker in (PropulsionEnv, PropulsionVectorEnv):
        env = maker()
        first, _ = env.reset()
        assert maker().reset(seed=env.np_random_seed)[0].tobytes() == first.tobytes()


def test_frames_of_the_lanes_are_those_of_single_environments():
    pytest.importorskip("pygame")
    env = PropulsionVectorEnv(2, 2, render_mode="rgb_array")
    singles = [PropulsionEnv("rgb_array") for _ in range(2)]
    env.reset(seed=1)
    for lane, single in enumerate(singles):
        single.reset(seed=1 + lane)
    for k in range(3):  # the third step starts the next episode
        env.step(np.full((2, 3), 0.3))
        for single in singles:
            single.step(np.full(3, 0.3)) if k < 2 else single.reset()
        for frame, single in zip(env.render(), singles, strict=True):
            np.testing.assert_array_equal(frame, single.render())
    env.close()
