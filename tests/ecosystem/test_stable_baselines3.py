"""stable-baselines3 learns on its own vectors of both environments."""

from functools import partial

import gymnasium as gym
import pytest
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

LIBRARY = "stable-baselines3"
LANES = 2
STEPS = 256
ON_POLICY = {"n_steps": 32, "batch_size": 32, "n_epochs": 2}
OFF_POLICY = {"learning_starts": 32, "batch_size": 32, "train_freq": 8}
ALGORITHMS = {
    "PPO": partial(PPO, **ON_POLICY),
    "SAC": partial(SAC, **OFF_POLICY),
    "TD3": partial(TD3, **OFF_POLICY),
}
VECTORS = {"DummyVecEnv": DummyVecEnv, "SubprocVecEnv": SubprocVecEnv}


def weights(model):
    return [values.clone() for values in model.policy.parameters()]


@pytest.mark.parametrize(
    ("algorithm", "vector"),
    [*((name, "DummyVecEnv") for name in ALGORITHMS), ("PPO", "SubprocVecEnv")],
)
def test_algorithms_learn(environment, algorithm, vector):
    """{algorithm} learns on `{vector}`"""
    envs = VECTORS[vector]([partial(gym.make, environment)] * LANES)
    model = ALGORITHMS[algorithm]("MlpPolicy", envs, seed=0, device="cpu")
    before = weights(model)
    model.learn(STEPS)
    assert model.num_timesteps == STEPS
    assert any((old != new).any() for old, new in zip(before, weights(model), strict=True))
    envs.close()
