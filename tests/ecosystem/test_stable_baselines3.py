"""stable-baselines3 learns on its own vectors of both environments."""

from functools import partial

import pytest
from stable_baselines3 import PPO, SAC, TD3

LIBRARY = "stable-baselines3"
STEPS = 256
ON_POLICY = {"n_steps": 32, "batch_size": 32, "n_epochs": 2}
OFF_POLICY = {"learning_starts": 32, "batch_size": 32, "train_freq": 8}
ALGORITHMS = {
    "PPO": partial(PPO, **ON_POLICY),
    "SAC": partial(SAC, **OFF_POLICY),
    "TD3": partial(TD3, **OFF_POLICY),
}


@pytest.mark.parametrize(
    ("algorithm", "vector"),
    [
        ("PPO", "SubprocVecEnv"),
        *((name, vector) for name in ALGORITHMS for vector in ("DummyVecEnv", "FleetVecEnv")),
    ],
)
def test_algorithms_learn(learns, algorithm, vector):
    """{algorithm} learns on `{vector}`"""
    assert learns(vector, ALGORITHMS[algorithm], "MlpPolicy", STEPS)
