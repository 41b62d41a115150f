"""stable-baselines3 learns on its own vectors of both environments."""

from functools import partial

import gymnasium as gym
import pytest
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

from training.sb3 import FleetVecEnv

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


def weights(model):
    return [values.clone() for values in model.policy.parameters()]


@pytest.mark.parametrize(
    ("algorithm", "vector"),
    [
        ("PPO", "SubprocVecEnv"),
        *((name, vector) for name in ALGORITHMS for vector in ("DummyVecEnv", "FleetVecEnv")),
    ],
)
def test_algorithms_learn(environment, algorithm, vector):
    """{algorithm} learns on `{vector}`"""
    envs = VECTORS[vector](environment)
    model = ALGORITHMS[algorithm]("MlpPolicy", envs, seed=0, device="cpu")
    before = weights(model)
    model.learn(STEPS)
    assert model.num_timesteps == STEPS
    assert any((old != new).any() for old, new in zip(before, weights(model), strict=True))
    envs.close()
