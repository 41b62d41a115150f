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

NETWORKS = 3  # of successive seeds, on the same episodes
SETS = 4  # simulated sets of episodes per epoch
VALIDATION_SETS = 2  # to validate and to calibrate on
REPLAY_EPOCHS = 6  # the last, from whose single samples the encoder learns
ENCODER_EPOCHS = 6  # in which the encoder learns alone


class IntegratedTrainer:
    """Several networks, of which the one with the best validation loss is taken.

    They have the episodes in common, which take most of the time; each has its own initial weights
    and order of the samples. What they differ by is what the seed decides. The learning rates fall
    to zero as a cosine over all epochs.
    """

    epochs = 16
    patience = 16
    data = (
        f"training: {SETS * LANES} episodes of 60 s an epoch, half of them mirrored, {KINDS}; "
        "single, compound, incipient, intermittent, repaired and unknown faults, healthy vehicles, "
        "default band, noise and disturbance; "
        f"validated and calibrated on {VALIDATION_SETS * LANES} such episodes each, with seeds of "
        f"their own; the best of {NETWORKS} networks on the same episodes"
    )

    def __init__(self, seed: int, vehicle: LoggedVehicle = THESIS) -> None:
        self.seed = seed
        self.vehicle = vehicle
        self.learners = [Learner(seed + k, vehicle.is_symmetric) for k in range(NETWORKS)]
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
        order = [np.random.default_rng([learner.seed, number, 1]) for learner in self.learners]
        with one_thread():
            for k, episodes in enumerate(self._sets_of(number)):
                progress = min((number + k / SETS) / self.epochs, 1.0)
                fall = 0.5 * (1.0 + cos(pi * progress))
                self.replay.append(replay_samples(episodes, k))
                for learner, random in zip(self.learners, order, strict=True):
                    encoder_losses += learner.train_encoder(self.replay, fall, random)
                    if number >= ENCODER_EPOCHS:
                        memory_losses += learner.train_memory(episodes, fall, random)
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
        """Both losses of the best network on the validation seeds, and the loss of every one."""
        losses = self._validation_losses()
        class_loss, severity_loss = min(losses)
        figures = {"loss": class_loss, "severity_loss": severity_loss}
        for learner, (loss, _) in zip(self.learners, losses, strict=True):
            figures[f"loss_of_seed_{learner.seed}"] = loss
        return figures

    def _validation_losses(self) -> list[tuple[float, float]]:
        """Losses of class and severity of each network."""
        if not self.validation:
            self.validation = list(self._simulated("validation", validation_seeds()))
        with one_thread():
            return [learner.validate(self.validation) for learner in self.learners]

    def state(self) -> dict[str, np.ndarray]:
        """Weights and moments of all networks, by number and name."""
        return {
            f"{k}.{name}": tensor
            for k, learner in enumerate(self.learners)
            for name, tensor in learner.training.state().items()
        }

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Take over a result of `state`."""
        for k, learner in enumerate(self.learners):
            prefix = f"{k}."
            own = {name: state[name] for name in state if name.startswith(prefix)}
            learner.training.restore({name.removeprefix(prefix): own[name] for name in own})

    def finish(self) -> tuple[Integrated, dict[str, Any]]:
        """The best network calibrated, and for all of them the losses on the calibration seeds."""
        validation = self._validation_losses()
        best = validation.index(min(validation))
        sets = list(self._simulated("calibration", validation_seeds()))
        with one_thread():
            calibrated = [learner.calibrate(sets) for learner in self.learners]
        losses = [figures["calibration_loss"] for figures in calibrated]
        seeds = {
            "seed_of_weights": self.learners[best].seed,
            "validation_losses_of_seeds": [loss for loss, _ in validation],
            "calibration_losses_of_seeds": losses,
            "spread_of_calibration_losses": max(losses) - min(losses),
        }
        weights = self.learners[best].network.tensors()
        vehicle = self.vehicle
        diagnoser = Integrated(vehicle.vehicle, weights, classes(), vehicle.bank)
        return diagnoser, calibrated[best] | seeds


def validation_seeds() -> list[int]:
    """First seeds of the sets to validate or calibrate on."""
    return [k * LANES for k in range(VALIDATION_SETS)]
