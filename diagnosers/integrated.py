"""The thesis' second recommendation (VI.B): one network on the sensors and on what the Kalman filters make of them."""

from dataclasses import asdict
from itertools import pairwise
from typing import Any, NamedTuple, TypeVar

import numpy as np
import torch
from torch import nn

from auv_fault_env.faults import classes
from auv_fault_env.parameters import SAMPLE_TIME, Vehicle, vehicle_of
from diagnosers import storage
from diagnosers.diagnoser import Belief, Recursive
from diagnosers.features import BANK_ODDS, EVIDENCE, FEATURES, Features, FeatureState
from diagnosers.networks import Weights, tensors_of

PACKAGED = storage.WEIGHTS / "integrated.safetensors"
Array = TypeVar("Array", np.ndarray, torch.Tensor)
CLASSES = classes()
N_CLASSES = len(CLASSES)
N_OUTPUTS = 3 * N_CLASSES  # score, severity and its spread of every class
WIDTHS = (256, 128)  # of the encoder's hidden layers
N_MEMORY = 64  # units of the recurrent layer, and of the encoder's last
CALM = 0.5  # s, over which the first opinion is averaged: single samples are noisy, and a label must not flicker
SETTLING = 1.0  # s, over which the belief is averaged to say which fault it is
RELEASE = 5.0  # s, in which the odds of any fault fall: a fault that has begun stays, whatever some samples look like
LEAST_STD = 0.02  # of a severity: finer than anybody can know it
LEAST = np.finfo(float).tiny  # share of a fault, so that its logarithm is finite


class Network(nn.Module):
    """Features to class scores and severities: an encoder with a first opinion, and a memory that corrects it.

    The encoder sees one sample; its opinion is added to the log odds of the filter bank, which it so corrects. The
    recurrent layer sees the encoded samples and the averaged opinion, and adds to it what follows from the past.
    Last, on lanes of its own, it is calibrated: how far it leans on the bank once more, as a logarithmic pool of both
    (the bank never forgets a fault, and so steadies the label), one sharpness, and a bias per class.
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

    def look(self, features: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Encoded samples (..., n_memory) and the first opinion of each (..., 3 n_classes)."""
        encoded = self.encoder(features)
        bank = nn.functional.pad(self.trust * features[..., BANK_ODDS], (1, 2 * N_CLASSES))
        return encoded, self.opinion(encoded) + bank

    def recall(
        self, encoded: torch.Tensor, opinion: torch.Tensor, units: torch.Tensor | None = None
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Outputs (n_samples, n_lanes, 3 n_classes) from encoded samples and averaged opinions; and the units after."""
        recalled, units = self.memory(torch.cat([encoded, opinion[..., :N_CLASSES] / EVIDENCE], dim=-1), units)
        return opinion + self.correction(recalled), units

    def pooled(self, outputs: torch.Tensor, features: torch.Tensor) -> torch.Tensor:
        """Scores (..., n_classes) before calibration: the network's own, leaning on the bank's log odds."""
        bank = EVIDENCE * features[..., BANK_ODDS]
        return outputs[..., :N_CLASSES] + self.lean * nn.functional.pad(bank, (1, 0))

    def read(self, outputs: torch.Tensor, features: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Log probability, severity mean and standard deviation, each (..., n_classes)."""
        _, mean, spread = outputs.split(N_CLASSES, dim=-1)
        scores = self.sharpness * self.pooled(outputs, features) + self.bias
        return torch.log_softmax(scores, dim=-1), torch.sigmoid(mean), nn.functional.softplus(spread) + LEAST_STD

    def tensors(self) -> dict[str, np.ndarray]:
        """A copy of weights and calibration, by name."""
        return {name: tensor.detach().numpy().copy() for name, tensor in self.state_dict().items()}


def calmed(opinion: Array, before: Array) -> Array:
    """The opinion averaged over `CALM`, given the average before; (n_lanes, 3 n_classes), of numpy or torch."""
    return before + (opinion - before) * share_of(CALM)


def share_of(time: float) -> float:
    """Share by which a sample moves an average over this time [s]."""
    return SAMPLE_TIME / (SAMPLE_TIME + time)


class Steady(NamedTuple):
    """What steadies the belief: log odds of any fault (n_lanes,), averaged fault probabilities (n_lanes, n_faults).

    The odds rise at once and fall slowly; they are NaN before the first sample.
    """

    odds: np.ndarray
    faults: np.ndarray

    def after(self, log_probability: np.ndarray) -> "Steady":
        """The same one sample later, given that sample's own belief (n_lanes, n_classes)."""
        odds = np.logaddexp.reduce(log_probability[:, 1:], axis=1) - log_probability[:, 0]
        faults = self.faults + share_of(SETTLING) * (np.exp(log_probability[:, 1:]) - self.faults)
        return Steady(np.fmax(odds, self.odds + share_of(RELEASE) * (odds - self.odds)), faults)

    def log_probability(self) -> np.ndarray:
        """The steadied belief, (n_lanes, n_classes)."""
        faults = np.log(np.maximum(self.faults / self.faults.sum(axis=1, keepdims=True), LEAST))
        faulty = faults - np.logaddexp.reduce(faults, axis=1, keepdims=True) - np.logaddexp(0.0, -self.odds)[:, None]
        return np.concatenate([-np.logaddexp(0.0, self.odds)[:, None], faulty], axis=1)


def network_of(weights: Weights) -> Network:
    """The network with these tensors, if they have its architecture; else refused in one line."""
    network = Network()
    shapes = {name: tuple(tensor.shape) for name, tensor in network.state_dict().items()}
    tensors = tensors_of(weights, shapes)
    network.load_state_dict({name: torch.from_numpy(tensor.copy()) for name, tensor in tensors.items()})
    return network.requires_grad_(False).eval()


class IntegratedState(NamedTuple):
    """State of the features; the network's units (n_lanes, n_memory) and calm opinion (n_lanes, 3 n_classes), float32.

    The opinion is NaN before the first sample.
    """

    features: FeatureState
    units: np.ndarray
    opinion: np.ndarray
    steady: Steady


class Integrated(Recursive):
    """A recurrent network on readings, motor and surge residuals, and the filters' estimates, innovations, variances.

    Trained on simulated vehicles (``auv-fault train integrated``; see the card beside the weights), on every sample of
    faulty, compound and healthy episodes of 60 s. An unknown fault shows as a belief that is neither `normal` nor any
    one class: `diagnosers.decide` calls it so.

    When it misleads: on vehicles, noise or faults far from those it was trained on, its probabilities are no
    frequencies. It was trained on episodes of a minute whose faults begin within half of one, and stay: reset it after
    a repair. The odds of a fault fall over seconds at the soonest, so a false alarm lasts. Another nominal ``vehicle``
    changes the filters and residuals, not what the network makes of them.
    """

    name = "integrated"
    classes = CLASSES

    def __init__(self, vehicle: str | Vehicle = "thesis1992", weights: Weights = PACKAGED):
        self.vehicle = vehicle_of(vehicle)
        self._network, self._features = network_of(weights), Features(self.vehicle)

    def initial(self, n_lanes: int) -> IntegratedState:
        """Filters at their start, an empty memory."""
        units, opinion = np.zeros((n_lanes, N_MEMORY), np.float32), np.full((n_lanes, N_OUTPUTS), np.nan, np.float32)
        steady = Steady(np.full(n_lanes, np.nan), np.zeros((n_lanes, N_CLASSES - 1)))
        return IntegratedState(self._features.initial(n_lanes), units, opinion, steady)

    def step(self, state: IntegratedState, observation: np.ndarray) -> tuple[IntegratedState, Belief]:
        """The next state and the belief."""
        following, seen = self._features.step(state.features, observation)
        features = torch.from_numpy(seen)
        with torch.inference_mode():
            encoded, opinion = self._network.look(features)
            opinion = calmed(opinion.numpy(), np.where(np.isnan(state.opinion), opinion, state.opinion))
            calm = torch.from_numpy(opinion)
            outputs, units = self._network.recall(encoded[None], calm[None], torch.from_numpy(state.units)[None])
            told, *severity = (part[0].numpy().astype(float) for part in self._network.read(outputs, features[None]))
        for moment in severity:
            moment[:, 0] = 0.0
        steady = state.steady.after(told)
        belief = Belief(steady.log_probability(), *severity)
        return IntegratedState(following, units[0].numpy(), opinion, steady), belief

    def tensors(self) -> dict[str, np.ndarray]:
        """Weights and calibration, by name."""
        return self._network.tensors()

    def settings(self) -> dict[str, Any]:
        """The nominal vehicle; what has been learnt is in `tensors`."""
        return {"vehicle": asdict(self.vehicle)}
