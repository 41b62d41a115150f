"""The checkpoint of a training: how far it has come, in one file beside the output, for as long as it is unfinished."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from auv_fault_env.errors import InputError, refusal
from diagnosers import storage

FILE = "checkpoint.safetensors"
LOG = "tensorboard"
Tensors = dict[str, np.ndarray]


class Progress(NamedTuple):
    """How far a training has come.

    history: an entry per epoch with seconds and the scalars of train and validation; current and
    best: the trainer's state after the last epoch, and after the one with the lowest validation
    loss (the initial one before the first).
    """

    history: list[dict[str, Any]]
    current: Tensors
    best: Tensors

    @property
    def losses(self) -> list[float]:
        """The validation loss of every epoch."""
        return [epoch["validation"]["loss"] for epoch in self.history]

    @property
    def best_epoch(self) -> int:
        """The epoch with the lowest validation loss, the first of equals, counted from 1; 0 before the first."""
        return self.losses.index(min(self.losses)) + 1 if self.history else 0

    def after(self, epoch: Mapping[str, Any], state: Mapping[str, np.ndarray]) -> "Progress":
        """The progress with one more epoch and the state that it led to."""
        current = {name: np.array(tensor) for name, tensor in state.items()}
        better = epoch["validation"]["loss"] < min(self.losses, default=np.inf)
        return Progress([*self.history, dict(epoch)], current, current if better else self.best)


def unfinished_folder(output: Path) -> Path:
    """The folder of the checkpoint and the log while the training for `output` lasts; a foreign one is refused."""
    folder = output.with_name(f"{output.name}-unfinished")
    foreign = {path.name for path in folder.glob("*") if not path.name.startswith(f".{FILE}-")} - {
        FILE,
        LOG,
    }
    if foreign or (folder.exists() and not folder.is_dir()):
        allowed = "a free place for the checkpoint"
        raise refusal(
            "folder of the unfinished run", str(folder), allowed, "choose another --output"
        )
    return folder


def write(folder: Path, origin: Mapping[str, Any], progress: Progress) -> None:
    """Write the checkpoint, aside first: whenever the process dies, the file is whole, the old or the new one."""
    states = {"current": progress.current, "best": progress.best}
    tensors = {
        f"{kind}/{name}": tensor for kind, state in states.items() for name, tensor in state.items()
    }
    # the file sorts, and knows no scalars
    shapes = [(name, np.shape(tensor)) for name, tensor in tensors.items()]
    storage.write(
        folder / FILE, tensors, {"origin": origin, "history": progress.history, "shapes": shapes}
    )


def read(folder: Path, origin: Mapping[str, Any]) -> Progress:
    """The progress that `write` kept, if it is of the same origin (diagnoser, seed, code); else a refusal."""
    try:
        tensors, header = storage.read(folder / FILE)
        got = header["origin"]
        history = header["history"]
        tensors = {name: tensors[name].reshape(shape) for name, shape in header["shapes"]}
    except (InputError, KeyError, TypeError, ValueError):
        allowed = "a complete checkpoint, and this file is damaged"
        raise refusal(
            "checkpoint", str(folder / FILE), allowed, "add --restart to train anew"
        ) from None
    if got != origin:
        remedy = "add --restart to train anew, or choose another --output"
        raise refusal(
            f"checkpoint in {folder}", got, f"that of this command, {dict(origin)}", remedy
        )
    return Progress(history, _part(tensors, "current/"), _part(tensors, "best/"))


def _part(tensors: Tensors, prefix: str) -> Tensors:
    return {
        name.removeprefix(prefix): tensor
        for name, tensor in tensors.items()
        if name.startswith(prefix)
    }
