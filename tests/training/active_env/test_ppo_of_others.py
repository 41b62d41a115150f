"""A PPO that knows nothing but Gymnasium's vector interface drives the active environment by its
registered name.
"""

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import ClipAction
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from torch import nn
from torch.distributions import Normal

NAME = "training.active_env:auv_fault_env/ActiveDiagnosis-v0"
LANES = 4
ROLLOUT = 16
UPDATES = 5
DISCOUNT = 0.99
TRACE = 0.95


class ActorCritic(nn.Module):
    """A mean action and a value from an observation."""

    def __init__(self, n_inputs, n_actions):
        super().__init__()
        self.body = nn.Sequential(nn.Linear(n_inputs, 32), nn.Tanh(), nn.Linear(32, n_actions + 1))
        self.log_std = nn.Parameter(torch.full((n_actions,), -1.0))

    def forward(self, observation):
        out = self.body(observation)
        return Normal(out[..., :-1], self.log_std.exp()), out[..., -1]


def collected(envs, network, observation):
    """A rollout, time first: observations, actions, their log probabilities, values, rewards, ends;
    and where it is.
    """
    rows = []
    for _ in range(ROLLOUT):
        with torch.no_grad():
            chances, value = network(torch.as_tensor(observation))
            action = chances.sample()
        following, reward, terminated, truncated, _ = envs.step(action.numpy())
        ends = torch.as_tensor(terminated | truncated)
        row = observation, action, chances.log_prob(action).sum(-1), value, reward, ends
        rows.append([torch.as_tensor(part) for part in row])
        observation = following
    return [torch.stack(part) for part in zip(*rows, strict=True)], observation


def advantages(network, values, rewards, ends, observation):
    """Generalised advantage estimates (Schulman et al. 2016), backwards from the last value."""
    with torch.no_grad():
        following = network(torch.as_tensor(observation))[1]
    gained = torch.zeros(LANES)
    estimates = []
    for value, reward, end in zip(
        *(part.flip(0) for part in (values, rewards.float(), ends)), strict=True
    ):
        goes_on = (~end).float()
        gained = (
            reward + DISCOUNT * goes_on * following - value + DISCOUNT * TRACE * goes_on * gained
        )
        estimates.append(gained)
        following = value
    return torch.stack(estimates[::-1])


def improve(network, optimiser, rollout, observation):
    """Clipped policy-gradient steps on one rollout; the last loss."""
    observations, actions, before, values, rewards, ends = rollout
    gain = advantages(network, values, rewards, ends, observation)
    returns = gain + values
    gain = (gain - gain.mean()) / (gain.std() + 1e-8)
    for _ in range(4):
        chances, value = network(observations)
        ratio = (chances.log_prob(actions).sum(-1) - before).exp()
        surrogate = torch.minimum(ratio * gain, ratio.clamp(0.8, 1.2) * gain)
        loss = -surrogate.mean() + 0.5 * (value - returns).square().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    return loss.item()


MANY = {"vectorization_mode": "sync", "vector_kwargs": {"autoreset_mode": AutoresetMode.SAME_STEP}}


@pytest.mark.parametrize(
    "making", [{}, MANY | {"wrappers": [ClipAction]}], ids=["fleet", "single ones in a row"]
)
def test_ppo_on_the_vector_interface_alone(making):
    envs = RecordEpisodeStatistics(
        gym.make_vec(NAME, num_envs=LANES, max_episode_steps=20, **making)
    )
    with torch.random.fork_rng():
        torch.manual_seed(0)
        network = ActorCritic(
            envs.single_observation_space.shape[0], envs.single_action_space.shape[0]
        )
        start = [values.clone() for values in network.parameters()]
        optimiser = torch.optim.Adam(network.parameters(), 3e-3)
        observation, _ = envs.reset(seed=1)
        losses = []
        n_ends = 0
        for _ in range(UPDATES):
            rollout, observation = collected(envs, network, observation)
            losses.append(improve(network, optimiser, rollout, observation))
            n_ends += int(rollout[-1].sum())
    assert LANES * ROLLOUT * UPDATES == 320
    assert np.isfinite(losses).all()
    assert all((old != new).any() for old, new in zip(start, network.parameters(), strict=True))
    assert n_ends == len(envs.length_queue) >= LANES * (ROLLOUT * UPDATES // 20)
    assert set(envs.length_queue) <= set(range(1, 21))
    envs.close()
