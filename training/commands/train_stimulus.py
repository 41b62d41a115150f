"""``auv-fault train-stimulus``: a policy that chooses the speed, within any budget.

It runs and continues as ``auv-fault train``: checkpoint and TensorBoard log are in
``OUTPUT-unfinished`` until the end, and after an interruption the same command continues after the
last complete epoch and ends with the same policy, bit for bit, on one machine. `--steps` is rounded
up to whole epochs. A checkpoint names the digest of the diagnoser's weights: with others it is
refused.
"""

import shutil
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

from auv_fault_env.errors import known_name
from diagnosers.registry import make, ranked
from training.arguments import TrainStimulus
from training.benchmark.trial_store import weights_digest
from training.commands.train import explain_interruption, run_training
from training.learning.checkpoint import LOG, Progress
from training.learning.loop import train
from training.learning.page import page
from training.learning.stimulus import StimulusTrainer
from training.report.page import write_report
from training.report.run_folder import provenance, run_folder, write_json
from training.stimuli.policy import LearnedPolicy, policy_name

# all arguments that the policy depends on
SETTINGS = ("diagnoser", "seed", "steps")


def main(arguments: TrainStimulus) -> None:
    """Train, or continue an interrupted training; a finished one stays as it is."""
    trainer = make_trainer(arguments)
    name = policy_name(arguments.diagnoser, arguments.seed)
    run = partial(_run, arguments, trainer, name)
    run_training("train-stimulus", arguments, SETTINGS, name, run)


def make_trainer(arguments: TrainStimulus) -> StimulusTrainer:
    """The trainer of these arguments; an unknown diagnoser is refused."""
    diagnoser = known_name("diagnoser", arguments.diagnoser, ranked())
    return StimulusTrainer(arguments.seed, diagnoser, arguments.steps)


def _run(
    arguments: TrainStimulus,
    trainer: StimulusTrainer,
    name: str,
    output: Path,
    unfinished: Path,
) -> None:
    with explain_interruption(output, arguments.restart):
        settings = {setting: getattr(arguments, setting) for setting in SETTINGS}
        settings["weights"] = weights_digest(make(arguments.diagnoser))
        progress = train(trainer, settings, unfinished)
        policy, figures = trainer.finish()
        training_card = card(arguments, trainer, progress, figures)
        with run_folder(output, "train-stimulus", arguments) as folder:
            shutil.copytree(unfinished / LOG, folder / LOG)
            write_run(folder, name, policy, training_card)
    rate = training_card["figures"]["decisions_per_second"]
    print(f"{rate:.0f} decisions per second, 10 samples of 0.1 s each")


def card(
    arguments: TrainStimulus,
    trainer: StimulusTrainer,
    progress: Progress,
    figures: dict[str, float],
) -> dict[str, Any]:
    """The card of the policy as plain data: command, seed, data, versions, effort and figures."""
    settings = {name: getattr(arguments, name) for name in SETTINGS}
    options = " ".join(f"--{name} {setting}" for name, setting in settings.items())
    origin = provenance()
    origin["versions"]["stable-baselines3"] = version("stable-baselines3")
    seconds = sum(epoch["seconds"] for epoch in progress.history)
    decisions_per_epoch = trainer.decisions + trainer.validation_decisions
    decisions = len(progress.history) * decisions_per_epoch
    return {
        **settings,
        "command": f"auv-fault train-stimulus {options}",
        "data": trainer.data,
        "features": trainer.policy().features,
        **origin,
        "epochs": len(progress.history),
        "best_epoch": progress.best_epoch,
        "seconds": round(seconds, 1),
        "validation": progress.history[progress.best_epoch - 1]["validation"],
        "figures": figures | {"decisions_per_second": decisions / seconds},
        "history": progress.history,
    }


def write_run(
    folder: Path, name: str, policy: LearnedPolicy, training_card: dict[str, Any]
) -> None:
    """Write policy, card and report."""
    policy.save(folder / f"{name}.safetensors")
    write_json(folder / f"{name}.json", training_card)
    title = f"Training of a stimulus for {policy.diagnoser}"
    results = page(training_card) | {"title": title}
    write_json(folder / "results.json", results)
    write_report(results, folder)
