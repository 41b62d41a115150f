"""The training loop: epochs with validation, early stop, a log and a checkpoint after each, whatever the trainer."""

import inspect
import math
import shutil
import time
from collections.abc import Iterator
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


def train(
    trainer: Trainer, name: str, seed: int, folder: Path, epochs: int | None = None
) -> Progress:
    """Train to the end, from the checkpoint in `folder` on if there is one; the trainer is left in its best state.

    Parameters
    ----------
    trainer
        A new one, of this seed.
    name, seed
        With the trainer's code the origin of the checkpoint: one of another origin is refused.
    folder
        Holds checkpoint and TensorBoard log; made if missing.
    epochs
        Most epochs; None for the trainer's own number. Fewer change nothing in those that are
        trained.

    Raises
    ------
    `InputError` for a checkpoint that is damaged or of another origin, a place that cannot be written, and for a loss
    that is not finite.
    """
    last = trainer.epochs if epochs is None else epochs
    origin = {"diagnoser": name, "seed": seed, "code": digest(Path(inspect.getfile(type(trainer))))}
    progress = _begun(trainer, folder, origin)
    with (
        _log(folder / LOG, progress) as log,
        tqdm(initial=len(progress.history), total=last, unit="epoch") as bar,
    ):
        while len(progress.history) < last and not _stalled(progress, trainer.patience):
            epoch = _epoch(trainer, len(progress.history))
            progress = progress.after(epoch, trainer.state())
            checkpoint.write(folder, origin, progress)
            _add(log, len(progress.history), epoch)
            bar.set_postfix(
                {part: f"{epoch[part]['loss']:.4g}" for part in ("train", "validation")},
                refresh=False,
            )
            bar.update()
    trainer.restore(progress.best)
    return progress


def _begun(trainer: Trainer, folder: Path, origin: dict[str, Any]) -> Progress:
    """The progress so far; the first checkpoint is written before any work, so that a bad place shows at once."""
    if not (folder / checkpoint.FILE).exists():
        state = trainer.state()
        progress = Progress([], state, state)
        checkpoint.write(folder, origin, progress)
        return progress
    progress = checkpoint.read(folder, origin)
    trainer.restore(progress.current)
    return progress


def _stalled(progress: Progress, patience: int) -> bool:
    return len(progress.history) - progress.best_epoch >= patience


def _epoch(trainer: Trainer, number: int) -> Epoch:
    begin = time.perf_counter()
    epoch = {"train": trainer.epoch(number), "validation": trainer.validate()}
    for part, scalars in epoch.items():
        for name, value in scalars.items():
            if not math.isfinite(value):
                remedy = "training has diverged: take another --seed, or mend the trainer"
                raise refusal(
                    f"{part} {name} of epoch {number + 1}", value, "a finite number", remedy
                )
            scalars[name] = float(value)
    return epoch | {"seconds": time.perf_counter() - begin}


@contextmanager
def _log(folder: Path, progress: Progress) -> Iterator[Any]:
    """A TensorBoard log that begins with the epochs so far: what a killed run has logged may end anywhere."""
    from tensorboard.summary import Writer  # a quarter of a second

    shutil.rmtree(folder, ignore_errors=True)
    with closing(Writer(str(folder))) as log:
        for number, epoch in enumerate(progress.history, start=1):
            _add(log, number, epoch)
        yield log


def _add(log: Any, number: int, epoch: Epoch) -> None:
    for part in ("train", "validation"):
        for name, value in epoch[part].items():
            log.add_scalar(f"{part}/{name}", value, number)
    log.flush()
