"""The recurrent PPO of sb3-contrib learns on vectors of both environments."""

from functools import partial

import gymnasium as gym
import pytest
from sb3_contrib import RecurrentPPO
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

from training.sb3 import FleetVecEnv

LIBRARY = "sb3-contrib"
LANES = 2
STEPS = 256


def singles(kind, environment):
    return kind([partial(gym.make, environment)] * LANES)


def fleet(environment):
    many = gym.make_vec(environment, LANES, "vector_entry_point", autoreset_mode="SameStep")
    return FleetVecEnv(many)


VECTORS = {
    "DummyVecEnv": partial(singles, DummyVecEnv),
    "SubprocVecEnv": partial(singles, SubprocVecEnv),
    "FleetVecEnv": fleet,
}


@pytest.mark.parametrize("vector", VECTORS)
def test_recurrent_ppo_learns(environment, vector):
    """RecurrentPPO learns on `{vector}`"""
    envs = VECTORS[vector](environment)
    settings = {"n_steps": 64, "batch_size": 64, "n_epochs": 1}
    model = RecurrentPPO("MlpLstmPolicy", envs, seed=0, device="cpu", **settings)
    before = [values.clone() for values in model.policy.parameters()]
    model.learn(STEPS)
    assert model.num_timesteps == STEPS
    after = model.policy.parameters()
    assert any((old != new).any() for old, new in zip(before, after, strict=True))
    envs.close()
