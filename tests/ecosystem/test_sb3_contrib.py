"""The recurrent PPO of sb3-contrib learns on vectors of both environments."""

from functools import partial

import pytest
from sb3_contrib import RecurrentPPO

LIBRARY = "sb3-contrib"
STEPS = 256
ALGORITHM = partial(RecurrentPPO, n_steps=64, batch_size=64, n_epochs=1)


@pytest.mark.parametrize("vector", ["DummyVecEnv", "SubprocVecEnv", "FleetVecEnv"])
def test_recurrent_ppo_learns(learns, vector):
    """RecurrentPPO learns on `{vector}`"""
    assert learns(vector, ALGORITHM, "MlpLstmPolicy", STEPS)
