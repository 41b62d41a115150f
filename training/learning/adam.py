"""A network in training under Adam; the whole state can be read and restored."""

from collections.abc import Iterator, Mapping

import numpy as np
import torch

MOMENTS = ("exp_avg", "exp_avg_sq", "step")
LARGEST_GRADIENT = 1.0  # norm; a longer gradient is shortened


class AdamTraining:
    """A network and its optimiser; `state` has every number that the next step depends on."""

    def __init__(self, network: torch.nn.Module):
        self.network = network
        self.optimiser = torch.optim.Adam(self.network.parameters())
        for parameter in self.network.parameters():
            self.optimiser.state[parameter] = {
                "exp_avg": torch.zeros_like(parameter),
                "exp_avg_sq": torch.zeros_like(parameter),
                "step": torch.zeros(()),
            }

    def step(self, loss: torch.Tensor, rate: float) -> None:
        """One step of Adam at this learning rate."""
        self.optimiser.param_groups[0]["lr"] = rate
        self.optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), LARGEST_GRADIENT)
        self.optimiser.step()

    def state(self) -> dict[str, np.ndarray]:
        """Copies of weights and moments, by name."""
        moments = {name: tensor.numpy().copy() for name, tensor in self._moments()}
        return self.network.tensors() | moments

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Take over a result of `state`."""
        with torch.no_grad():
            for name, parameter in self.network.named_parameters():
                parameter.copy_(torch.from_numpy(state[name]))
            for name, tensor in self._moments():
                tensor.copy_(torch.from_numpy(state[name]))

    def _moments(self) -> Iterator[tuple[str, torch.Tensor]]:
        for name, parameter in self.network.named_parameters():
            for moment in MOMENTS:
                yield f"{name}.{moment}", self.optimiser.state[parameter][moment]


class AdamTrainer:
    """State of a trainer that is the state of its `training`: weights and moments of Adam."""

    training: AdamTraining

    def state(self) -> dict[str, np.ndarray]:
        """All that the next epoch depends on, by name."""
        return self.training.state()

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Take over a result of `state`."""
        self.training.restore(state)
