"""``auv-fault train``: a diagnoser's weights, with a card that tells how they were made and a report.

While it trains, checkpoint and TensorBoard log lie in ``OUTPUT-unfinished``, visible beside the
output; when all is done, the output appears and that folder goes. Whatever breaks a run off, the
same command goes on after the last complete epoch and ends with the same weights, bit for bit. They
are the same on one machine with one number of threads (OMP_NUM_THREADS): another number, or another
processor, adds up in another order.
"""

import os
import shutil
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from safetensors import SafetensorError

from auv_fault_env.errors import finite_in_range, refusal, whole_number
from diagnosers import Recursive, storage
from training.arguments import Train
from training.learning.checkpoint import LOG, Progress, unfinished_folder
from training.learning.loop import train
from training.learning.page import page
from training.learning.trainer import Trainer, trainer_of
from training.report.page import write_report
from training.report.run_folder import (
    checked_output,
    provenance,
    read_manifest,
    run_folder,
    write_json,
)

SETTINGS = ("name", "seed", "epochs")


def main(arguments: Train) -> None:
    """Train, or go on with a training that was broken off; a finished one is left as it is."""
    finite_in_range("seed", arguments.seed, 0, 2**62)
    trainer = trainer_of(arguments.name, arguments.seed)
    if arguments.epochs is not None and whole_number("epochs", arguments.epochs) > trainer.epochs:
        raise refusal("epochs", arguments.epochs, f"1 to {trainer.epochs}", "leave it out for all")
    output = checked_output(arguments.output or Path("runs") / f"train-{arguments.name}")
    unfinished = unfinished_folder(output)
    if arguments.restart:
        shutil.rmtree(unfinished, ignore_errors=True)
    if (
        arguments.restart
        or unfinished.exists()
        or not is_finished(output, "train", arguments, SETTINGS)
    ):
        _run(arguments, trainer, output, unfinished)
        print(f"report: {output / 'index.html'}")
    else:
        print(f"already trained: {output}; --restart trains anew")
    if arguments.install:
        install(output, arguments.name)


def is_finished(output: Path, name: str, arguments: Any, settings: Sequence[str]) -> bool:
    """Whether this very training is at the output; another training there is refused: it may have taken hours.

    `name` is that of the command, `settings` the arguments that make a training what it is.
    """
    manifest = read_manifest(output)
    if manifest is None or manifest["command"] != f"auv-fault {name}":
        return False
    got = {setting: manifest["arguments"][setting] for setting in settings}
    if got != {setting: getattr(arguments, setting) for setting in settings}:
        remedy = "choose another --output, or add --restart to replace it"
        raise refusal(f"training in {output}", got, "that of this command", remedy)
    return True


@contextmanager
def to_be_repeated(output: Path, restart: bool) -> Iterator[None]:
    """Whatever breaks a training off, say that the same command goes on."""
    try:
        yield
    except KeyboardInterrupt:
        same = "the same command without --restart" if restart else "the same command"
        raise KeyboardInterrupt(f"{same} goes on after the last complete epoch") from None
    except (OSError, SafetensorError) as error:
        allowed = f"a place that can be written ({getattr(error, 'strerror', None) or error})"
        raise refusal(
            "output", str(output), allowed, "make room and repeat the command: it goes on"
        ) from None


def _run(arguments: Train, trainer: Trainer, output: Path, unfinished: Path) -> None:
    with to_be_repeated(output, arguments.restart):
        progress = train(trainer, arguments.name, arguments.seed, unfinished, arguments.epochs)
        begin = time.perf_counter()
        diagnoser, figures = trainer.finish()
        seconds = time.perf_counter() - begin + sum(epoch["seconds"] for epoch in progress.history)
        with run_folder(output, "train", arguments) as folder:
            shutil.copytree(unfinished / LOG, folder / LOG)
            write_run(folder, diagnoser, card(arguments, trainer.data, progress, figures, seconds))
    shutil.rmtree(unfinished, ignore_errors=True)


def card(
    arguments: Train, data: str, progress: Progress, figures: dict[str, Any], seconds: float
) -> dict[str, Any]:
    """How the weights were made: command, seed, data, versions, what it took, and what came out, as plain data."""
    shortened = "" if arguments.epochs is None else f" --epochs {arguments.epochs}"
    return {
        "diagnoser": arguments.name,
        "command": f"auv-fault train {arguments.name} --seed {arguments.seed}{shortened}",
        "seed": arguments.seed,
        "data": data,
        **provenance(),
        "epochs": len(progress.history),
        "best_epoch": progress.best_epoch,
        "seconds": round(seconds, 1),
        "validation": progress.history[progress.best_epoch - 1]["validation"],
        "figures": figures,
        "history": progress.history,
    }


def write_run(folder: Path, diagnoser: Recursive, made: dict[str, Any]) -> None:
    """Write weights, card and report."""
    name = made["diagnoser"]
    diagnoser.save(folder / f"{name}.safetensors")
    write_json(folder / f"{name}.json", made)
    results = page(made)
    write_json(folder / "results.json", results)
    write_report(results, folder)


def install(folder: Path, name: str) -> None:
    """Copy weights and card to where the package looks for them; each file is replaced whole."""
    try:
        storage.WEIGHTS.mkdir(exist_ok=True)
        for file in (f"{name}.safetensors", f"{name}.json"):
            shutil.copyfile(folder / file, storage.WEIGHTS / f".{file}")
            os.replace(storage.WEIGHTS / f".{file}", storage.WEIGHTS / file)
    except OSError as error:
        allowed = f"files and a place that can be written ({error.strerror or error})"
        raise refusal(
            "installing weights", str(storage.WEIGHTS), allowed, f"copy them from {folder}"
        ) from None
    print(f"installed: {storage.WEIGHTS / name}.safetensors and .json")
