"""The thesis' second recommendation (VI.B): one network on the sensors and on what the Kalman filters make of them."""

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np
import torch
from torch import nn

from auv_fault_env.faults import classes
from auv_fault_env.parameters import PRESETS
from diagnosers import storage
from diagnosers.diagnoser import Belief, Recursive
from diagnosers.features import BANK_ODDS, EVIDENCE, FEATURES, Features, FeatureState

WEIGHTS = storage.WEIGHTS / "integrated.safetensors"
CLASSES = classes()
N_CLASSES = len(CLASSES)
N_HIDDEN, N_MEMORY, N_HEAD = 128, 64, 96
LEAST_STD = 0.02  # of a severity: finer than anybody can know it


class Network(nn.Module):
    """Features to class scores and severities, with a recurrent layer in between; see `outputs`.

    An encoder of two layers sees one sample, the recurrent layer of `N_MEMORY` units what came before, and the head
    both; what it says is added to the log odds of the filter bank, which the network so corrects. Calibration (one temperature, a bias per class) is learnt last, on lanes of its own.
    """

    def __init__(self, memory: type[nn.Module] = nn.GRU):
        super().__init__()
        self.encoder = nn.Sequential(
            nn.Linear(len(FEATURES), N_HIDDEN), nn.SiLU(), nn.Linear(N_HIDDEN, N_MEMORY), nn.SiLU()
        )
        self.memory = memory(N_MEMORY, N_MEMORY)
        self.head = nn.Sequential(nn.Linear(2 * N_MEMORY, N_HEAD), nn.SiLU(), nn.Linear(N_HEAD, 3 * N_CLASSES))
        self.trust = nn.Parameter(torch.full((N_CLASSES - 1,), EVIDENCE))
        self.register_buffer("sharpness", torch.ones(1))
        self.register_buffer("bias", torch.zeros(N_CLASSES))

    def forward(self, features: torch.Tensor, memory: torch.Tensor | None = None) -> tuple[torch.Tensor, torch.Tensor]:
        """Outputs (n_samples, n_lanes, 3 n_classes) of features (n_samples, n_lanes, n_features), and the memory."""
        encoded = self.encoder(features)
        recalled, memory = self.memory(encoded, memory)
        bank = nn.functional.pad(self.trust * features[..., BANK_ODDS], (1, 2 * N_CLASSES))
        return self.head(torch.cat([encoded, recalled], dim=-1)) + bank, memory

    def read(self, raw: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Log probability, severity mean and standard deviation, each (..., n_classes), of raw outputs."""
        scores, mean, spread = raw.split(N_CLASSES, dim=-1)
        log_probability = torch.log_softmax(self.sharpness * scores + self.bias, dim=-1)
        return log_probability, torch.sigmoid(mean), nn.functional.softplus(spread) + LEAST_STD

    def tensors(self) -> dict[str, np.ndarray]:
        """A copy of weights and calibration, by name."""
        return {name: tensor.detach().numpy().copy() for name, tensor in self.state_dict().items()}


def network_of(tensors: Mapping[str, np.ndarray], origin: str | Path) -> Network:
    """The network with these tensors, if they have its architecture; else refused in one line."""
    network = Network()
    shapes = {name: tuple(tensor.shape) for name, tensor in network.state_dict().items()}
    checked = storage.checked(origin, tensors, shapes)
    network.load_state_dict({name: torch.from_numpy(tensor.copy()) for name, tensor in checked.items()})
    return network.requires_grad_(False).eval()


class IntegratedState(NamedTuple):
    """State of the features, and the network's memory (n_lanes, n_memory) float32."""

    features: FeatureState
    memory: np.ndarray


class Integrated(Recursive):
    """A recurrent network on readings, motor and surge residuals, and the filters' estimates, innovations, variances.

    Trained on simulated vehicles (``auv-fault train integrated``; see the card beside the weights), on every sample of
    faulty, compound and healthy episodes of 60 s. An unknown fault shows as a belief that is neither `normal` nor any
    one class: `diagnosers.decide` calls it so.

    When it misleads: on vehicles, noise or faults far from those it was trained on, its probabilities are no
    frequencies. Left and right are learnt separately, and may differ in quality by chance.
    """

    name: ClassVar[str] = "integrated"
    classes = CLASSES

    def __init__(self, weights: str | Path | Mapping[str, np.ndarray] = WEIGHTS):
        given = isinstance(weights, Mapping)
        tensors, origin = (weights, "the network") if given else (storage.read(weights)[0], weights)
        self._network = network_of(tensors, origin)
        self._features = Features(PRESETS["thesis1992"])

    def initial(self, n_lanes: int) -> IntegratedState:
        """Filters at their start, an empty memory."""
        return IntegratedState(self._features.initial(n_lanes), np.zeros((n_lanes, N_MEMORY), np.float32))

    def step(self, state: IntegratedState, observation: np.ndarray) -> tuple[IntegratedState, Belief]:
        """The next state and the belief."""
        following, features = self._features.step(state.features, observation)
        with torch.inference_mode():
            memory = torch.from_numpy(state.memory)[None]
            raw, memory = self._network(torch.from_numpy(features)[None], memory)
            belief = [part[0].numpy().astype(np.float64) for part in self._network.read(raw)]
        for severity in belief[1:]:
            severity[:, 0] = 0.0
        belief[0] -= np.logaddexp.reduce(belief[0], axis=1, keepdims=True)
        return IntegratedState(following, memory[0].numpy().copy()), Belief(*belief)

    def tensors(self) -> dict[str, np.ndarray]:
        """Weights and calibration, by name."""
        return self._network.tensors()
