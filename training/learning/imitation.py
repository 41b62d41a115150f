"""A start for the agent: what `training.stimuli.surge_ahead` would do, learnt from watching it."""

from typing import NamedTuple

import numpy as np
import torch
from stable_baselines3.common.policies import ActorCriticPolicy

from auv_fault_env.faults import classes
from training.learning.adam import AdamTraining
from training.learning.constraint import ALLOWANCE, ConstrainedVecEnv
from training.stimuli.base import LARGEST_OFFSET
from training.stimuli.policy_inputs import log_probability_of
from training.stimuli.surge_ahead import surge_ahead

PASSES = 8
BATCH = 1024
RATE = 1e-3
N_CLASSES = len(classes())


class Demonstration(NamedTuple):
    """What was seen (n, n_features), done (n, 1), and gained from then on, discounted (n,)."""

    seen: torch.Tensor
    done: torch.Tensor
    worth: torch.Tensor


def demonstrate(env: ConstrainedVecEnv, decisions: int, discount: float) -> Demonstration:
    """The rule by hand at work on every lane for so many decisions."""
    seen = []
    done = []
    gains = []
    ends = []
    observation = env.reset()
    for _ in range(decisions):
        left = np.expm1(observation[:, ALLOWANCE]) * LARGEST_OFFSET**2
        action = (
            surge_ahead(log_probability_of(observation[:, :N_CLASSES]), left) / env.amplitude
        )[:, None]
        seen.append(observation.copy())
        done.append(action.astype(np.float32))
        observation, gain, end, _ = env.step(done[-1])
        gains.append(gain)
        ends.append(end)
    worth = np.zeros((decisions, env.num_envs), np.float32)
    ahead = np.zeros(env.num_envs, np.float32)
    for k in reversed(range(decisions)):
        ahead = gains[k] + discount * np.where(ends[k], 0.0, ahead)
        worth[k] = ahead
    return Demonstration(
        *map(torch.from_numpy, (np.concatenate(seen), np.concatenate(done), worth.ravel()))
    )


def imitate(policy: ActorCriticPolicy, learner: AdamTraining, lessons: Demonstration) -> None:
    """Fit the actor's mean action to what was done, and the critic to what it was worth; from torch's generator."""
    for _ in range(PASSES):
        for batch in torch.randperm(len(lessons.seen)).split(BATCH):
            seen, done, worth = (part[batch] for part in lessons)
            mean = policy.get_distribution(seen).distribution.mean
            loss = torch.nn.functional.mse_loss(mean, done)
            loss = loss + 0.1 * torch.nn.functional.mse_loss(
                policy.predict_values(seen)[:, 0], worth
            )
            learner.descend(loss, RATE)
