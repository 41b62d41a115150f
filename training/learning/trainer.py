"""What the training loop asks of a trainer, and the trainers by the name of their diagnoser."""

import pkgutil
from typing import Any, Protocol

import numpy as np

from auv_fault_env.errors import known_name
from diagnosers import Recursive


class Trainer(Protocol):
    """Trains one diagnoser, epoch by epoch; the loop in `training.learning.loop` owns everything else.

    The loop logs, keeps the best state, stops early, and writes a checkpoint after every epoch. It
    can be killed at any moment: a new trainer of the same seed that is given `state()` by `restore`
    must go on bit for bit as the old one would have. So nothing may outlive an epoch that is not in
    `state()`, no running random generator either.
    """

    epochs: int
    """Most epochs to train; a run can be asked for fewer, which changes nothing in those that it does."""
    patience: int
    """Stop after so many epochs in a row without a better validation loss."""
    data: str
    """One sentence for the card: the data it learns from, is validated on, and is calibrated on."""

    def __init__(self, seed: int) -> None:
        """Initial weights from the seed (0 or larger) alone; quick, episodes are simulated later."""
        ...

    def epoch(self, number: int) -> dict[str, float]:
        """Train epoch `number` (from 0) on data that depend on (seed, number) alone; finite scalars to log.

        The entry ``loss`` is the training loss; it should be comparable with that of `validate`.
        """
        ...

    def validate(self) -> dict[str, float]:
        """Finite scalars to log, from the validation seeds; the entry ``loss`` decides, lower is better."""
        ...

    def state(self) -> dict[str, np.ndarray]:
        """Weights, optimiser, everything that the next epoch depends on, by name; later epochs must not change it."""
        ...

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Take over what `state` gave; exactly its names in their order, dtypes and shapes come back."""
        ...

    def finish(self) -> tuple[Recursive, dict[str, Any]]:
        """Calibrate on calibration seeds, then give the diagnoser with what it has learnt and figures for its card.

        Called once, after the best state has been restored. The figures are plain data that JSON
        takes, without NaN.
        """
        ...


TRAINERS: dict[str, str] = {
    "raw_network": "training.learning.raw_network:RawNetworkTrainer",
    "kalman_network": "training.learning.kalman_network:KalmanNetworkTrainer",
    "integrated": "training.learning.integrated:IntegratedTrainer",
}


def trainer_of(name: str, seed: int) -> Trainer:
    """A new trainer by the name of its diagnoser; a name that is unknown or does not learn is refused."""
    return pkgutil.resolve_name(TRAINERS[known_name("diagnoser to train", name, TRAINERS)])(seed)
