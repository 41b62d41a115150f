"""A start for the agent: it imitates the rule of `training.stimuli.triggered_surge`."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from stable_baselines3.common.policies import ActorCriticPolicy

from training.learning.adam import AdamTraining
from training.learning.constraint import ALLOWANCE, ConstrainedVecEnv
from training.stimuli.policy_inputs import allowance_of, log_probability_of
from training.stimuli.triggered_surge import surge_offset

PASSES = 8
BATCH = 1024
RATE = 1e-3
VALUE_WEIGHT = 0.1  # of the error of the critic beside that of the actor


class Demonstration(NamedTuple):
    """Decisions of the rule, to learn from."""

    observations: torch.Tensor  # (n, n_features)
    actions: torch.Tensor  # (n, 1)
    returns: torch.Tensor  # (n,), discounted sum of the rewards from the decision on


def demonstrate(env: ConstrainedVecEnv, n_decisions: int, discount: float) -> Demonstration:
    """The rule at work on every lane for so many decisions."""
    decisions = []
    observation = env.reset()
    for _ in range(n_decisions):
        seen = observation.copy()
        action = _rule(seen, env)
        observation, reward, done, _ = env.step(action)
        decisions.append((seen, action, reward, done))
    observations, actions, rewards, ends = zip(*decisions, strict=True)
    returns = _discounted_sums(rewards, ends, discount)
    arrays = (np.concatenate(observations), np.concatenate(actions), returns.ravel())
    return Demonstration(*map(torch.from_numpy, arrays))


def _rule(observation: np.ndarray, env: ConstrainedVecEnv) -> np.ndarray:
    """Actions (n_lanes, 1) float32 of the rule."""
    log_probability = log_probability_of(observation[:, : len(env.classes)])
    offset = surge_offset(log_probability, allowance_of(observation[:, ALLOWANCE]))
    return (offset / env.amplitude)[:, None].astype(np.float32)


def _discounted_sums(
    rewards: Sequence[np.ndarray], ends: Sequence[np.ndarray], discount: float
) -> np.ndarray:
    """Sum of the rewards from each decision to the end of its episode, (n_decisions, n_lanes)."""
    sums = np.zeros((len(rewards), len(rewards[0])), np.float32)
    following = np.zeros(len(rewards[0]), np.float32)
    for k in reversed(range(len(rewards))):
        following = rewards[k] + discount * np.where(ends[k], 0.0, following)
        sums[k] = following
    return sums


def imitate(
    policy: ActorCriticPolicy, training: AdamTraining, demonstration: Demonstration
) -> None:
    """Fit the mean action to the actions, and the critic to the returns.

    The order of the batches comes from torch's global generator.
    """
    mean_squared_error = torch.nn.functional.mse_loss
    for _ in range(PASSES):
        for batch in torch.randperm(len(demonstration.actions)).split(BATCH):
            observations, actions, returns = (part[batch] for part in demonstration)
            mean_action = policy.get_distribution(observations).distribution.mean
            value = policy.predict_values(observations)[:, 0]
            loss = mean_squared_error(mean_action, actions)
            loss = loss + VALUE_WEIGHT * mean_squared_error(value, returns)
            training.step(loss, RATE)
