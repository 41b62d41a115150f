"""The integrated network in PyTorch, for its training; diagnosers use `numpy_network`."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import torch
from torch import Tensor, nn

from diagnosers.networks.class_list import SHIPPED_CLASSES
from diagnosers.networks.features import EVIDENCE, bank_odds_columns
from diagnosers.networks.numpy_network import (
    LEAST_STD,
    N_MEMORY,
    encoder_widths,
    n_outputs,
)

Tensors = tuple[Tensor, ...]


class Network(nn.Module):
    """Features to class scores and severities: an encoder's opinion, corrected by a memory.

    The encoder sees one sample; its opinion corrects the log odds of the filter bank. The recurrent
    layer sees the encoded samples and the averaged opinion, and adds to the opinion what follows
    from the past. Last, on lanes of its own, the network is calibrated: the weight `lean` of the
    bank in a logarithmic pool of both, one sharpness, and a bias per class.
    `memory` is the kind of the recurrent layer.
    """

    def __init__(
        self,
        memory: type[nn.Module] = nn.GRU,
        classes: Sequence[str] = SHIPPED_CLASSES,
    ):
        super().__init__()
        self.n_classes = len(classes)
        self.bank_odds = bank_odds_columns(self.n_classes)
        layers: list[nn.Module] = []
        for n_inputs, n_out in pairwise(encoder_widths(classes)):
            layers += [nn.Linear(n_inputs, n_out), nn.SiLU()]
        self.encoder = nn.Sequential(*layers)
        self.opinion = nn.Linear(N_MEMORY, n_outputs(self.n_classes))
        self.correction = nn.Linear(N_MEMORY, n_outputs(self.n_classes))
        for layer in (self.opinion, self.correction):
            nn.init.zeros_(layer.weight)
            nn.init.zeros_(layer.bias)
        self.trust = nn.Parameter(torch.full((self.n_classes - 1,), EVIDENCE))
        self.memory = memory(N_MEMORY + self.n_classes, N_MEMORY)
        self.register_buffer("lean", torch.zeros(1))
        self.register_buffer("sharpness", torch.ones(1))
        self.register_buffer("bias", torch.zeros(self.n_classes))

    def encode(self, features: Tensor) -> Tensors:
        """Encoded samples (..., n_memory) and the first opinion on each (..., 3 n_classes)."""
        encoded = self.encoder(features)
        odds = self.trust * features[..., self.bank_odds]
        bank = nn.functional.pad(odds, (1, 2 * self.n_classes))
        return encoded, self.opinion(encoded) + bank

    def recur(self, encoded: Tensor, opinion: Tensor, units: Tensor | None = None) -> Tensors:
        """Outputs (n_samples, n_lanes, 3 n_classes) from encodings and mean opinions; units."""
        scores = opinion[..., : self.n_classes] / EVIDENCE
        inputs = torch.cat([encoded, scores], dim=-1)
        remembered, units = self.memory(inputs, units)
        return opinion + self.correction(remembered), units

    def pool_scores(self, outputs: Tensor, features: Tensor) -> Tensor:
        """Uncalibrated scores (..., n_classes): the network's and `lean` times the bank's odds."""
        odds = EVIDENCE * features[..., self.bank_odds]
        bank = nn.functional.pad(odds, (1, 0))
        return outputs[..., : self.n_classes] + self.lean * bank

    def decode(self, outputs: Tensor, features: Tensor) -> Tensors:
        """Log probability, severity mean and standard deviation, each (..., n_classes)."""
        _, severity, scatter = outputs.split(self.n_classes, dim=-1)
        scores = self.sharpness * self.pool_scores(outputs, features) + self.bias
        log_probability = torch.log_softmax(scores, dim=-1)
        std = nn.functional.softplus(scatter) + LEAST_STD
        return log_probability, torch.sigmoid(severity), std

    def tensors(self) -> dict[str, np.ndarray]:
        """A copy of weights and calibration, by name."""
        state = self.state_dict()
        return {name: tensor.detach().numpy().copy() for name, tensor in state.items()}
