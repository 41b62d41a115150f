"""A start for the agent: it imitates the surge of `training.stimuli.standing.StandingSurge`."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch

from training.learning.adam import AdamTraining
from training.learning.agent import LOG_STD, Agent
from training.learning.budgeted import BudgetedVecEnv
from training.stimuli.policy import REACH
from training.stimuli.policy_inputs import log_probability_of
from training.stimuli.standing import StandingSurge
from training.stimuli.triggered_surge import surge_offset

PASSES = 8
BATCH = 1024
RATE = 1e-3
VALUE_WEIGHT = 0.01  # of the error of the critic beside that of the actor


class Demonstration(NamedTuple):
    """Decisions of the rule, to learn from."""

    observations: torch.Tensor  # (n, n_features + n_truth)
    actions: torch.Tensor  # (n, 1), without noise
    returns: torch.Tensor  # (n,), discounted sum of the rewards from the decision on


def demonstrate(
    env: BudgetedVecEnv, n_decisions: int, discount: float, random: np.random.Generator
) -> Demonstration:
    """The rule at work on every lane for so many decisions, with the noise of exploration."""
    decisions = []
    observation = env.reset()
    for _ in range(n_decisions):
        seen = observation.copy()
        action = rule(seen, env)
        noise = np.exp(LOG_STD) * random.standard_normal(action.shape)
        noisy_action = np.clip(action + noise, -1.0, 1.0).astype(np.float32)
        observation, reward, done, _ = env.step(noisy_action)
        decisions.append((seen, action, reward, done))
    observations, actions, rewards, ends = zip(*decisions, strict=True)
    returns = _discounted_sums(rewards, ends, discount)
    arrays = (np.concatenate(observations), np.concatenate(actions), returns.ravel())
    return Demonstration(*map(torch.from_numpy, arrays))


def rule(observation: np.ndarray, env: BudgetedVecEnv) -> np.ndarray:
    """Actions (n_lanes, 1) float32 of the rule."""
    log_probability = log_probability_of(observation[:, : len(env.env.classes)])
    offset = surge_offset(log_probability, env.allowance, StandingSurge.gain)
    action = np.clip(offset / (REACH * env.budget), -1.0, 1.0)
    return action[:, None].astype(np.float32)


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


def imitate(policy: Agent, training: AdamTraining, demonstration: Demonstration) -> None:
    """Fit the mean action to the actions, and the critic to the returns.

    The order of the batches comes from torch's global generator.
    """
    mean_squared_error = torch.nn.functional.mse_loss
    for _ in range(PASSES):
        for batch in torch.randperm(len(demonstration.actions)).split(BATCH):
            observations, actions, returns = (part[batch] for part in demonstration)
            value = policy.predict_values(observations)[:, 0]
            loss = mean_squared_error(policy.mean_action(observations), actions)
            loss = loss + VALUE_WEIGHT * mean_squared_error(value, returns)
            training.step(loss, RATE)
