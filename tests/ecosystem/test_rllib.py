"""RLlib learns on both environments in local and remote runners."""

import gymnasium as gym
import pytest
import ray
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig

LIBRARY = "ray"
STEPS = 200
LIMIT = 40
SYNC = gym.VectorizeMode.SYNC
# the vector entry point resets as RLlib expects it, which for ActiveDiagnosis-v0 is no default
NATIVE = gym.VectorizeMode.VECTOR_ENTRY_POINT
FORMS = {
    "one environment in the local runner": (0, 1, SYNC),
    "two environments in the local runner": (0, 2, SYNC),
    "the native vector": (0, 4, NATIVE),
    "a remote runner": (1, 2, SYNC),
    "the native vector in a remote runner": (1, 4, NATIVE),
}


@pytest.fixture(scope="module", autouse=True)
def cluster():
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False)
    yield
    ray.shutdown()


@pytest.mark.parametrize("form", FORMS)
def test_ppo_learns(environment, form):
    """PPO learns on {form}"""
    runners, lanes, mode = FORMS[form]
    reset = {"autoreset_mode": "NextStep"} if mode is NATIVE else {}
    config = (
        PPOConfig()
        .environment(environment, env_config={"max_episode_steps": LIMIT, **reset})
        .env_runners(
            num_env_runners=runners,
            num_envs_per_env_runner=lanes,
            gym_env_vectorize_mode=mode,
        )
        .training(train_batch_size_per_learner=STEPS, minibatch_size=50, num_epochs=1)
        .rl_module(model_config=DefaultModelConfig(fcnet_hiddens=[16]))
        .debugging(seed=0)
    )
    algorithm = config.build_algo()
    try:
        before = algorithm.get_weights()["default_policy"]
        result = algorithm.train()
        after = algorithm.get_weights()["default_policy"]
    finally:
        algorithm.stop()
    assert result["env_runners"]["num_env_steps_sampled"] >= STEPS
    assert 1 <= result["env_runners"]["episode_len_mean"] <= LIMIT
    assert any((before[name] != after[name]).any() for name in before)
