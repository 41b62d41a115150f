"""The training loop: epochs with validation, early stop, log and checkpoint, for any trainer."""

import inspect
import math
import shutil
import time
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from tqdm import tqdm

from auv_fault_env.compiling import digest
from auv_fault_env.errors import refusal
from training.learning import checkpoint
from training.learning.checkpoint import LOG, Progress
from training.learning.trainer import Trainer

Epoch = dict[str, Any]
PARTS = ("train", "validation")


def train(
    trainer: Trainer,
    settings: Mapping[str, Any],
    folder: Path,
    epochs: int | None = None,
) -> Progress:
    """Train to the end, from a checkpoint on if there is one; the trainer ends in its best state.

    Parameters
    ----------
    trainer
        A new one, of these settings.
    settings
        All arguments that its states depend on. They are with the trainer's code the origin of the
        checkpoint: one of another origin is refused.
    folder
        Of checkpoint and TensorBoard log; created if it is missing.
    epochs
        Most epochs, by default the trainer's own number; the epochs stay the same. A checkpoint
        with more is refused.
    """
    last = trainer.epochs if epochs is None else epochs
    origin = {**settings, "code": digest(Path(inspect.getfile(type(trainer))))}
    progress = _initial_progress(trainer, folder, origin)
    if len(progress.history) > last:
        allowed = f"at least the {len(progress.history)} of the checkpoint in {folder}"
        remedy = "add --restart to train anew, or choose another --output"
        raise refusal("epochs", last, allowed, remedy)
    bar = tqdm(initial=len(progress.history), total=last, unit="epoch")
    with bar, _tensorboard_log(folder / LOG, progress) as log:
        while len(progress.history) < last and not _is_stalled(progress, trainer.patience):
            epoch = _run_epoch(trainer, len(progress.history))
            progress = progress.after(epoch, trainer.state())
            checkpoint.write(folder, origin, progress)
            _add_epoch(log, len(progress.history), epoch)
            losses = {part: f"{epoch[part]['loss']:.4g}" for part in PARTS}
            bar.set_postfix(losses, refresh=False)
            bar.update()
    trainer.restore(progress.best)
    return progress


def _initial_progress(trainer: Trainer, folder: Path, origin: dict[str, Any]) -> Progress:
    """The progress so far; the first checkpoint precedes all work, to show a bad place at once."""
    if not (folder / checkpoint.FILE).exists():
        state = trainer.state()
        progress = Progress([], state, state)
        checkpoint.write(folder, origin, progress)
        return progress
    progress = checkpoint.read(folder, origin)
    trainer.restore(progress.current)
    return progress


def _is_stalled(progress: Progress, patience: int) -> bool:
    return len(progress.history) - progress.best_epoch >= patience


def _run_epoch(trainer: Trainer, number: int) -> Epoch:
    start = time.perf_counter()
    epoch = {"train": trainer.epoch(number), "validation": trainer.validate()}
    for part, scalars in epoch.items():
        for name, value in scalars.items():
            if not math.isfinite(value):
                thing = f"{part} {name} of epoch {number + 1}"
                remedy = "training has diverged: take another --seed, or correct the trainer"
                raise refusal(thing, value, "a finite number", remedy)
            scalars[name] = float(value)
    return epoch | {"seconds": time.perf_counter() - start}


@contextmanager
def _tensorboard_log(folder: Path, progress: Progress) -> Iterator[Any]:
    """A new TensorBoard log with the epochs so far: that of a killed run may end anywhere."""
    from tensorboard.summary import Writer  # takes a quarter of a second

    shutil.rmtree(folder, ignore_errors=True)
    with closing(Writer(str(folder))) as log:
        for number, epoch in enumerate(progress.history, start=1):
            _add_epoch(log, number, epoch)
        yield log


def _add_epoch(log: Any, number: int, epoch: Epoch) -> None:
    for part in PARTS:
        for name, value in epoch[part].items():
            log.add_scalar(f"{part}/{name}", value, number)
    log.flush()
