"""A command that is killed before any change of a folder gives the same files when it is repeated.

`kill_at_random_moments.py` beside this file kills processes at any other moment.
"""

import itertools
import os
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest

from training import cli
from training.benchmark import trial_store
from training.commands import benchmark, simulate, train
from training.learning import loop, trainer
from training.learning.checkpoint import LOG
from training.report.run_folder import run_folder

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
    """The content of all files but logs, which hold times, and trials that were cut off."""
    files = {path: path.relative_to(folder) for path in folder.rglob("*") if path.is_file()}
    return {
        place: path.read_bytes()
        for path, place in files.items()
        if place.parts[0] != LOG and not place.name.startswith(".")
    }


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


@pytest.fixture
def commands(monkeypatch):
    """Short commands by name, without what would take seconds."""
    for module in (benchmark, simulate, train):
        monkeypatch.setattr(
            module, "write_report", lambda results, folder: (folder / "index.html").touch()
        )
    for module in (loop, train):
        monkeypatch.setattr(module, "time", SimpleNamespace(perf_counter=lambda: 0.0))
    monkeypatch.syspath_prepend(TOYS)
    monkeypatch.setitem(trainer.TRAINERS, "integrated", "toy_trainer:ToyTrainer")
    monkeypatch.setattr(benchmark, "_results", two_trials)
    monkeypatch.setattr(benchmark, "write_csv", lambda folder, results: None)
    monkeypatch.setattr(benchmark, "page", lambda results: {"sections": []})
    return {
        "train": ["train", "integrated", "--epochs", "2"],
        "simulate": ["simulate", "--vehicles", "1", "--duration", "0.5"],
        "benchmark": ["benchmark", "--suite", "thesis", "--diagnosers", "null"],
    }


@pytest.mark.parametrize("name", ["train", "simulate", "benchmark"])
@pytest.mark.parametrize("is_repeated", [False, True], ids=["new", "over an earlier run"])
def test_killed_before_any_change_the_same_command_gives_the_same_files(
    tmp_path, commands, name, is_repeated
):
    output = tmp_path / "run"
    command = [*commands[name], "--output", str(output)]
    if is_repeated and name == "train":
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
