"""The network that PPO trains: what is kept of it is a `LearnedPolicy`, the rest serves the training."""

from typing import Any

import numpy as np
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.policies import ActorCriticPolicy
from torch import nn

from training.stimuli.policy import HIDDEN, LAYERS

LOG_STD = -1.4  # of an action, for good: 0.25, or 0.06 m/s; less is lost in the disturbance
SOURCES = dict(
    zip(
        LAYERS,
        ("mlp_extractor.policy_net.0", "mlp_extractor.policy_net.2", "action_net.0"),
        strict=True,
    )
)


class Agent(ActorCriticPolicy):
    """Actor and critic of two hidden layers each; tanh bounds the mean action, the noise is constant."""

    def __init__(self, *arguments: Any, **settings: Any):
        super().__init__(*arguments, net_arch=[HIDDEN, HIDDEN], log_std_init=LOG_STD, **settings)
        self.action_net = nn.Sequential(self.action_net, nn.Tanh())
        self.log_std.requires_grad_(False)  # the price of moving would end all exploration

    def tensors(self) -> dict[str, np.ndarray]:
        """A copy of all parameters, by name."""
        return {
            name: parameter.detach().numpy().copy() for name, parameter in self.named_parameters()
        }

    def meant(self, rollout: RolloutBuffer) -> np.ndarray:
        """The actions (n_steps, n_lanes) without noise where the rollout was."""
        seen = rollout.observations
        return self.predict(seen.reshape(-1, seen.shape[-1]), deterministic=True)[0].reshape(
            seen.shape[:2]
        )

    def learned(self) -> dict[str, np.ndarray]:
        """A copy of the tensors of a `LearnedPolicy`, whose actions are this actor's deterministic ones."""
        own = self.tensors()
        return {
            f"{to}_{part}": own[f"{source}.{part}"]
            for to, source in SOURCES.items()
            for part in ("weight", "bias")
        }
