"""Trains the integrated network (VI.B): a recurrent network on readings, residuals and filters."""

from collections import deque
from collections.abc import Iterable, Iterator
from itertools import chain, islice
from math import cos, pi
from typing import Any

import numpy as np

from auv_fault_env.faults import classes
from diagnosers.integrated import Integrated
from training.learning.episode_sets import (
    LANES,
    EpisodeSet,
    replay_samples,
    simulated_sets,
)
from training.learning.episodes import KINDS
from training.learning.learner import Learner
from training.learning.reproducible import one_thread
from training.logged_vehicle import THESIS, LoggedVehicle
from training.seeds import SPAN

SETS = 4  # simulated sets of episodes per epoch
VALIDATION_SETS = 2  # to validate and to calibrate on
REPLAY_EPOCHS = 6  # the last, from whose single samples the encoder learns
ENCODER_EPOCHS = 6  # in which the encoder learns alone


class IntegratedTrainer:
    """An encoder, then a memory behind it, with learning rates that fall to zero as a cosine."""

    epochs = 16
    patience = 16
    data = (
        f"training: {SETS * LANES} episodes of 60 s an epoch, half of them mirrored, {KINDS}; "
        "single, compound, incipient, intermittent, repaired and unknown faults, healthy vehicles, "
        "default band, noise and disturbance; "
        f"validated and calibrated on {VALIDATION_SETS * LANES} such episodes each, with seeds of "
        "their own"
    )

    def __init__(self, seed: int, vehicle: LoggedVehicle = THESIS) -> None:
        self.seed = seed
        self.vehicle = vehicle
        self.learner = Learner(seed, vehicle.is_symmetric)
        self.validation: list[EpisodeSet] = []
        self.replay: deque[EpisodeSet] = deque(maxlen=REPLAY_EPOCHS * SETS)
        self.next_epoch = -1
        self.sets: Iterator[EpisodeSet] = iter(())

    def epoch(self, number: int) -> dict[str, float]:
        """Train on episodes that depend on (seed, number) alone, and simulate the next ones."""
        encoder_losses = []
        memory_losses = []
        if not self.replay:
            self._refill_replay(number)
        random = np.random.default_rng([self.seed, number, 1])
        with one_thread():
            for k, episodes in enumerate(self._sets_of(number)):
                progress = min((number + k / SETS) / self.epochs, 1.0)
                fall = 0.5 * (1.0 + cos(pi * progress))
                self.replay.append(replay_samples(episodes, k))
                encoder_losses += self.learner.train_encoder(self.replay, fall, random)
                if number >= ENCODER_EPOCHS:
                    memory_losses += self.learner.train_memory(episodes, fall, random)
        loss = float(np.mean(memory_losses or encoder_losses))
        # the name in the cards of the weights
        return {"loss": loss, "glance_loss": float(np.mean(encoder_losses))}

    def _sets_of(self, number: int) -> Iterator[EpisodeSet]:
        """The sets of an epoch, from an iterator over those of all epochs to come."""
        if number != self.next_epoch:
            epochs = range(number, self.epochs)
            firsts = chain.from_iterable(self._first_seeds(epoch) for epoch in epochs)
            self.sets = self._simulated("training", firsts)
        self.next_epoch = number + 1
        return islice(self.sets, SETS)

    def _simulated(self, purpose: str, firsts: Iterable[int]) -> Iterator[EpisodeSet]:
        """The sets that begin at these seeds, of the vehicle."""
        return simulated_sets(purpose, firsts, self.vehicle)

    def _first_seeds(self, number: int) -> list[int]:
        """First seeds of the sets of an epoch."""
        random = np.random.default_rng([self.seed, number])
        return random.integers(SPAN - LANES, size=SETS).tolist()

    def _refill_replay(self, number: int) -> None:
        """Simulate again what an interrupted training had in its replay before this epoch."""
        for earlier in range(max(0, number - REPLAY_EPOCHS), number):
            sets = self._simulated("training", self._first_seeds(earlier))
            self.replay.extend(replay_samples(episodes, k) for k, episodes in enumerate(sets))

    def validate(self) -> dict[str, float]:
        """Both losses on the validation seeds."""
        if not self.validation:
            self.validation = list(self._simulated("validation", validation_seeds()))
        with one_thread():
            class_loss, severity_loss = self.learner.validate(self.validation)
        return {"loss": class_loss, "severity_loss": severity_loss}

    def state(self) -> dict[str, np.ndarray]:
        """Weights and moments, by name."""
        return self.learner.training.state()

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Take over a result of `state`."""
        self.learner.training.restore(state)

    def finish(self) -> tuple[Integrated, dict[str, Any]]:
        """The network, calibrated, and the losses of the calibration."""
        sets = list(self._simulated("calibration", validation_seeds()))
        with one_thread():
            figures = self.learner.calibrate(sets)
        vehicle = self.vehicle
        weights = self.learner.network.tensors()
        return Integrated(vehicle.vehicle, weights, classes(), vehicle.bank), figures


def validation_seeds() -> list[int]:
    """First seeds of the sets to validate or calibrate on."""
    return [k * LANES for k in range(VALIDATION_SETS)]
