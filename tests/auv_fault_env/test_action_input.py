"""Actions that are no finite real numbers are refused in one line."""

import gymnasium as gym
import numpy as np
import pytest

import auv_fault_env
from auv_fault_env.errors import InputError


class Odd:
    def __float__(self):
        raise RuntimeError("odd")


class Tensor:
    def __array__(self, *arguments, **options):
        raise RuntimeError("needs a gradient")


@pytest.fixture(scope="module")
def env():
    env = gym.make("auv_fault_env/Propulsion-v0", disable_env_checker=True).unwrapped
    env.reset(seed=0)
    return env


@pytest.mark.parametrize(
    ("action", "words"),
    [
        ([10**400, 0, 0], "action: got 'a number beyond 1.8e308'"),
        ([-(10**5000), 0, 0], "action: got 'a number beyond 1.8e308'"),
        (np.array([10**400, 0, 0], object), "beyond"),
        ([1e999, 0, 0], "got inf"),
        ([None, 0, 0], "got nan"),
        ([1j, 0, 0], "got"),
        (np.array([1j, 0, 0]), "real numbers"),
        (np.array(3 * ["2026-01-01"], "datetime64[s]"), "real numbers"),
        ("full ahead", "full ahead"),
        ({"speed": 1.0}, "speed"),
        (iter([1.0, 0.0, 0.0]), "iterator"),
        ([[1.0, 2.0], [3.0]], "numbers of shape"),
        ([Odd(), 0, 0], "odd"),
        (Tensor(), "needs a gradient"),
    ],
)
def test_refused_and_the_episode_goes_on(env, action, words):
    with pytest.raises(InputError, match=words) as refused:
        env.step(action)
    message = str(refused.value)
    assert "allowed is" in message and message.isprintable()
    env.step([0.3, 0.0, 0.0])


def test_the_vector_form_refuses_too():
    envs = gym.make_vec("auv_fault_env/Propulsion-v0", num_envs=2)
    envs.reset(seed=0)
    with pytest.raises(InputError, match="beyond"):
        envs.step([[10**400, 0, 0], [0, 0, 0]])
    assert auv_fault_env.CHANNELS
    envs.close()
