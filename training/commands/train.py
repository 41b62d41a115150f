"""``auv-fault train``: the weights of a diagnoser, with their card and a report.

During the training checkpoint and TensorBoard log are in ``OUTPUT-unfinished`` beside the output;
at the end the output appears and that folder disappears. After any interruption the same command
continues after the last complete epoch and ends with the same weights, bit for bit. That holds on
one machine with one number of threads (OMP_NUM_THREADS): another number, or another processor, adds
up in another order.
"""

import os
import shlex
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

from safetensors import SafetensorError

from auv_fault_env.errors import refusal
from diagnosers import Recursive, storage
from training.arguments import Train
from training.field.logged import logged_vehicle
from training.field.vehicle_file import read_vehicle
from training.learning.checkpoint import (
    FILE,
    LOG,
    Progress,
    check_origin,
    discard,
    unfinished_folder,
)
from training.learning.loop import train
from training.learning.page import page
from training.learning.trainer import Trainer, make_trainer
from training.logged_vehicle import LoggedVehicle
from training.report.page import write_report
from training.report.run_folder import (
    SUBCOMMAND,
    checked_output,
    provenance,
    read_manifest,
    run_folder,
    write_json,
)

SETTINGS = ("name", "seed", "epochs")  # all arguments that the weights depend on
VEHICLE = "vehicle"  # the note on it, in manifest, card and weights
OF_VEHICLE = (
    "; simulated is the vehicle of the file, with its channels, sample rate, band and noise, "
    "mirrored if its logs have both sides, and with random missions up to its maximum_speed in "
    "place of the thesis' stimulus"
)


def main(arguments: Train) -> None:
    """Train, or continue an interrupted training; a finished one stays as it is."""
    vehicle = None
    if arguments.vehicle is not None:
        vehicle = logged_vehicle(read_vehicle(arguments.vehicle))
        if arguments.install:
            allowed = "no installation with --vehicle: the package has weights for any vehicle"
            raise refusal("install", True, allowed, "leave out --install or --vehicle")
    trainer = make_trainer(arguments.name, arguments.seed, vehicle)
    if arguments.epochs is not None and arguments.epochs > trainer.epochs:
        raise refusal(
            "epochs",
            arguments.epochs,
            f"1 to {trainer.epochs}",
            "leave it out for all",
        )
    run_training(
        "train",
        arguments,
        SETTINGS,
        arguments.name,
        partial(_run, arguments, trainer, vehicle),
        note_of(vehicle),
    )


def note_of(vehicle: LoggedVehicle | None) -> dict[str, Any]:
    """The note on the vehicle of a training, for manifest, card and weights; empty without one."""
    if vehicle is None:
        return {}
    return {VEHICLE: {"name": vehicle.vehicle.name, "digest": vehicle.digest}}


def run_training(
    command: str,
    arguments: Any,
    settings: Sequence[str],
    name: str,
    run: Callable[[Path, Path], None],
    notes: Mapping[str, Any] = MappingProxyType({}),
) -> None:
    """Train or continue, unless the output is finished; install the weights if that is asked for.

    `name` is that of the weights; `run` trains in the second folder and writes the first. In the
    notes of the manifest two trainings must agree, too.
    """
    place = arguments.output or Path("runs") / f"train-{name}"
    output = checked_output(place, SUBCOMMAND + command)
    unfinished = unfinished_folder(output)
    if arguments.restart:
        discard(unfinished)
    must_train = arguments.restart or (unfinished / FILE).exists()
    if must_train or not is_finished(output, arguments, settings, notes):
        run(output, unfinished)
        print(f"report: {output / 'index.html'}")
    else:
        print(f"already trained: {output}; --restart trains anew")
    discard(unfinished)
    if arguments.install:
        install(output, name)


def is_finished(
    output: Path,
    arguments: Any,
    settings: Sequence[str],
    notes: Mapping[str, Any] = MappingProxyType({}),
) -> bool:
    """Whether the output is that of this training; another training is refused, for its hours.

    `settings` are the arguments in which two trainings must agree, and notes those of the manifest.
    """
    manifest = read_manifest(output)
    if manifest is None:
        return False
    remedy = "choose another --output, or add --restart to replace it"
    wanted = {setting: getattr(arguments, setting) for setting in settings}
    thing = f"training in {output}"
    check_origin(thing, manifest.get("arguments"), wanted, remedy)
    found = {VEHICLE: manifest.get(VEHICLE)}
    check_origin(thing, found, {VEHICLE: notes.get(VEHICLE)}, remedy)
    return True


@contextmanager
def explain_interruption(output: Path, restart: bool) -> Iterator[None]:
    """Turn an interruption into an error which says that the same command continues."""
    try:
        yield
    except KeyboardInterrupt:
        same = "the same command without --restart" if restart else "the same command"
        raise KeyboardInterrupt(f"{same} goes on after the last complete epoch") from None
    except (OSError, SafetensorError) as error:
        reason = getattr(error, "strerror", None) or error
        allowed = f"a place that can be written ({reason})"
        remedy = "make room and repeat the command: it goes on"
        raise refusal("output", str(output), allowed, remedy) from None


def _run(
    arguments: Train,
    trainer: Trainer,
    vehicle: LoggedVehicle | None,
    output: Path,
    unfinished: Path,
) -> None:
    with explain_interruption(output, arguments.restart):
        note = note_of(vehicle)
        settings = {"name": arguments.name, "seed": arguments.seed, **note}
        progress = train(trainer, settings, unfinished, arguments.epochs)
        start = time.perf_counter()
        diagnoser, figures = trainer.finish()
        seconds = time.perf_counter() - start
        seconds += sum(epoch["seconds"] for epoch in progress.history)
        with run_folder(output, "train", arguments, note) as folder:
            shutil.copytree(unfinished / LOG, folder / LOG)
            training_card = card(arguments, trainer.data, progress, figures, seconds) | note
            write_run(folder, diagnoser, training_card)


def card(
    arguments: Train,
    data: str,
    progress: Progress,
    figures: dict[str, Any],
    seconds: float,
) -> dict[str, Any]:
    """The card of the weights as plain data: command, seed, data, versions, effort and figures."""
    options = ["--seed", str(arguments.seed)]
    if arguments.vehicle is not None:
        options += ["--vehicle", str(arguments.vehicle)]
        data += OF_VEHICLE
    if arguments.epochs is not None:
        options += ["--epochs", str(arguments.epochs)]
    return {
        "diagnoser": arguments.name,
        "command": shlex.join(("auv-fault", "train", arguments.name, *options)),
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


def write_run(folder: Path, diagnoser: Recursive, training_card: dict[str, Any]) -> None:
    """Write weights, card and report."""
    name = training_card["diagnoser"]
    weights = folder / f"{name}.safetensors"
    diagnoser.save(weights)
    if VEHICLE in training_card:
        tensors, header = storage.read(weights)
        storage.write(weights, tensors, header | {VEHICLE: training_card[VEHICLE]})
    write_json(folder / f"{name}.json", training_card)
    results = page(training_card)
    write_json(folder / "results.json", results)
    write_report(results, folder)


def install(folder: Path, name: str) -> None:
    """Copy weights and card into the package; each file is replaced as a whole."""
    try:
        storage.WEIGHTS.mkdir(exist_ok=True)
        for file in (f"{name}.safetensors", f"{name}.json"):
            shutil.copyfile(folder / file, storage.WEIGHTS / f".{file}")
            os.replace(storage.WEIGHTS / f".{file}", storage.WEIGHTS / file)
    except OSError as error:
        allowed = f"files and a place that can be written ({error.strerror or error})"
        remedy = f"copy them from {folder}"
        raise refusal("installing weights", str(storage.WEIGHTS), allowed, remedy) from None
    print(f"installed: {storage.WEIGHTS / name}.safetensors and .json")
