"""The checkpoint of an unfinished training: its progress, in one file beside the output."""

import json
import shutil
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
    """The progress of a training; before the first epoch the states are the initial one."""

    history: list[dict[str, Any]]  # per epoch seconds and the scalars of train and validation
    current: Tensors  # the trainer's state after the last epoch
    best: Tensors  # after the epoch with the lowest validation loss

    @property
    def losses(self) -> list[float]:
        """The validation loss of every epoch."""
        return [epoch["validation"]["loss"] for epoch in self.history]

    @property
    def best_epoch(self) -> int:
        """The first epoch with the lowest validation loss, counted from 1; 0 before the first."""
        return self.losses.index(min(self.losses)) + 1 if self.history else 0

    def after(self, epoch: Mapping[str, Any], state: Mapping[str, np.ndarray]) -> "Progress":
        """The progress with one more epoch and the state after it."""
        current = {name: np.array(tensor) for name, tensor in state.items()}
        is_better = epoch["validation"]["loss"] < min(self.losses, default=np.inf)
        best = current if is_better else self.best
        return Progress([*self.history, dict(epoch)], current, best)


def unfinished_folder(output: Path) -> Path:
    """The folder of checkpoint and log until the output is written; a foreign one is refused."""
    folder = output.with_name(f"{output.name}-unfinished")
    names = {path.name for path in folder.glob("*")}
    own = {name for name in names if name in (FILE, LOG) or name.startswith(f".{FILE}-")}
    if names != own or (folder.exists() and not folder.is_dir()):
        allowed = "a free place for the checkpoint"
        raise refusal(
            "folder of the unfinished run",
            str(folder),
            allowed,
            "choose another --output",
        )
    return folder


def write(folder: Path, origin: Mapping[str, Any], progress: Progress) -> None:
    """Write the checkpoint, aside first: whenever the process dies, one whole file is there."""
    tensors = {f"current/{name}": tensor for name, tensor in progress.current.items()}
    tensors |= {f"best/{name}": tensor for name, tensor in progress.best.items()}
    # the file sorts the tensors, and has no scalars
    shapes = [(name, np.shape(tensor)) for name, tensor in tensors.items()]
    # as text, because the header sorts its keys
    history = json.dumps(progress.history)
    header = {"origin": origin, "history": history, "shapes": shapes}
    storage.write(folder / FILE, tensors, header)


def discard(folder: Path) -> None:
    """Remove the folder, the checkpoint first: without it the training is over, or not begun."""
    (folder / FILE).unlink(missing_ok=True)
    shutil.rmtree(folder, ignore_errors=True)


def read(folder: Path, origin: Mapping[str, Any]) -> Progress:
    """The progress in the file; one of another origin (arguments, code) is refused."""
    try:
        tensors, header = storage.read(folder / FILE)
        found_origin = dict(header["origin"])
        history = json.loads(header["history"])
        tensors = {name: tensors[name].reshape(shape) for name, shape in header["shapes"]}
    except (InputError, KeyError, TypeError, ValueError):
        allowed = "a complete checkpoint, and this file is damaged"
        remedy = "add --restart to train anew"
        raise refusal("checkpoint", str(folder / FILE), allowed, remedy) from None
    remedy = "add --restart to train anew, or choose another --output"
    # what only the checkpoint has, such as its vehicle, differs too
    wanted = dict.fromkeys(found_origin) | dict(origin)
    check_origin(f"checkpoint in {folder}", found_origin, wanted, remedy)
    return Progress(history, _with_prefix(tensors, "current/"), _with_prefix(tensors, "best/"))


def check_origin(thing: str, found: Any, wanted: Mapping[str, Any], remedy: str) -> None:
    """Refuse a training of other arguments or code than this command's; only they are shown."""
    found = found if isinstance(found, dict) else {}
    others = [name for name in wanted if name not in found or found[name] != wanted[name]]
    if others:
        asked = {name: wanted[name] for name in others}
        shown = {name: found.get(name) for name in others}
        raise refusal(thing, shown, f"that of this command, {asked}", remedy)


def _with_prefix(tensors: Tensors, prefix: str) -> Tensors:
    own = [name for name in tensors if name.startswith(prefix)]
    return {name.removeprefix(prefix): tensors[name] for name in own}
