"""A command that is killed before any change of a folder gives the same files when it is repeated.

`kill_at_random_moments.py` beside this file kills processes at any other moment.
"""

import itertools
import json
import os
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from training import cli
from training.benchmark import timing
from training.benchmark.suites import load
from training.commands import benchmark, simulate, train
from training.learning import loop, trainer
from training.report.run_folder import run_folder

TOYS = str(Path(__file__).parent.parent / "learning")
CHANGES = ("mkdir", "rename", "replace", "unlink", "rmdir")
# files and parts of JSON that hold times
MEASURED = {"results.csv", "tensorboard", "compute"}
MOST_CHANGES = 60


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
    """Of all files the content, of JSON without what was measured."""
    found = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file() and not MEASURED & {*path.relative_to(folder).parts}:
            content = path.read_bytes()
            if path.suffix == ".json":
                content = {
                    name: value
                    for name, value in json.loads(content).items()
                    if name not in MEASURED
                }
            found[str(path.relative_to(folder))] = content
    return found


@pytest.fixture
def commands(monkeypatch, tmp_path_factory):
    """Short commands by name, without what would take seconds."""
    for module in (benchmark, simulate, train):
        monkeypatch.setattr(
            module, "write_report", lambda results, folder: (folder / "index.html").touch()
        )
    for module in (loop, train):
        monkeypatch.setattr(module, "time", SimpleNamespace(perf_counter=lambda: 0.0))
    monkeypatch.syspath_prepend(TOYS)
    monkeypatch.setitem(trainer.TRAINERS, "integrated", "toy_trainer:ToyTrainer")
    for name in ("WARM_UP", "ONE_BY_ONE", "MANY_LANES", "MANY_SAMPLES", "DIFFERENT"):
        monkeypatch.setattr(timing, name, 2)
    suite = load("thesis")
    healthy = suite.healthy | {"threshold": 4_900_067_132}  # of short missions
    short = replace(suite, name="mine", episodes=suite.episodes[:1], healthy=healthy)
    path = tmp_path_factory.mktemp("suite") / "mine.json"
    path.write_text(short.text(), encoding="utf-8")
    short_hours = ["--hours", "0.05", "--counting-hours", "0.05", "--workers", "1"]
    one = ["--diagnosers", "null", "--stimuli", "cruise"]
    return {
        "train": ["train", "integrated", "--epochs", "2"],
        "simulate": ["simulate", "--vehicles", "1", "--duration", "0.5"],
        "benchmark": ["benchmark", "--suite", str(path), *one, *short_hours],
    }


@pytest.mark.parametrize("name", ["train", "simulate", "benchmark"])
@pytest.mark.parametrize("is_repeated", [False, True], ids=["new", "over an earlier run"])
def test_killed_before_any_change_the_same_command_gives_the_same_files(
    tmp_path, commands, name, is_repeated, monkeypatch
):
    output = tmp_path / "run"
    command = [*commands[name], "--output", str(output)]
    killed_command = [*command, "--restart"] if is_repeated and name == "train" else command
    assert cli.main(command) == 0
    expected = same(output)
    whole = shutil.move(output, tmp_path.with_name(f"{tmp_path.name}-whole"))
    if name == "benchmark" and is_repeated:
        # the trials of the earlier run are not run again
        monkeypatch.setattr("training.benchmark.workers.run_trial", None)
    for number in itertools.count(1):
        assert number < MOST_CHANGES
        if is_repeated:
            shutil.copytree(whole, output)
        with pytest.MonkeyPatch.context() as patch:
            asked = die_before(patch, number, tmp_path)
            try:
                cli.main(killed_command)
            except Killed:
                pass
        assert cli.main(command) == 0
        assert same(output) == expected
        assert list(tmp_path.iterdir()) == [output]
        if len(asked) < number:
            break
        shutil.rmtree(output)
    assert number > 5


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
