"""A PPO in the manner of CleanRL's `ppo_continuous_action.py` (Huang et al., JMLR 23 (2022) 274).

It has the wrappers and the update of that script, and knows nothing but Gymnasium's vectors.
"""

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium.wrappers import vector
from torch import nn
from torch.distributions import Normal

LIBRARY = "gymnasium"
LANES = 4
ROLLOUT = 16
UPDATES = 5
LIMIT = 20
DISCOUNT = 0.99
TRACE = 0.95
LARGEST = 10.0  # normalised observations and rewards
FORMS = {
    "the native vector": {
        "vectorization_mode": "vector_entry_point",
        "autoreset_mode": "NextStep",  # what Gymnasium's wrappers of observations ask for
    },
    "`SyncVectorEnv`": {"vectorization_mode": "sync"},
    "`AsyncVectorEnv`": {"vectorization_mode": "async"},
}


def wrapped(envs):
    """The wrappers of CleanRL, which in Gymnasium 1 are those of vectors."""
    envs = vector.ClipAction(envs)
    envs = vector.NormalizeObservation(envs)
    envs = vector.TransformObservation(envs, lambda values: values.clip(-LARGEST, LARGEST))
    envs = vector.NormalizeReward(envs, gamma=DISCOUNT)
    return vector.TransformReward(envs, lambda values: values.clip(-LARGEST, LARGEST))


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
    """A rollout, time first: observations, actions, their log probabilities, values, rewards, ends,
    and which steps count: one after an end only resets; and where the rollout has come to.
    """
    rows = []
    counts = torch.ones(LANES, dtype=torch.bool)
    for _ in range(ROLLOUT):
        with torch.no_grad():
            chances, value = network(torch.as_tensor(observation))
            action = chances.sample()
        following, reward, terminated, truncated, _ = envs.step(action.numpy())
        ends = torch.as_tensor(terminated | truncated)
        row = observation, action, chances.log_prob(action).sum(-1), value, reward, ends, counts
        rows.append([torch.as_tensor(part) for part in row])
        counts = ~ends
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
    observations, actions, before, values, rewards, ends, counts = rollout
    gain = advantages(network, values, rewards, ends, observation)
    returns = (gain + values)[counts]
    gain = gain[counts]
    gain = (gain - gain.mean()) / (gain.std() + 1e-8)
    for _ in range(4):
        chances, value = network(observations[counts])
        ratio = (chances.log_prob(actions[counts]).sum(-1) - before[counts]).exp()
        surrogate = torch.minimum(ratio * gain, ratio.clamp(0.8, 1.2) * gain)
        loss = -surrogate.mean() + 0.5 * (value - returns).square().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    return loss.item()


@pytest.mark.parametrize("form", FORMS)
def test_ppo_on_the_vector_interface_alone(environment, form):
    """A script in the manner of CleanRL's PPO learns on {form}"""
    made = gym.make_vec(environment, num_envs=LANES, max_episode_steps=LIMIT, **FORMS[form])
    statistics = vector.RecordEpisodeStatistics(made)
    envs = wrapped(statistics)
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
            n_ends += int(rollout[-2].sum())
    lengths = statistics.length_queue
    envs.close()
    assert LANES * ROLLOUT * UPDATES == 320
    assert np.isfinite(losses).all()
    assert all((old != new).any() for old, new in zip(start, network.parameters(), strict=True))
    assert n_ends == len(lengths) >= LANES * (ROLLOUT * UPDATES // (LIMIT + 1))
    assert set(lengths) <= set(range(1, LIMIT + 1))
