"""Tianshou learns on its own vectors of both environments."""

from functools import partial

import gymnasium as gym
import pytest
from tianshou.algorithm import PPO
from tianshou.algorithm.modelfree.reinforce import ProbabilisticActorPolicy
from tianshou.algorithm.optim import AdamOptimizerFactory
from tianshou.data import Collector, VectorReplayBuffer
from tianshou.env import DummyVectorEnv, ShmemVectorEnv, SubprocVectorEnv
from tianshou.trainer import OnPolicyTrainerParams
from tianshou.utils.net.common import Net
from tianshou.utils.net.continuous import ContinuousActorProbabilistic, ContinuousCritic
from torch.distributions import Independent, Normal

LIBRARY = "tianshou"
LANES = 2
STEPS = 200
LIMIT = 40
VECTORS = {
    "DummyVectorEnv": DummyVectorEnv,
    "SubprocVectorEnv": SubprocVectorEnv,
    "ShmemVectorEnv": ShmemVectorEnv,
}


def normal(mean_and_std):
    return Independent(Normal(*mean_and_std), 1)


@pytest.mark.parametrize("vector", VECTORS)
def test_ppo_learns(environment, vector):
    """PPO learns on `{vector}`, and its buffer has the information"""
    make = partial(gym.make, environment, max_episode_steps=LIMIT)
    space = make().action_space
    inputs = make().observation_space.shape
    actor = ContinuousActorProbabilistic(
        preprocess_net=Net(state_shape=inputs, hidden_sizes=[16]), action_shape=space.shape
    )
    critic = ContinuousCritic(preprocess_net=Net(state_shape=inputs, hidden_sizes=[16]))
    policy = ProbabilisticActorPolicy(actor=actor, dist_fn=normal, action_space=space)
    algorithm = PPO(policy=policy, critic=critic, optim=AdamOptimizerFactory())
    before = [values.clone() for values in actor.parameters()]
    envs = VECTORS[vector]([make] * LANES)
    buffer = VectorReplayBuffer(STEPS, LANES)
    collector = Collector(algorithm, envs, buffer)
    settings = OnPolicyTrainerParams(
        training_collector=collector,
        max_epochs=1,
        epoch_num_steps=STEPS,
        collection_step_num_env_steps=STEPS // 2,
        batch_size=32,
        verbose=False,
        show_progress=False,
    )
    result = algorithm.run_training(settings)
    assert result.timing.total_time > 0
    assert collector.collect_step == STEPS
    assert any((old != new).any() for old, new in zip(before, actor.parameters(), strict=True))
    collector.collect(n_step=STEPS // 2)
    assert buffer.info.energy.max() > 0
    envs.close()
