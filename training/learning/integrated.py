"""Trains the integrated network (VI.B): a recurrent network on readings, residuals and filters."""

from collections import deque
from collections.abc import Iterator
from itertools import chain, islice
from math import cos, pi
from typing import Any

import numpy as np
import torch
from torch import nn

from auv_fault_env.faults import known_classes
from diagnosers.integrated import Integrated
from diagnosers.networks.integrated_network import Network
from diagnosers.networks.numpy_network import smooth_opinion
from training.learning.adam import AdamTrainer, AdamTraining
from training.learning.episode_sets import (
    LANES,
    EpisodeSet,
    batches,
    mirrored,
    replay_samples,
    simulated_sets,
)
from training.learning.reproducible import one_thread
from training.seeds import SPAN

SETS = 4  # simulated sets of episodes per epoch
VALIDATION_SETS = 2  # to validate and to calibrate on
REPLAY_EPOCHS = 6  # the last, from whose single samples the encoder learns
ENCODER_STEPS = 150  # per set
SETS_PER_STEP = 8  # of the encoder
SAMPLES_PER_SET = 256
ENCODER_EPOCHS = 6  # in which the encoder learns alone
# of Adam at the highest; both rates fall to zero as a cosine over all epochs
ENCODER_RATE = 1e-3
MEMORY_RATE = 2e-3
SEVERITY_WEIGHT = 0.1  # of the severity's likelihood beside the cross-entropy
BANK_WEIGHT = 0.4  # of the bank in the pool of both; chosen on calibration lanes
CALIBRATION_STRIDE = 10  # samples: neighbours are alike


class IntegratedTrainer(AdamTrainer):
    """Cross-entropy of the class and Gaussian likelihood of the severity, at every sample.

    The encoder learns in many small steps from random samples of many episodes: samples of few
    episodes are too much alike, and it would learn them by heart. The memory learns from whole
    episodes behind the encoder. Every second batch is mirrored, port and starboard exchanged.
    """

    epochs = 20
    patience = 20
    data = (
        f"training: {SETS * LANES} episodes of 60 s an epoch, half of them mirrored, half with the "
        "thesis' stimulus, half with random missions and manoeuvres; single, compound, incipient "
        "and intermittent faults and healthy vehicles, default band, noise and disturbance; "
        f"validated and calibrated on {VALIDATION_SETS * LANES} such episodes each, with seeds of "
        "their own"
    )

    def __init__(self, seed: int) -> None:
        self.seed = seed
        with torch.random.fork_rng():
            torch.manual_seed(seed)
            self.training = AdamTraining(Network(classes=known_classes()))
        self.network = self.training.network
        self.validation: list[EpisodeSet] = []
        self.replay: deque[EpisodeSet] = deque(maxlen=REPLAY_EPOCHS * SETS)
        self.next_epoch = -1
        self.sets: Iterator[EpisodeSet] = iter(())

    def epoch(self, number: int) -> dict[str, float]:
        """Train on episodes that depend on (seed, number) alone, and simulate the next ones."""
        random = np.random.default_rng([self.seed, number, 1])
        encoder_losses = []
        memory_losses = []
        if not self.replay:
            self._refill_replay(number)
        with one_thread():
            for k, episodes in enumerate(self._sets_of(number)):
                progress = min((number + k / SETS) / self.epochs, 1.0)
                fall = 0.5 * (1.0 + cos(pi * progress))
                self.replay.append(replay_samples(episodes, k))
                encoder_losses += self._train_encoder(ENCODER_RATE * fall, random)
                if number >= ENCODER_EPOCHS:
                    memory_losses += self._train_memory(episodes, MEMORY_RATE * fall)
        loss = float(np.mean(memory_losses or encoder_losses))
        # the name in the cards of the weights
        return {"loss": loss, "glance_loss": float(np.mean(encoder_losses))}

    def _sets_of(self, number: int) -> Iterator[EpisodeSet]:
        """The sets of an epoch, from an iterator over those of all epochs to come."""
        if number != self.next_epoch:
            epochs = range(number, self.epochs)
            firsts = chain.from_iterable(self._first_seeds(epoch) for epoch in epochs)
            self.sets = simulated_sets("training", firsts)
        self.next_epoch = number + 1
        return islice(self.sets, SETS)

    def _first_seeds(self, number: int) -> list[int]:
        """First seeds of the sets of an epoch."""
        random = np.random.default_rng([self.seed, number])
        return random.integers(SPAN - LANES, size=SETS).tolist()

    def _refill_replay(self, number: int) -> None:
        """Simulate again what an interrupted training had in its replay before this epoch."""
        for earlier in range(max(0, number - REPLAY_EPOCHS), number):
            sets = simulated_sets("training", self._first_seeds(earlier))
            self.replay.extend(replay_samples(episodes, k) for k, episodes in enumerate(sets))

    def _train_encoder(self, rate: float, random: np.random.Generator) -> list[float]:
        """Steps of the encoder on random samples of the replay; their losses."""
        losses = []
        for k in range(ENCODER_STEPS):
            samples = self._random_samples(random)
            if k % 2:
                samples = mirrored(samples)
            _, opinion = self.network.encode(samples.features)
            losses.append(self._step(opinion, samples, rate))
        return losses

    def _random_samples(self, random: np.random.Generator) -> EpisodeSet:
        """Random samples of random sets of the replay."""
        numbers = random.integers(len(self.replay), size=SETS_PER_STEP)
        chosen = []
        for number in numbers:
            samples = self.replay[number]
            places = torch.from_numpy(random.integers(len(samples.label), size=SAMPLES_PER_SET))
            chosen.append([part[places] for part in samples])
        features, label, severity = (torch.cat(parts) for parts in zip(*chosen, strict=True))
        return EpisodeSet(features.float(), label, severity)

    def _train_memory(self, episodes: EpisodeSet, rate: float) -> list[float]:
        """Steps of the memory, each on a batch of whole episodes; their losses."""
        losses = []
        for k, batch in enumerate(batches(episodes)):
            if k % 2:
                batch = mirrored(batch)
            losses.append(self._step(self.outputs(batch), batch, rate))
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
        """Mean negative log-likelihoods of the class, and of the severity of a fault."""
        label = samples.label[..., None]
        of_every_class = self.network.decode(outputs, samples.features)
        log_probability, mean, std = (part.gather(-1, label)[..., 0] for part in of_every_class)
        is_faulty = (samples.label > 0).float()
        severity_loss = 0.5 * ((samples.severity - mean) / std) ** 2 + std.log()
        n_faulty = is_faulty.sum().clamp(min=1.0)
        class_loss = -log_probability.mean()
        return class_loss, (severity_loss * is_faulty).sum() / n_faulty

    def validate(self) -> dict[str, float]:
        """Both losses on the validation seeds."""
        if not self.validation:
            self.validation = list(simulated_sets("validation", validation_seeds()))
        losses = []
        with one_thread(), torch.no_grad():
            for batch in chain.from_iterable(map(batches, self.validation)):
                class_loss, severity_loss = self.losses(self.outputs(batch), batch)
                losses.append((float(class_loss), float(severity_loss)))
        class_loss, severity_loss = np.mean(losses, axis=0).tolist()
        return {"loss": class_loss, "severity_loss": severity_loss}

    def finish(self) -> tuple[Integrated, dict[str, Any]]:
        """The calibrated diagnoser, and its losses on the calibration seeds before and after."""
        network = self.network
        scores = []
        label = []
        network.lean.fill_(BANK_WEIGHT)
        with one_thread(), torch.no_grad():
            for episodes in simulated_sets("calibration", validation_seeds()):
                for batch in batches(episodes):
                    pooled = network.pool_scores(self.outputs(batch), batch.features)
                    scores.append(pooled[::CALIBRATION_STRIDE].flatten(0, 1))
                    label.append(batch.label[::CALIBRATION_STRIDE].flatten())
        before, after = calibrate(network, torch.cat(scores), torch.cat(label))
        figures = {"calibration_loss_before": before, "calibration_loss": after}
        figures["sharpness"] = float(network.sharpness)
        return Integrated(weights=network.tensors(), trained_classes=known_classes()), figures


def validation_seeds() -> list[int]:
    """First seeds of the sets to validate or calibrate on."""
    return [k * LANES for k in range(VALIDATION_SETS)]


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
