"""``auv-fault train-stimulus``: a policy that chooses the speed so that a fault shows sooner, within a budget.

It runs and goes on as ``auv-fault train`` does: checkpoint and TensorBoard log lie in
``OUTPUT-unfinished`` until all is done, and the same command goes on after the last complete epoch
and ends with the same policy, bit for bit, on one machine. Whole epochs are trained: `--steps` is
rounded up to them.
"""

import shutil
from importlib.metadata import version
from pathlib import Path
from typing import Any

from auv_fault_env.channels import MAXIMUM_COMMAND
from auv_fault_env.errors import finite_in_range, known_name, whole_number
from diagnosers.registry import ranked
from training.arguments import TrainStimulus
from training.commands.train import install, is_finished, to_be_repeated
from training.learning.checkpoint import LOG, Progress, unfinished_folder
from training.learning.loop import train
from training.learning.page import page
from training.learning.stimulus import StimulusTrainer
from training.report.page import write_report
from training.report.run_folder import checked_output, provenance, run_folder, write_json
from training.stimuli.policy import LearnedPolicy, policy_name

SETTINGS = ("diagnoser", "budget", "seed", "steps")


def main(arguments: TrainStimulus) -> None:
    """Train, or go on with a training that was broken off; a finished one is left as it is."""
    trainer = trainer_of(arguments)
    name = policy_name(arguments.diagnoser, arguments.seed)
    output = checked_output(arguments.output or Path("runs") / f"train-{name}")
    unfinished = unfinished_folder(output)
    if arguments.restart:
        shutil.rmtree(unfinished, ignore_errors=True)
    if (
        arguments.restart
        or unfinished.exists()
        or not is_finished(output, "train-stimulus", arguments, SETTINGS)
    ):
        made = _run(arguments, trainer, output, unfinished)
        print(
            f"{made['figures']['decisions_per_second']:.0f} decisions per second, 10 samples of 0.1 s each"
        )
        print(f"report: {output / 'index.html'}")
    else:
        print(f"already trained: {output}; --restart trains anew")
    if arguments.install:
        install(output, name)


def trainer_of(arguments: TrainStimulus) -> StimulusTrainer:
    """The trainer that is asked for; bad arguments are refused."""
    seed = int(finite_in_range("seed", arguments.seed, 0, 2**62))
    budget = finite_in_range("budget", arguments.budget, 0.001, MAXIMUM_COMMAND)
    diagnoser = known_name("diagnoser", arguments.diagnoser, ranked())
    steps = whole_number("steps", arguments.steps)
    return StimulusTrainer(seed, budget, diagnoser, steps)


def _run(
    arguments: TrainStimulus, trainer: StimulusTrainer, output: Path, unfinished: Path
) -> dict[str, Any]:
    name = policy_name(arguments.diagnoser, arguments.seed)
    with to_be_repeated(output, arguments.restart):
        progress = train(trainer, name, arguments.seed, unfinished)
        policy, figures = trainer.finish()
        made = card(arguments, trainer, progress, figures)
        with run_folder(output, "train-stimulus", arguments) as folder:
            shutil.copytree(unfinished / LOG, folder / LOG)
            write_run(folder, name, policy, made)
    shutil.rmtree(unfinished, ignore_errors=True)
    return made


def card(
    arguments: TrainStimulus,
    trainer: StimulusTrainer,
    progress: Progress,
    figures: dict[str, float],
) -> dict[str, Any]:
    """How the policy was made: command, seed, data, versions, what it took, and what came out, as plain data."""
    options = " ".join(f"--{name} {getattr(arguments, name)}" for name in SETTINGS)
    made_with = provenance()
    made_with["versions"]["stable-baselines3"] = version("stable-baselines3")
    seconds = sum(epoch["seconds"] for epoch in progress.history)
    decisions = len(progress.history) * (trainer.decisions + trainer.validation_decisions)
    return {
        **{name: getattr(arguments, name) for name in SETTINGS},
        "command": f"auv-fault train-stimulus {options}",
        "data": trainer.data,
        "features": trainer.policy().features,
        **made_with,
        "epochs": len(progress.history),
        "best_epoch": progress.best_epoch,
        "seconds": round(seconds, 1),
        "validation": progress.history[progress.best_epoch - 1]["validation"],
        "figures": figures | {"decisions_per_second": decisions / seconds},
        "history": progress.history,
    }


def write_run(folder: Path, name: str, policy: LearnedPolicy, made: dict[str, Any]) -> None:
    """Write policy, card and report."""
    policy.save(folder / f"{name}.safetensors")
    write_json(folder / f"{name}.json", made)
    title = f"Training of a stimulus for {policy.diagnoser} within {policy.budget:g} m/s"
    results = page(made) | {"title": title}
    write_json(folder / "results.json", results)
    write_report(results, folder)
