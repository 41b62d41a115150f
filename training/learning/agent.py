"""The network that PPO trains; its actor becomes a `LearnedPolicy`."""

from typing import Any

import numpy as np
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.policies import ActorCriticPolicy
from torch import nn

from training.stimuli.policy import HIDDEN, LAYERS

# standard deviation of an action, constant: 0.25, or 0.06 m/s; less is lost in the disturbance
LOG_STD = -1.4
# names of the actor's layers in stable-baselines3
SB3_LAYERS = (
    "mlp_extractor.policy_net.0",
    "mlp_extractor.policy_net.2",
    "action_net.0",
)


class Agent(ActorCriticPolicy):
    """Actor and critic of two hidden layers each; tanh bounds the mean action."""

    def __init__(self, *arguments: Any, **settings: Any):
        net_arch = [HIDDEN, HIDDEN]
        super().__init__(*arguments, net_arch=net_arch, log_std_init=LOG_STD, **settings)
        self.action_net = nn.Sequential(self.action_net, nn.Tanh())
        # otherwise the price on offsets would end all exploration
        self.log_std.requires_grad_(False)

    def tensors(self) -> dict[str, np.ndarray]:
        """A copy of all parameters, by name."""
        parameters = self.named_parameters()
        return {name: parameter.detach().numpy().copy() for name, parameter in parameters}

    def mean_actions(self, rollout: RolloutBuffer) -> np.ndarray:
        """The actions (n_steps, n_lanes) of a rollout without noise."""
        n_steps, n_lanes, n_features = rollout.observations.shape
        observations = rollout.observations.reshape(-1, n_features)
        actions, _ = self.predict(observations, deterministic=True)
        return actions.reshape(n_steps, n_lanes)

    def policy_tensors(self) -> dict[str, np.ndarray]:
        """A copy of the actor's tensors, for a `LearnedPolicy` with the actions without noise."""
        tensors = self.tensors()
        renamed = {}
        for layer, sb3_layer in zip(LAYERS, SB3_LAYERS, strict=True):
            for part in ("weight", "bias"):
                renamed[f"{layer}_{part}"] = tensors[f"{sb3_layer}.{part}"]
        return renamed
