"""A command that is killed before any change of a folder gives the same files when it is repeated.

`kill_at_random_moments.py` beside this file kills processes at any other moment.
"""

import functools
import importlib
import itertools
import os
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest

import training.report.run_folder
from training import cli
from training.benchmark import trial_store
from training.commands import benchmark, calibrate, simulate, train, train_stimulus
from training.learning import loop, trainer
from training.learning.checkpoint import FILE, LOG
from training.report.run_folder import held, run_folder

from ..field.fleet_logs import VEHICLE

TOYS = str(Path(__file__).parent.parent / "learning")
CHANGES = ("mkdir", "rename", "replace", "unlink", "rmdir")
MOST_CHANGES = 60
RUN = []


class Killed(BaseException):
    pass


def die_before(patch, number, folder):
    """From its change of this number on, nothing changes in the folder; returns all that were
    asked for.
    """
    asked = []

    def dying(change, path, *arguments, **settings):
        if "dir_fd" in settings or str(path).startswith(str(folder)):
            asked.append(path)
            if len(asked) >= number:
                raise Killed
        return change(path, *arguments, **settings)

    for name in CHANGES:
        change = getattr(os, name)
        patch.setattr(
            os,
            name,
            lambda path, *arguments, change=change, **settings: dying(
                change, path, *arguments, **settings
            ),
        )
    return asked


def same(folder):
    """The content of all files but logs, which hold times."""
    files = {path: path.relative_to(folder) for path in folder.rglob("*") if path.is_file()}
    return {place: path.read_bytes() for path, place in files.items() if place.parts[0] != LOG}


class Outcome(NamedTuple):
    seed: np.ndarray


def two_trials(run, folder):
    """Results that are made of two trials, each run once."""
    paths = [folder / f"{seed}.npz" for seed in (1, 2)]
    for seed, path in enumerate(paths):
        if not path.exists():
            RUN.append(seed)
            trial_store.write(path, Outcome(np.array(seed)))
    return {"sizes": [path.stat().st_size for path in paths]}


def toy_stimulus_trainer(arguments):
    """A trainer of two epochs with all that the command asks for."""
    toy_trainer = importlib.import_module("toy_trainer")

    class ToyStimulusTrainer(toy_trainer.ToyTrainer):
        epochs = 2
        decisions = 3
        validation_decisions = 1

        def policy(self):
            save = toy_trainer.ToyDiagnoser(self.weights).save
            return SimpleNamespace(save=save, features=[], diagnoser=arguments.diagnoser)

        def finish(self):
            return self.policy(), {}

    return ToyStimulusTrainer(arguments.seed)


def calibrated(arguments, vehicle, logs):
    """The result of a calibration that has fitted nothing."""
    calibration = SimpleNamespace(vehicle=VEHICLE, reached=(), is_fitted=lambda name: False)
    quality = SimpleNamespace(diagnoser="filter_bank", line="fit: poor", poor_fit="few logs")
    return calibration, quality, {"sections": [], "mistakes": []}


@pytest.fixture
def commands(monkeypatch):
    """Short commands by name, without what would take seconds."""
    # asks git
    monkeypatch.setattr(training.report.run_folder, "_revision", lambda: None)
    for module in (benchmark, calibrate, simulate, train, train_stimulus):
        monkeypatch.setattr(
            module, "write_report", lambda results, folder: (folder / "index.html").touch()
        )
    for module in (loop, train):
        # every epoch takes a second
        clock = itertools.count().__next__
        monkeypatch.setattr(module, "time", SimpleNamespace(perf_counter=clock))
    monkeypatch.syspath_prepend(TOYS)
    monkeypatch.setitem(trainer.TRAINERS, "integrated", "toy_trainer:ToyTrainer")
    monkeypatch.setattr(train_stimulus, "make_trainer", toy_stimulus_trainer)
    monkeypatch.setattr(calibrate, "read_inputs", lambda arguments: (VEHICLE, []))
    monkeypatch.setattr(calibrate, "calibrate", calibrated)
    monkeypatch.setattr(benchmark, "_plan", functools.cache(benchmark._plan))
    monkeypatch.setattr(benchmark, "_results", two_trials)
    monkeypatch.setattr(benchmark, "write_csv", lambda folder, results: None)
    monkeypatch.setattr(benchmark, "page", lambda results: {"sections": []})
    return {
        "train": ["train", "integrated", "--epochs", "2"],
        "train-stimulus": ["train-stimulus", "--diagnoser", "limits"],
        "calibrate": ["calibrate", "--vehicle", "v.toml", "log.csv"],
        "simulate": ["simulate", "--vehicles", "1", "--duration", "0.5"],
        "benchmark": ["benchmark", "--suite", "thesis", "--diagnosers", "null"],
    }


@pytest.mark.parametrize("name", ["train", "train-stimulus", "calibrate", "simulate", "benchmark"])
@pytest.mark.parametrize("is_repeated", [False, True], ids=["new", "over an earlier run"])
def test_killed_before_any_change_the_same_command_gives_the_same_files(
    tmp_path, commands, name, is_repeated
):
    output = tmp_path / "run"
    command = [*commands[name], "--output", str(output)]
    if is_repeated and name.startswith("train"):
        command.append("--restart")
    assert cli.main(command) == 0
    expected = same(output)
    whole = shutil.move(output, tmp_path.with_name(f"{tmp_path.name}-whole"))
    RUN.clear()
    for number in itertools.count(1):
        assert number < MOST_CHANGES
        if is_repeated:
            shutil.copytree(whole, output)
        with pytest.MonkeyPatch.context() as patch:
            asked = die_before(patch, number, tmp_path)
            try:
                cli.main(command)
            except Killed:
                pass
        assert cli.main(command) == 0
        assert same(output) == expected
        assert list(tmp_path.iterdir()) == [output]
        if len(asked) < number:
            break
        shutil.rmtree(output)
    assert number > 5
    # the trials of the earlier run are not run again
    assert not (is_repeated and RUN)


def test_the_folder_of_a_run_in_progress_is_left_alone(tmp_path):
    arguments = cli.COMMANDS["simulate"]()
    output = tmp_path / "run"
    with run_folder(output, "simulate", arguments) as first:
        (first / "first.txt").touch()
        with run_folder(output, "simulate", arguments):
            pass
        assert (first / "first.txt").exists()
    assert (output / "first.txt").exists()
    assert list(tmp_path.iterdir()) == [output]


def test_a_run_of_another_command_is_not_replaced(tmp_path, capsys):
    output = tmp_path / "run"
    with run_folder(output, "benchmark", cli.COMMANDS["benchmark"]()) as folder:
        (folder / "results.json").write_text("hours of work")
    assert cli.main(["simulate", "--output", str(output)]) == 2
    message = capsys.readouterr().err
    assert "it holds a run of auv-fault benchmark; choose another --output" in message
    assert (output / "results.json").read_text() == "hours of work"


def test_a_trial_that_another_run_is_writing_is_left_alone(tmp_path):
    half_written = tmp_path / ".abc.npz"
    half_written.touch()
    with held(tmp_path):
        with trial_store.held_folder(tmp_path):
            assert half_written.exists()
    with trial_store.held_folder(tmp_path):
        assert not half_written.exists()
        half_written.touch()
        with trial_store.held_folder(tmp_path):
            assert half_written.exists()


def test_a_checkpoint_on_beliefs_of_other_weights_is_refused(
    tmp_path, commands, monkeypatch, capsys
):
    command = [*commands["train-stimulus"], "--output", str(tmp_path / "run")]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(train_stimulus, "card", None)
        with pytest.raises(TypeError):
            cli.main(command)
    (unfinished,) = tmp_path.iterdir()
    content = (unfinished / FILE).read_bytes()
    capsys.readouterr()
    weights = SimpleNamespace(tensors=lambda: {"weights": np.zeros(3)})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(train_stimulus, "make", lambda name: weights)
        assert cli.main(command) == 2
    (line,) = [one for one in capsys.readouterr().err.splitlines() if "auv-fault" in one]
    assert "checkpoint in " in line and "'weights'" in line and "--restart" in line
    assert (unfinished / FILE).read_bytes() == content
    assert cli.main(command) == 0
