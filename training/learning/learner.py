"""One network in training, on features that it may share with others."""

from collections.abc import Iterable, Sequence
from itertools import chain
from typing import Any

import numpy as np
import torch
from torch import nn

from auv_fault_env.faults import classes
from diagnosers.networks.integrated_network import Network
from diagnosers.networks.numpy_network import smooth_opinion
from training.learning.adam import AdamTraining
from training.learning.episode_sets import EpisodeSet, batches, mirrored

ENCODER_STEPS = 150  # per set
SETS_PER_STEP = 8  # of the encoder
SAMPLES_PER_SET = 256
# of Adam at the highest
ENCODER_RATE = 1e-3
MEMORY_RATE = 2e-3
SEVERITY_WEIGHT = 0.1  # of the severity's likelihood beside the cross-entropy
BANK_WEIGHT = 0.4  # of the bank in the pool of both; chosen on calibration lanes
CALIBRATION_STRIDE = 10  # samples: neighbours are alike


class Learner:
    """Cross-entropy of the class and Gaussian likelihood of the severity, at every sample.

    The encoder learns in many small steps from random samples of many episodes: samples of few
    episodes are too much alike, and it would learn them by heart. The memory learns from whole
    episodes behind the encoder. Every second batch is mirrored, port and starboard exchanged, if
    the vehicle is symmetric. `normal` and `unknown` have no severity.
    """

    def __init__(self, seed: int, is_symmetric: bool = True) -> None:
        self.seed = seed
        self.is_symmetric = is_symmetric
        with torch.random.fork_rng():
            torch.manual_seed(seed)
            self.training = AdamTraining(Network(classes=classes()))
        self.network = self.training.network

    def train_encoder(
        self, replay: Sequence[EpisodeSet], fall: float, random: np.random.Generator
    ) -> list[float]:
        """Steps of the encoder on random samples of the replay; their losses."""
        losses = []
        for k in range(ENCODER_STEPS):
            samples = random_samples(replay, random)
            if k % 2 and self.is_symmetric:
                samples = mirrored(samples)
            _, opinion = self.network.encode(samples.features)
            losses.append(self._step(opinion, samples, ENCODER_RATE * fall))
        return losses

    def train_memory(
        self, episodes: EpisodeSet, fall: float, random: np.random.Generator
    ) -> list[float]:
        """Steps of the memory, each on a batch of whole episodes; their losses."""
        losses = []
        for k, batch in enumerate(batches(episodes, random)):
            if k % 2 and self.is_symmetric:
                batch = mirrored(batch)
            losses.append(self._step(self.outputs(batch), batch, MEMORY_RATE * fall))
        return losses

    def _step(self, outputs: torch.Tensor, samples: EpisodeSet, rate: float) -> float:
        """One step down both losses; the loss of the class."""
        class_loss, severity_loss = self.losses(outputs, samples)
        self.training.step(class_loss + SEVERITY_WEIGHT * severity_loss, rate)
        return class_loss.item()

    def outputs(self, episodes: EpisodeSet) -> torch.Tensor:
        """Outputs (n_samples, n_lanes, 3 n_classes), without a gradient for the encoder."""
        with torch.no_grad():
            encoded, opinions = self.network.encode(episodes.features)
            for k in range(1, len(opinions)):
                opinions[k] = smooth_opinion(opinions[k], opinions[k - 1])
        outputs, _ = self.network.recur(encoded, opinions)
        return outputs

    def losses(
        self, outputs: torch.Tensor, samples: EpisodeSet
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Mean negative log-likelihoods of the class, and of the severity of a known fault."""
        label = samples.label[..., None]
        of_every_class = self.network.decode(outputs, samples.features)
        log_probability, mean, std = (part.gather(-1, label)[..., 0] for part in of_every_class)
        unknown = self.network.n_classes - 1
        has_severity = ((samples.label > 0) & (samples.label < unknown)).float()
        severity_loss = 0.5 * ((samples.severity - mean) / std) ** 2 + std.log()
        n_graded = has_severity.sum().clamp(min=1.0)
        class_loss = -log_probability.mean()
        return class_loss, (severity_loss * has_severity).sum() / n_graded

    def validate(self, sets: Iterable[EpisodeSet]) -> tuple[float, float]:
        """Both losses on these sets."""
        losses = []
        with torch.no_grad():
            for batch in chain.from_iterable(map(batches, sets)):
                class_loss, severity_loss = self.losses(self.outputs(batch), batch)
                losses.append((float(class_loss), float(severity_loss)))
        return tuple(np.mean(losses, axis=0).tolist())

    def calibrate(self, sets: Iterable[EpisodeSet]) -> dict[str, Any]:
        """Fit what the network has for that on these sets; the losses before and after."""
        network = self.network
        network.lean.fill_(BANK_WEIGHT)
        scores = []
        label = []
        with torch.no_grad():
            for batch in chain.from_iterable(map(batches, sets)):
                pooled = network.pool_scores(self.outputs(batch), batch.features)
                scores.append(pooled[::CALIBRATION_STRIDE].flatten(0, 1))
                label.append(batch.label[::CALIBRATION_STRIDE].flatten())
        before, after = calibrate(network, torch.cat(scores), torch.cat(label))
        figures = {"calibration_loss_before": before, "calibration_loss": after}
        return figures | {"sharpness": float(network.sharpness)}


def random_samples(replay: Sequence[EpisodeSet], random: np.random.Generator) -> EpisodeSet:
    """Random samples of random sets of the replay."""
    numbers = random.integers(len(replay), size=SETS_PER_STEP)
    chosen = []
    for number in numbers:
        samples = replay[number]
        places = torch.from_numpy(random.integers(len(samples.label), size=SAMPLES_PER_SET))
        chosen.append([part[places] for part in samples])
    features, label, severity = (torch.cat(parts) for parts in zip(*chosen, strict=True))
    return EpisodeSet(features.float(), label, severity)


def calibrate(network: Network, scores: torch.Tensor, label: torch.Tensor) -> tuple[float, float]:
    """Fit sharpness and bias of the network; returns the losses before and after.

    Scores (n, n_classes) and label (n,) are of lanes that are not trained on.
    """
    sharpness = torch.ones(1, requires_grad=True)
    bias = torch.zeros(scores.shape[1], requires_grad=True)
    optimiser = torch.optim.LBFGS([sharpness, bias], max_iter=100, line_search_fn="strong_wolfe")

    def loss() -> torch.Tensor:
        optimiser.zero_grad()
        cross_entropy = nn.functional.cross_entropy(sharpness * scores + bias, label)
        cross_entropy.backward()
        return cross_entropy

    before = optimiser.step(loss).item()
    with torch.no_grad():
        network.sharpness.copy_(sharpness)
        network.bias.copy_(bias)
    return before, loss().item()
