"""Faults on vector environments: every lane is the single environment, in every autoreset mode."""

import copy
import functools
import pickle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv

from auv_fault_env import ScheduleSampler
from auv_fault_env.env import PropulsionEnv, PropulsionVectorEnv
from auv_fault_env.wrappers import FaultInjection, FaultInjectionVector, SignalFault
from tests.auv_fault_env.test_autoreset import assert_same_info

from .counting import COUNT, FALL, FAULTS, Counting, event

LENGTHS = (4, 5, 7)
N = len(LENGTHS)
SAMPLER = ScheduleSampler(
    onset=(0.0, 4.0), ramp=(1.0, 3.0), healthy=0.1, compound=0.7, intermittent=0.3
)
EVERY_KIND = [event(name, 1, 0.9) for name in FAULTS]


def singles():
    return [functools.partial(Counting, length) for length in LENGTHS]


def wrapped_singles(**settings):
    return [lambda make=make: FaultInjection(make(), FAULTS, **settings) for make in singles()]


def pair(mode, schedules=SAMPLER, truth="full"):
    """Faults on a vector environment, and what they must equal: faults on each environment."""
    vector = SyncVectorEnv(singles(), autoreset_mode=mode)
    each = SyncVectorEnv(wrapped_singles(schedules=schedules, truth=truth), autoreset_mode=mode)
    return FaultInjectionVector(vector, FAULTS, schedules, truth=truth), each


def assert_same_run(ours, theirs, steps=40, seed=7, options=None):
    """The same results of resets and steps, to the bit; returns the ends of episodes."""
    results = [env.reset(seed=seed, options=copy.deepcopy(options)) for env in (ours, theirs)]
    random = np.random.default_rng(0)
    ended = 0
    for _ in range(steps):
        (observations, *rest, info), (expected, *expected_rest, expected_info) = results
        assert observations.tobytes() == expected.tobytes()
        np.testing.assert_array_equal(rest, expected_rest)
        assert_same_info(info, expected_info)
        space = ours.single_action_space
        given = random.uniform(space.low, space.high, (ours.num_envs, *space.shape))
        results = [env.step(given.astype(space.dtype)) for env in (ours, theirs)]
        is_done = np.logical_or(*results[0][2:4])
        ended += is_done.sum()
        if ours.metadata["autoreset_mode"] is AutoresetMode.DISABLED and is_done.any():
            masks = [{"reset_mask": is_done.copy()} for _ in results]
            results = [
                env.reset(options=mask) for env, mask in zip((ours, theirs), masks, strict=True)
            ]
    return ended


@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize("schedules", [SAMPLER, EVERY_KIND, ()], ids=["drawn", "every", "none"])
def test_every_lane_is_the_single_environment(mode, schedules):
    assert assert_same_run(*pair(mode, schedules)) >= 15


@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize("level", ["label", False])
def test_levels_of_the_truth_are_those_of_the_single_environment(mode, level):
    assert_same_run(*pair(mode, truth=level))


@pytest.mark.parametrize("mode", AutoresetMode)
def test_the_schedule_of_a_reset_is_for_its_episode(mode):
    options = {"schedule": [event("bias", 1)]}
    assert_same_run(*pair(mode), options=options)


@pytest.mark.parametrize("seed", [7, [3, 3, 90], None], ids=str)
def test_seeds_of_lanes(seed):
    ours, theirs = pair(AutoresetMode.NEXT_STEP)
    if seed is None:
        ours.reset()
        seed = list(ours.env.np_random_seed)
        ours.reset(seed=seed)
    assert_same_run(ours, theirs, seed=seed)


def test_an_unseeded_reset_can_be_repeated_from_the_seeds_that_it_drew():
    for seed in (None, [5, None, None]):
        ours, theirs = pair(AutoresetMode.NEXT_STEP)
        observations, _ = ours.reset(seed=seed)
        expected, _ = theirs.reset(seed=list(ours.np_random_seed))
        steps = [env.step(np.zeros((N, 2)))[0] for env in (ours, theirs)]
        assert observations.tobytes() == expected.tobytes()
        assert steps[0].tobytes() == steps[1].tobytes()


@pytest.mark.parametrize("mode", AutoresetMode)
def test_hand_vectorised_environments_of_this_package(mode):
    faults = {
        "bias": SignalFault("bias", "observation", 4, 0.2),
        "noise": SignalFault("noise", "observation", 8, 30.0),
        "late": SignalFault("delay", "observation", 4, 3),
        "gain": SignalFault("gain", "action", 0, 0.3),
    }
    settings = dict(faults=faults, schedules={"onset": [0.0, 0.4]}, sample_time=0.1, truth="full")
    make = lambda: gym.wrappers.TimeLimit(PropulsionEnv(truth=False), 6)  # noqa: E731
    wrapped = [lambda: FaultInjection(make(), **settings)] * N
    fleet = PropulsionVectorEnv(N, 6, truth=False, autoreset_mode=mode)
    ours = FaultInjectionVector(fleet, **settings)
    theirs = SyncVectorEnv(wrapped, autoreset_mode=mode)
    assert assert_same_run(ours, theirs, steps=25) >= 2 * N


@pytest.mark.parametrize("form", ["vector_entry_point", "sync"])
def test_hand_vectorised_cartpoles_of_gymnasium(form):
    faults = {"bias": SignalFault("bias", "observation", 2, 0.1)}
    env = gym.make_vec("CartPole-v1", 2, form)
    twin = gym.make_vec("CartPole-v1", 2, form)
    env = FaultInjectionVector(env, faults, [event("bias", 3)], truth="full")
    env.reset(seed=1)
    twin.reset(seed=1)
    # a pole that is pushed one way falls, lane after lane; its clock starts again
    clock = np.zeros(2, int)
    done = np.zeros(2, bool)
    starts = 0
    for _ in range(60):
        observations, _, terminated, truncated, info = env.step(np.ones(2, int))
        expected, *_ = twin.step(np.ones(2, int))
        clock = np.where(done, 0, clock + 1)
        starts += done.sum()
        done = terminated | truncated
        shift = np.where(clock >= 3, np.float32(0.1), np.float32(0.0))
        np.testing.assert_allclose(observations[:, 2], expected[:, 2] + shift, atol=1e-7)
        assert observations[:, [0, 1, 3]].tobytes() == expected[:, [0, 1, 3]].tobytes()
        assert (info["truth"]["label"] == np.where(shift > 0, "bias", "normal")).all()
    assert starts >= 8


def test_final_values_are_those_of_the_end_under_its_faults():
    vector = SyncVectorEnv(singles(), autoreset_mode=AutoresetMode.SAME_STEP)
    env = FaultInjectionVector(vector, FAULTS, [event("bias", 4)], truth="full")
    env.reset(seed=1)
    for _ in range(4):
        observations, _, terminated, _, info = env.step(np.zeros((N, 2)))
    assert terminated.tolist() == [True, False, False]
    # the end of the first lane, and the start of its next episode
    assert info["final_obs"][0][FALL] == -0.5 * 5 - 0.25 + 2.0
    assert info["final_obs"][1] is None
    assert info["final_info"]["truth"]["label"][0] == "bias"
    assert info["final_info"]["_truth"].tolist() == [True, False, False]
    assert observations[0, FALL] == -0.5 - 0.25
    assert info["truth"]["label"].tolist() == ["normal", "bias", "bias"]


def test_a_masked_reset_leaves_the_other_lanes():
    vector = SyncVectorEnv(singles(), autoreset_mode=AutoresetMode.DISABLED)
    events = [event(name, 0) for name in ("noise", "bias", "stuck")]
    env = FaultInjectionVector(vector, FAULTS, events, truth="full")
    env.reset(seed=1)
    before, *_ = env.step(np.zeros((N, 2)))
    mask = np.array([False, True, False])
    options = {"reset_mask": mask, "schedules": [[], [event("scale", 0)], []]}
    observations, info = env.reset(seed=5, options=options)
    assert observations[[0, 2]].tobytes() == before[[0, 2]].tobytes()
    assert observations[1, COUNT] == 0.5
    assert info["truth"]["label"][1] == "scale" and info["_truth"].tolist() == mask.tolist()
    assert set(options) == {"reset_mask", "schedules"}
    *_, info = env.step(np.zeros((N, 2)))
    assert info["truth"]["label"].tolist() == ["noise", "scale", "noise"]


def test_workers_run_the_wrapped_environments():
    each = wrapped_singles(schedules=SAMPLER, truth="full")
    envs = [vector(each) for vector in (AsyncVectorEnv, SyncVectorEnv)]
    assert_same_run(*envs)
    for env in envs:
        env.close()


def test_faults_on_workers():
    ours, theirs = pair(AutoresetMode.NEXT_STEP)
    ours = FaultInjectionVector(AsyncVectorEnv(singles()), FAULTS, SAMPLER, truth="full")
    assert_same_run(ours, theirs)
    ours.close()


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_goes_on_alike(copied):
    env = FaultInjectionVector(SyncVectorEnv(singles()), FAULTS, EVERY_KIND)
    env.reset(seed=1)
    env.step(np.zeros((N, 2)))
    twin = copied(env)
    for _ in range(9):
        results = [one.step(np.full((N, 2), 0.3)) for one in (env, twin)]
        assert data_equivalence(*results, exact=True)


def test_spaces_and_classes_stay():
    vector = SyncVectorEnv(singles())
    env = FaultInjectionVector(vector, FAULTS)
    assert env.observation_space is vector.observation_space
    assert env.action_space is vector.action_space
    assert env.classes == ("normal", *FAULTS)


def test_without_a_fault_the_very_values_of_the_environment_pass():
    vector = SyncVectorEnv(singles(), copy=False)
    env = FaultInjectionVector(vector, FAULTS, [event("gain", 0)])
    observations, _ = env.reset(seed=1)
    assert observations is vector._observations
