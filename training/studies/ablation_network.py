"""The network of the ablation, the same for all inputs, and its training."""

from collections.abc import Iterator
from math import cos, pi
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from auv_fault_env.faults import classes
from diagnosers.networks.features import feature_names
from training.learning.adam import AdamTraining
from training.learning.episode_sets import mirror_order
from training.learning.reproducible import one_thread
from training.metrics import confusion, macro_f1, sample_at
from training.studies.ablation_inputs import SAMPLES, FeatureSet, columns

RATE = 3e-3  # of Adam at the start; falls to zero as a cosine over the training
BATCH = 256  # episodes
LANES_AT_ONCE = 512  # of which a network computes the beliefs together


class Architecture(NamedTuple):
    """Of a network: a recurrent layer (GRU) or none, and the nodes of each layer."""

    is_recurrent: bool
    n_nodes: int

    def __str__(self) -> str:
        return f"{'GRU' if self.is_recurrent else 'without memory'}, {self.n_nodes} nodes"


ARCHITECTURES = (Architecture(True, 64), Architecture(True, 32), Architecture(False, 64))


class Network(nn.Module):
    """A layer on the inputs of one half second, a memory, and the scores of all classes."""

    def __init__(self, n_inputs: int, architecture: Architecture):
        super().__init__()
        n_nodes = architecture.n_nodes
        self.encoder = nn.Sequential(nn.Linear(n_inputs, n_nodes), nn.SiLU())
        if architecture.is_recurrent:
            self.memory = nn.GRU(n_nodes, n_nodes)
        else:
            self.memory = nn.Sequential(nn.Linear(n_nodes, n_nodes), nn.SiLU())
        self.scores = nn.Linear(n_nodes, len(classes()))

    def forward(self, inputs: Tensor) -> Tensor:
        """Log probabilities (n_halves, n_lanes, n_classes) from (n_halves, n_lanes, n_inputs)."""
        remembered = self.memory(self.encoder(inputs))
        if isinstance(remembered, tuple):
            remembered = remembered[0]
        return torch.log_softmax(self.scores(remembered), dim=-1)


class Progress(NamedTuple):
    """What a training has reached after so many episodes, counted as often as they were used."""

    episodes: int
    training_loss: float  # mean since the last
    validation_loss: float
    macro_f1: float  # of the most probable classes, on faulty validation lanes


class DecidedLanes(NamedTuple):
    """Features of lanes with one fault each, their class, and when it is decided on (n_lanes,)."""

    features: np.ndarray
    fault: np.ndarray
    decided: np.ndarray  # half second

    @classmethod
    def at(cls, features: np.ndarray, fault: np.ndarray, time: np.ndarray) -> "DecidedLanes":
        """Decided on at a time [s]."""
        return cls(features, fault, (sample_at(time) + 1) // SAMPLES - 1)


class AblationTraining:
    """One network in training on the inputs of a name; the seed decides weights and order."""

    def __init__(self, inputs: str, architecture: Architecture, seed: int):
        self.seed = seed
        self.columns = columns(inputs)
        names = np.array(feature_names(classes()))[self.columns]
        self.mirrored = mirror_order(tuple(names))
        self.mirrored_label = mirror_order(classes())
        with torch.random.fork_rng():
            torch.manual_seed(seed)
            self.training = AdamTraining(Network(len(self.columns), architecture))
        self.network = self.training.network

    def run(
        self,
        episodes: FeatureSet,
        validation: FeatureSet,
        faulty: DecidedLanes,
        passes: int,
        reports: int,
    ) -> Iterator[Progress]:
        """Train over the episodes so many times; yields the progress `reports` times a pass."""
        n_batches = episodes.label.shape[1] // BATCH
        n_steps = passes * n_batches
        report_after = {round(n_batches * k / reports) for k in range(1, reports + 1)}
        losses = []
        for number in range(passes):
            order = np.random.default_rng([self.seed, number]).permutation(n_batches)
            for k, batch in enumerate(order, start=1):
                done = number * n_batches + k
                fall = 0.5 * (1.0 + cos(pi * done / n_steps))
                lanes = slice(batch, None, n_batches)
                loss = self.loss(episodes, lanes, is_mirrored=k % 2 == 0)
                self.training.step(loss, RATE * fall)
                losses.append(loss.item())
                if k in report_after:
                    figures = self.validate(validation, faulty)
                    yield Progress(done * BATCH, float(np.mean(losses)), *figures)
                    losses.clear()

    def loss(self, episodes: FeatureSet, lanes: slice, is_mirrored: bool = False) -> Tensor:
        """Mean negative log-probability of the true class on these lanes."""
        inputs = torch.from_numpy(episodes.features[:, lanes]).float()
        label = torch.from_numpy(episodes.label[:, lanes].astype(np.int64))
        if is_mirrored:
            inputs = inputs[..., self.mirrored]
            label = self.mirrored_label[label]
        log_probability = self.network(inputs)
        return -log_probability.gather(-1, label[..., None]).mean()

    def validate(self, validation: FeatureSet, faulty: DecidedLanes) -> tuple[float, float]:
        """The loss on episodes as in training, and the macro-F1 on faulty lanes."""
        losses = []
        n_lanes = validation.label.shape[1]
        with torch.inference_mode():
            for first in range(0, n_lanes, BATCH):
                losses.append(self.loss(validation, slice(first, first + BATCH)).item())
        log_probability = self.log_probability(faulty.features)
        decision = log_probability.argmax(axis=-1)[faulty.decided, np.arange(len(faulty.fault))]
        matrix = confusion(faulty.fault, decision, len(classes()))
        return float(np.mean(losses)), float(macro_f1(matrix))

    def log_probability(self, features: np.ndarray) -> np.ndarray:
        """Beliefs (n_halves, n_lanes, n_classes) float32 of its inputs of these lanes."""
        parts = []
        with torch.inference_mode(), one_thread():
            for first in range(0, features.shape[1], LANES_AT_ONCE):
                lanes = features[:, first : first + LANES_AT_ONCE]
                parts.append(self.network(torch.from_numpy(lanes).float()).numpy())
        return np.concatenate(parts, axis=1)
