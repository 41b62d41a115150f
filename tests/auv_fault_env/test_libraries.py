"""The wrappers and the conventions of the libraries that collect information drive both forms."""

import statistics
import time

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers.vector import DictInfoToList

import auv_fault_env
from auv_fault_env.truth import LEVELS

NAME = "auv_fault_env/Propulsion-v0"
N = 8
FORMS = ("vector_entry_point", "sync")


def many(form, **settings):
    return gym.make_vec(NAME, N, form, max_episode_steps=5, **settings)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("level", LEVELS)
def test_information_becomes_a_list_of_the_lanes(form, level):
    env = DictInfoToList(many(form, truth=level))
    fault = {"fault": "increased_drag", "onset": 0.0, "severity": 1.0}
    _, infos = env.reset(seed=1, options={"schedule": [fault]})
    *_, infos = env.step(np.zeros((N, 3), np.float32))
    one = gym.make(NAME, truth=level)
    one.reset(seed=1, options={"schedule": [fault]})
    *_, info = one.step(np.zeros(3, np.float32))
    assert len(infos) == N and infos[0] == info
    if level:
        assert auv_fault_env.classes()[infos[3]["true_class"]] == "increased_drag"


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("level", ["label", False])
def test_information_becomes_tensors(form, level):
    torch = pytest.importorskip("torch")
    pytest.importorskip("array_api_compat")
    from gymnasium.wrappers.vector import NumpyToTorch

    env = NumpyToTorch(many(form, truth=level))
    _, info = env.reset(seed=1)
    for _ in range(7):
        *_, info = env.step(torch.zeros((N, 3)))
    assert {type(value) for value in info.values()} == {torch.Tensor}


@pytest.mark.parametrize("level", ["label", False])
def test_information_is_flat_and_numeric(level):
    # the information of a single environment as TorchRL reads it: a dtype, no nested dictionary
    env = gym.make(NAME, truth=level)
    _, first = env.reset(seed=1)
    *_, info = env.step(np.zeros(3, np.float32))
    assert first.keys() == info.keys()
    assert all(np.issubdtype(value.dtype, np.number) for value in info.values())


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("mode", AutoresetMode)
def test_a_vector_tells_how_it_resets(form, mode):
    # TorchRL reads the attribute, Gymnasium's wrappers the metadata
    made = {"autoreset_mode": mode}
    env = many(form, **(made if form == "vector_entry_point" else {"vector_kwargs": made}))
    assert env.unwrapped.autoreset_mode is env.metadata["autoreset_mode"] is mode


def seconds(env, actions):
    """Processor time of a step, over whole runs of the actions."""
    start = time.process_time()
    for action in actions:
        _, _, terminated, truncated, _ = env.step(action)
        if np.ndim(terminated) == 0 and (terminated or truncated):
            env.reset()
    return (time.process_time() - start) / len(actions)


@pytest.mark.parametrize(
    ("vectorise", "most"),
    [(lambda make: make(), 2.5), (lambda make: SyncVectorEnv([make] * N), 3.0)],
    ids=["single", "sync"],
)
def test_a_step_costs_little_more_than_one_of_cartpole(vectorise, most):
    envs = [vectorise(lambda name=name: gym.make(name)) for name in (NAME, "CartPole-v1")]
    actions = []
    for env in envs:
        env.reset(seed=0)
        env.action_space.seed(0)
        actions.append([env.action_space.sample() for _ in range(600)])
    times = [[seconds(*pair) for pair in zip(envs, actions, strict=True)] for _ in range(7)]
    assert statistics.median(ours / theirs for ours, theirs in times[1:]) < most
