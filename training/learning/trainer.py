"""The interface of a trainer, and the trainers by the name of their diagnoser."""

import pkgutil
from typing import Any, Protocol

import numpy as np

from auv_fault_env.errors import known_name, refusal
from diagnosers import Recursive
from training.logged_vehicle import LoggedVehicle


class Trainer(Protocol):
    """Trains one diagnoser, epoch by epoch; the loop in `training.learning.loop` does the rest.

    It may be killed at any moment: a new trainer of the same seed with the old `state()`, through
    `restore`, must continue bit for bit. So `state()` has all that outlives an epoch; a running
    random generator must not.
    """

    epochs: int  # most epochs to train; a run may have fewer, which are the same
    patience: int  # the training stops after so many epochs without a better validation loss
    data: str  # for the card: the data for training, validation and calibration

    def __init__(self, seed: int) -> None:
        """Initial weights from the seed (0 or larger) alone; fast, without simulations.

        The trainer of a network also takes the `LoggedVehicle` to simulate.
        """
        ...

    def epoch(self, number: int) -> dict[str, float]:
        """Train an epoch on data that depend on (seed, number) alone; finite scalars to log.

        Numbers start at 0. The training loss ``loss`` should be comparable with that of `validate`.
        """
        ...

    def validate(self) -> dict[str, float]:
        """Finite scalars to log, from the validation seeds; the lowest ``loss`` is the best."""
        ...

    def state(self) -> dict[str, np.ndarray]:
        """All that the next epoch depends on, by name; later epochs must not change it."""
        ...

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Take over a result of `state`, with the same names, order, dtypes and shapes."""
        ...

    def finish(self) -> tuple[Recursive, dict[str, Any]]:
        """Calibrate on calibration seeds; the trained diagnoser and figures for its card.

        Called once, in the best state. The figures are plain data for JSON, without NaN.
        """
        ...


TRAINERS: dict[str, str] = {
    "raw_network": "training.learning.raw_network:RawNetworkTrainer",
    "kalman_network": "training.learning.kalman_network:KalmanNetworkTrainer",
    "integrated": "training.learning.integrated:IntegratedTrainer",
    "residuals": "training.learning.residuals:ResidualsTrainer",
}
NETWORKS = ("integrated", "raw_network", "kalman_network")


def make_trainer(name: str, seed: int, vehicle: LoggedVehicle | None = None) -> Trainer:
    """A new trainer by the name of its diagnoser, of a vehicle or of the thesis' one.

    A name without a trainer is refused, with a vehicle that of fitted relations, too.
    """
    target = TRAINERS[known_name("diagnoser to train", name, TRAINERS)]
    trainer = pkgutil.resolve_name(target)
    if vehicle is None:
        return trainer(seed)
    if name not in NETWORKS:
        allowed = f"a network with --vehicle: {', '.join(NETWORKS)}"
        remedy = "its relations are fitted by auv-fault calibrate"
        raise refusal("diagnoser to train", name, allowed, remedy)
    return trainer(seed, vehicle)
