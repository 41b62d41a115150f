"""A network under Adam, whose whole state can be taken out and put back."""

from collections.abc import Mapping

import numpy as np
import torch

MOMENTS = ("exp_avg", "exp_avg_sq", "step")
STEEPEST = 1.0  # norm of a gradient; a steeper one is shortened


class AdamTraining:
    """A network and its optimiser; every number between two epochs is in `state`."""

    def __init__(self, network: torch.nn.Module):
        self.network = network
        self.optimiser = torch.optim.Adam(self.network.parameters())
        for parameter in self.network.parameters():
            still = dict(
                exp_avg=torch.zeros_like(parameter), exp_avg_sq=torch.zeros_like(parameter)
            )
            self.optimiser.state[parameter] = still | {"step": torch.zeros(())}

    def descend(self, loss: torch.Tensor, rate: float) -> None:
        """One step of Adam at this learning rate."""
        self.optimiser.param_groups[0]["lr"] = rate
        self.optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), STEEPEST)
        self.optimiser.step()

    def state(self) -> dict[str, np.ndarray]:
        """Copies of weights and moments, by name."""
        moments = {
            f"{name}.{moment}": tensor.numpy().copy() for name, moment, tensor in self._moments()
        }
        return self.network.tensors() | moments

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Take over what `state` gave."""
        with torch.no_grad():
            for name, parameter in self.network.named_parameters():
                parameter.copy_(torch.from_numpy(state[name]))
            for name, moment, tensor in self._moments():
                tensor.copy_(torch.from_numpy(state[f"{name}.{moment}"]))

    def _moments(self):
        for name, parameter in self.network.named_parameters():
            for moment in MOMENTS:
                yield name, moment, self.optimiser.state[parameter][moment]
