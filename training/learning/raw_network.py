"""Trains the thesis' network on unprocessed data (V.C): 4-6-4, weights shared by both shafts."""

from math import cos, pi
from typing import Any

import numpy as np
import torch

from auv_fault_env.parameters import full_scale_factors
from diagnosers.networks.feed_forward import FeedForward, random_tensors
from diagnosers.networks.modes import class_shares
from diagnosers.raw_network import (
    ARCHITECTURE,
    HYPOTHESES,
    RawNetwork,
    inputs,
    labels,
    scores,
)
from training.learning.adam import AdamTrainer, AdamTraining
from training.learning.episodes import KINDS, training_episodes, without_gaps
from training.logged_vehicle import THESIS, LoggedVehicle
from training.seeds import SPAN

LANES = 1024  # episodes of an epoch
STRIDE = 8  # one sample in so many is used: neighbours are alike
BATCH = 1024
UNITS = ("V", "A", "rpm", "m/s")  # of the inputs
RATE = 0.01  # of Adam at the start; falls to zero as a cosine over all epochs


class RawNetworkTrainer(AdamTrainer):
    """Cross-entropy of the belief over all classes, on random samples of episodes.

    The thesis trains on squared error with four modes only. Here the loss is the negative
    log-probability of the true class in the diagnoser's belief, so that the belief is calibrated.
    The data have the faults that are missing in Table 5.1, too; where these show, they lower the
    probability of `normal`. On another vehicle it learns from readings relative to full scale, and
    the weights of the inputs take the scale over at the end.
    """

    epochs = 60
    patience = 15
    data = (
        f"training: {LANES} episodes of 60 s an epoch, {KINDS}; default faults, band and noise, "
        f"one sample in {STRIDE}; validated likewise; no calibration needed"
    )

    def __init__(self, seed: int, vehicle: LoggedVehicle = THESIS) -> None:
        self.seed = seed
        self.vehicle = vehicle
        factors = full_scale_factors(vehicle.vehicle)
        self.scale = np.array([factors[unit] for unit in UNITS], np.float32)
        self.training = AdamTraining(FeedForward(random_tensors(ARCHITECTURE, seed)))
        with np.errstate(divide="ignore"):
            log_shares = np.log(class_shares(labels(), tuple(HYPOTHESES)))
        self.log_shares = torch.from_numpy(log_shares).float().T.contiguous()
        self.validation: tuple[np.ndarray, np.ndarray] | None = None

    def epoch(self, number: int) -> dict[str, float]:
        """Train on episodes and in an order that depend on (seed, number) alone."""
        random = np.random.default_rng([self.seed, number])
        first = int(random.integers(SPAN - LANES))
        observations, label = samples("training", LANES, first, random, self.vehicle)
        order = random.permutation(len(label))
        batches = np.array_split(order, len(label) // BATCH)
        losses = []
        for k, batch in enumerate(batches):
            progress = min((number + k / len(batches)) / self.epochs, 1.0)
            rate = RATE * 0.5 * (1.0 + cos(pi * progress))
            loss = self.loss(observations[batch], label[batch])
            self.training.step(loss, rate)
            losses.append(loss.item())
        return {"loss": float(np.mean(losses))}

    def loss(self, observations: np.ndarray, label: np.ndarray) -> torch.Tensor:
        """Mean negative log-probability of the true classes (n,), from (n, n_channels)."""
        network_inputs = torch.from_numpy(inputs(observations).astype(np.float32) / self.scale)
        outputs = self.training.network(network_inputs)
        log_modes = torch.log_softmax(scores(outputs), dim=1)
        log_shares = self.log_shares[torch.from_numpy(label)]
        log_probability = torch.logsumexp(log_modes + log_shares, dim=1)
        return -log_probability.mean()

    def validate(self) -> dict[str, float]:
        """The same loss on the validation seeds."""
        if self.validation is None:
            random = np.random.default_rng(0)
            self.validation = samples("validation", LANES, 0, random, self.vehicle)
        observations, label = self.validation
        with torch.inference_mode():
            loss = self.loss(observations, label)
        return {"loss": loss.item()}

    def finish(self) -> tuple[RawNetwork, dict[str, Any]]:
        """The diagnoser, and its loss on the calibration seeds."""
        random = np.random.default_rng(0)
        observations, label = samples("calibration", LANES, 0, random, self.vehicle)
        with torch.inference_mode():
            loss = self.loss(observations, label)
        tensors = self.training.network.tensors()
        tensors["hidden_weight"] /= self.scale
        return RawNetwork(tensors), {"calibration_loss": loss.item()}


def samples(
    purpose: str,
    n_lanes: int,
    first: int,
    random: np.random.Generator,
    vehicle: LoggedVehicle = THESIS,
) -> tuple[np.ndarray, np.ndarray]:
    """Random samples of training episodes: observations (n, n_channels) and classes (n,)."""
    parts = []
    for rollout in training_episodes(purpose, n_lanes, first, vehicle=vehicle):
        chosen = random.uniform(size=rollout.label.shape) < 1.0 / STRIDE
        parts.append((without_gaps(rollout.observations)[chosen], rollout.label[chosen]))
    observations, label = zip(*parts, strict=True)
    return np.concatenate(observations), np.concatenate(label)
