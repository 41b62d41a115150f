"""The recurrent PPO of sb3-contrib learns on vectors of both environments."""

from functools import partial

import gymnasium as gym
import pytest
from sb3_contrib import RecurrentPPO
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

LIBRARY = "sb3-contrib"
LANES = 2
STEPS = 256


VECTORS = {
    "DummyVecEnv": DummyVecEnv,
    "SubprocVecEnv": SubprocVecEnv,
}


@pytest.mark.parametrize("vector", VECTORS)
def test_recurrent_ppo_learns(environment, vector):
    """RecurrentPPO learns on `{vector}`"""
    envs = VECTORS[vector]([partial(gym.make, environment)] * LANES)
    settings = {"n_steps": 64, "batch_size": 64, "n_epochs": 1}
    model = RecurrentPPO("MlpLstmPolicy", envs, seed=0, device="cpu", **settings)
    before = [values.clone() for values in model.policy.parameters()]
    model.learn(STEPS)
    assert model.num_timesteps == STEPS
    after = model.policy.parameters()
    assert any((old != new).any() for old, new in zip(before, after, strict=True))
    envs.close()
