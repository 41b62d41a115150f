"""The integrated network in PyTorch, as it is trained; `diagnosers.integrated` recalls it without."""

from itertools import pairwise

import numpy as np
import torch
from torch import nn

from diagnosers.integrated import LEAST_STD, N_CLASSES, N_MEMORY, N_OUTPUTS, WIDTHS
from diagnosers.networks.features import BANK_ODDS, EVIDENCE, FEATURES


class Network(nn.Module):
    """Features to class scores and severities: an encoder with a first opinion, and a memory that corrects it.

    The encoder sees one sample; its opinion is added to the log odds of the filter bank, which it
    so corrects. The recurrent layer sees the encoded samples and the averaged opinion, and adds to
    it what follows from the past. Last, on lanes of its own, it is calibrated: how far it leans on
    the bank once more, as a logarithmic pool of both (the bank never forgets a fault, and so
    steadies the label), one sharpness, and a bias per class.
    """

    def __init__(self, memory: type[nn.Module] = nn.GRU):
        super().__init__()
        widths = (len(FEATURES), *WIDTHS, N_MEMORY)
        layers = [(nn.Linear(before, after), nn.SiLU()) for before, after in pairwise(widths)]
        self.encoder = nn.Sequential(*(part for layer in layers for part in layer))
        self.opinion, self.correction = (nn.Linear(N_MEMORY, N_OUTPUTS) for _ in range(2))
        for layer in (self.opinion, self.correction):
            nn.init.zeros_(layer.weight)
            nn.init.zeros_(layer.bias)
        self.trust = nn.Parameter(torch.full((N_CLASSES - 1,), EVIDENCE))
        self.memory = memory(N_MEMORY + N_CLASSES, N_MEMORY)
        self.register_buffer("lean", torch.zeros(1))
        self.register_buffer("sharpness", torch.ones(1))
        self.register_buffer("bias", torch.zeros(N_CLASSES))

    def encode(self, features: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Encoded samples (..., n_memory) and the first opinion of each (..., 3 n_classes)."""
        encoded = self.encoder(features)
        bank = nn.functional.pad(self.trust * features[..., BANK_ODDS], (1, 2 * N_CLASSES))
        return encoded, self.opinion(encoded) + bank

    def recur(
        self, encoded: torch.Tensor, opinion: torch.Tensor, units: torch.Tensor | None = None
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Outputs (n_samples, n_lanes, 3 n_classes) from encoded samples and averaged opinions; and the units after."""
        recalled, units = self.memory(
            torch.cat([encoded, opinion[..., :N_CLASSES] / EVIDENCE], dim=-1), units
        )
        return opinion + self.correction(recalled), units

    def pool_scores(self, outputs: torch.Tensor, features: torch.Tensor) -> torch.Tensor:
        """Scores (..., n_classes) before calibration: the network's own, leaning on the bank's log odds."""
        bank = EVIDENCE * features[..., BANK_ODDS]
        return outputs[..., :N_CLASSES] + self.lean * nn.functional.pad(bank, (1, 0))

    def decode(
        self, outputs: torch.Tensor, features: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Log probability, severity mean and standard deviation, each (..., n_classes)."""
        _, mean, spread = outputs.split(N_CLASSES, dim=-1)
        scores = self.sharpness * self.pool_scores(outputs, features) + self.bias
        return (
            torch.log_softmax(scores, dim=-1),
            torch.sigmoid(mean),
            nn.functional.softplus(spread) + LEAST_STD,
        )

    def tensors(self) -> dict[str, np.ndarray]:
        """A copy of weights and calibration, by name."""
        return {name: tensor.detach().numpy().copy() for name, tensor in self.state_dict().items()}
