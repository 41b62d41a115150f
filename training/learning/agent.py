"""The network that PPO trains; its actor becomes a `LearnedPolicy`."""

import math
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.policies import ActorCriticPolicy
from torch import nn

from training.stimuli.policy import HIDDEN, LAYERS

# standard deviation of an action, constant: with `training.stimuli.policy.REACH` an offset of 0.6
# times the budget; less is lost in the disturbance
LOG_STD = math.log(0.12)
CRITIC_HIDDEN = 128
# names of the actor's layers in stable-baselines3
SB3_LAYERS = (
    "mlp_extractor.actor.0",
    "mlp_extractor.actor.2",
    "action_net.0",
)


class SeparateExtractors(nn.Module):
    """Hidden layers of actor and critic; the actor sees only the first columns.

    Parameters
    ----------
    n_features
        Columns that the actor sees.
    n_inputs
        Columns that the critic sees.
    """

    def __init__(self, n_features: int, n_inputs: int):
        super().__init__()
        self.n_features = n_features
        self.latent_dim_pi = HIDDEN
        self.latent_dim_vf = CRITIC_HIDDEN
        self.actor = _two_layers(n_features, HIDDEN)
        self.critic = _two_layers(n_inputs, CRITIC_HIDDEN)

    def forward(self, inputs: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """The last hidden layers of actor and critic."""
        return self.forward_actor(inputs), self.forward_critic(inputs)

    def forward_actor(self, inputs: torch.Tensor) -> torch.Tensor:
        """The last hidden layer of the actor."""
        return self.actor(inputs[:, : self.n_features])

    def forward_critic(self, inputs: torch.Tensor) -> torch.Tensor:
        """The last hidden layer of the critic."""
        return self.critic(inputs)


def _two_layers(n_inputs: int, width: int) -> nn.Sequential:
    first = nn.Linear(n_inputs, width)
    second = nn.Linear(width, width)
    return nn.Sequential(first, nn.Tanh(), second, nn.Tanh())


class Agent(ActorCriticPolicy):
    """Actor and critic of two hidden layers each; tanh bounds the mean action.

    Parameters
    ----------
    n_truth
        Last columns of an observation, which the critic alone sees.
    """

    def __init__(self, *arguments: Any, n_truth: int, **settings: Any):
        self.n_truth = n_truth
        super().__init__(*arguments, log_std_init=LOG_STD, **settings)
        self.action_net = nn.Sequential(self.action_net, nn.Tanh())
        # otherwise the price on offsets would end all exploration
        self.log_std.requires_grad_(False)

    def _build_mlp_extractor(self) -> None:
        n_inputs = self.features_dim
        extractors = SeparateExtractors(n_inputs - self.n_truth, n_inputs)
        self.mlp_extractor = extractors  # type: ignore[assignment]

    def mean_action(self, observations: torch.Tensor) -> torch.Tensor:
        """The actions (n, 1) of observations without noise."""
        return self.action_net(self.mlp_extractor.forward_actor(observations))

    def tensors(self) -> dict[str, np.ndarray]:
        """A copy of all parameters, by name."""
        parameters = self.named_parameters()
        return {name: parameter.detach().numpy().copy() for name, parameter in parameters}

    def policy_tensors(self) -> dict[str, np.ndarray]:
        """A copy of the actor's tensors, for a `LearnedPolicy` with the actions without noise."""
        tensors = self.tensors()
        renamed = {}
        for layer, sb3_layer in zip(LAYERS, SB3_LAYERS, strict=True):
            for part in ("weight", "bias"):
                renamed[f"{layer}_{part}"] = tensors[f"{sb3_layer}.{part}"]
        return renamed
