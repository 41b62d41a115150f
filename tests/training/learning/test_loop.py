import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from safetensors import SafetensorError
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from tensorboard.util.tensor_util import make_ndarray

from auv_fault_env.errors import InputError
from diagnosers import storage
from training import cli
from training.learning import checkpoint, trainer
from training.learning.checkpoint import FILE, LOG, Progress
from training.learning.loop import train
from training.report.figures.learning import learning_curve

HERE = str(Path(__file__).parent)
NAME = "integrated"
SETTINGS = {"name": NAME, "seed": 0}
KILLED = """
import importlib, os, signal, sys
sys.path.insert(0, {here!r})
from training import cli
from training.learning import trainer
trainer.TRAINERS[{name!r}] = "toy_trainer:ToyTrainer"

def die(place, function, at_call, before):
    owner, calls = __import__("pkgutil").resolve_name(place), []
    real = getattr(owner, function)
    def dying(*arguments, **settings):
        calls.append(1)
        if before and len(calls) == at_call:
            os.kill(os.getpid(), signal.SIGKILL)
        result = real(*arguments, **settings)
        if len(calls) == at_call:
            os.kill(os.getpid(), signal.SIGKILL)
        return result
    setattr(owner, function, dying)

die(*{moment!r})
cli.main(["train", {name!r}, "--output", {output!r}])
"""
# where the process dies, and how many epochs are kept; the first checkpoint is that of no epoch
MOMENTS = {
    "in the third epoch": (("toy_trainer:ToyTrainer", "epoch", 3, False), 2),
    "while the checkpoint of the second epoch is written": (
        ("diagnosers.storage", "save_file", 3, False),
        1,
    ),
    "while the run is written": (("training.commands.train", "write_report", 1, True), 6),
    "before the checkpoint is removed": (("training.commands.train", "discard", 1, True), 6),
}


@pytest.fixture(autouse=True)
def toy(monkeypatch):
    monkeypatch.syspath_prepend(HERE)
    monkeypatch.setitem(trainer.TRAINERS, NAME, "toy_trainer:ToyTrainer")
    from toy_trainer import ToyTrainer

    return ToyTrainer


def run(output, *arguments):
    return cli.main(["train", NAME, "--output", str(output), *arguments])


def weights(output):
    return (output / f"{NAME}.safetensors").read_bytes()


def unfinished(output):
    return output.with_name(output.name + "-unfinished")


def card(output):
    return json.loads((output / f"{NAME}.json").read_text())


def stop(*_):
    raise KeyboardInterrupt


def refused(capsys, *parts):
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("auv-fault")]
    assert len(lines) == 1
    for part in parts:
        assert part in lines[0]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(HERE)
        patch.setitem(trainer.TRAINERS, NAME, "toy_trainer:ToyTrainer")
        output = tmp_path_factory.mktemp("whole") / "run"
        assert run(output) == 0
    return output


def test_run_is_complete_and_nothing_else_is_left(whole):
    files = {
        "index.html",
        "manifest.json",
        "results.json",
        "figures",
        LOG,
        f"{NAME}.json",
        f"{NAME}.safetensors",
    }
    assert {path.name for path in whole.iterdir()} == files
    assert list(whole.parent.iterdir()) == [whole]
    assert json.loads((whole / "manifest.json").read_text())["command"] == "auv-fault train"
    assert "Learning curve" in (whole / "index.html").read_text()


def test_weights_follow_from_the_seed(whole, tmp_path):
    assert run(tmp_path / "same") == 0
    assert run(tmp_path / "other", "--seed", "1") == 0
    assert weights(tmp_path / "same") == weights(whole)
    assert weights(tmp_path / "other") != weights(whole)


@pytest.mark.parametrize(("moment", "kept"), MOMENTS.values(), ids=MOMENTS)
def test_killed_run_goes_on_bit_for_bit(whole, tmp_path, moment, kept, monkeypatch, toy):
    output = tmp_path / "run"
    code = KILLED.format(here=HERE, name=NAME, moment=moment, output=str(output))
    killed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert killed.returncode == -9, killed.stderr
    assert (unfinished(output) / FILE).exists()
    numbers = []
    epoch = toy.epoch
    monkeypatch.setattr(
        toy, "epoch", lambda self, number: numbers.append(number) or epoch(self, number)
    )
    assert run(output) == 0
    assert numbers == list(range(kept, toy.epochs))
    assert weights(output) == weights(whole)
    assert [epoch["train"] for epoch in card(output)["history"]] == [
        epoch["train"] for epoch in card(whole)["history"]
    ]
    assert not unfinished(output).exists()


def test_interrupted_run_says_how_to_go_on(whole, tmp_path, monkeypatch, toy, capsys):
    output = tmp_path / "run"
    with monkeypatch.context() as patch:
        patch.setattr(toy, "finish", stop)
        assert run(output) == 130
        refused(capsys, "stopped; the same command goes on")
        assert run(output, "--restart") == 130
        refused(capsys, "stopped; the same command without --restart goes on")
    assert not output.exists()
    assert run(output) == 0
    assert weights(output) == weights(whole)


@pytest.mark.parametrize(
    ("call", "error"),
    [
        (1, OSError(28, "No space left")),
        (3, SafetensorError("No space left")),
        (8, SafetensorError("No space left")),
    ],
    ids=["first checkpoint", "later checkpoint", "weights"],
)
def test_full_disk_is_one_line_and_loses_no_epoch(
    whole, tmp_path, monkeypatch, call, error, capsys
):
    output = tmp_path / "run"
    calls = []
    save = storage.save_file

    def full(*arguments, **settings):
        calls.append(1)
        if len(calls) == call:
            raise error
        save(*arguments, **settings)

    monkeypatch.setattr(storage, "save_file", full)
    assert run(output) == 2
    refused(capsys, "a place that can be written (No space left)")
    assert not output.exists()
    assert run(output) == 0
    assert len(calls) == 1 + (1 + 6) + 1  # the refused one, the checkpoints, the weights
    assert weights(output) == weights(whole)


def test_shortened_training_is_the_beginning_of_the_whole(tmp_path, toy):
    short = train(toy(0), SETTINGS, tmp_path / "a", epochs=2)
    longer = train(toy(0), SETTINGS, tmp_path / "a")
    whole = train(toy(0), SETTINGS, tmp_path / "b")
    assert len(short.history) == 2
    assert len(whole.history) == toy.epochs
    for name, tensor in whole.current.items():
        np.testing.assert_array_equal(tensor, longer.current[name])


def test_training_stops_early_and_keeps_the_best(tmp_path, toy):
    losses = [5.0, 3.0, 4.0, 3.0, 9.0, 1.0]
    trained = toy(0)
    trained.patience = 3
    trained.validate = lambda: {"loss": losses[int(trained.count) - 1]}
    progress = train(trained, SETTINGS, tmp_path)
    assert progress.losses == losses[:5]
    assert progress.best_epoch == 2
    assert trained.count == 2


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_diverged_training_is_refused(tmp_path, toy, value):
    trained = toy(0)
    trained.validate = lambda: {"loss": value}
    with pytest.raises(
        InputError, match=r"validation loss of epoch 1: got (nan|inf); .* has diverged"
    ):
        train(trained, SETTINGS, tmp_path)


def test_checkpoint_of_another_training_is_refused(tmp_path, monkeypatch, toy, capsys):
    output = tmp_path / "run"
    with monkeypatch.context() as patch:
        patch.setattr(toy, "finish", stop)
        run(output)
    capsys.readouterr()
    assert run(output, "--seed", "1") == 2
    refused(capsys, "checkpoint in", "'seed': 0", "'seed': 1", "--restart")
    monkeypatch.setattr("training.learning.loop.digest", lambda _: "changed")
    assert run(output) == 2
    refused(capsys, "'code': 'changed'", "--restart")
    assert run(output, "--restart", "--seed", "1") == 0


def test_a_checkpoint_with_more_epochs_than_asked_for_is_refused(
    tmp_path, monkeypatch, toy, capsys
):
    output = tmp_path / "run"
    with monkeypatch.context() as patch:
        patch.setattr(toy, "finish", stop)
        run(output, "--epochs", "3")
    capsys.readouterr()
    assert run(output, "--epochs", "2") == 2
    refused(capsys, "epochs: got 2; allowed is at least the 3 of the checkpoint", "--restart")
    assert run(output, "--epochs", "4") == 0
    assert card(output)["epochs"] == 4


def test_a_finished_run_stays_while_its_remains_are_removed(tmp_path, monkeypatch, toy, capsys):
    output = tmp_path / "run"
    assert run(output) == 0
    # as after a kill while the checkpoint was being removed
    (unfinished(output) / LOG).mkdir(parents=True)
    monkeypatch.setattr(toy, "epoch", stop)
    assert run(output) == 0
    assert "already trained" in capsys.readouterr().out
    assert list(tmp_path.iterdir()) == [output]


@pytest.mark.parametrize("arguments", [None, {}, {"seed": 0}, []])
def test_a_manifest_without_its_arguments_is_refused(whole, tmp_path, arguments, capsys):
    output = tmp_path / "run"
    shutil.copytree(whole, output)
    manifest = json.loads((output / "manifest.json").read_text())
    manifest["arguments"] = arguments
    (output / "manifest.json").write_text(json.dumps(manifest))
    assert run(output) == 2
    refused(capsys, "training in", "'name': None", "'name': 'integrated'", "--restart")


def test_checkpoint_keeps_order_shapes_and_dtypes(tmp_path):
    state = {
        "b": np.arange(6, dtype=np.float32).reshape(2, 3).T,
        "a": np.array(3),
        "c": np.zeros((0, 2), np.uint8),
    }
    checkpoint.write(tmp_path, {"seed": 1}, Progress([], state, state))
    read = checkpoint.read(tmp_path, {"seed": 1})
    for got in (read.current, read.best):
        assert list(got) == list(state)  # an optimiser may go through its parameters in this order
        for name, tensor in state.items():
            np.testing.assert_array_equal(got[name], tensor, strict=True)


@pytest.mark.parametrize("damage", ["truncated", "empty", "foreign"])
def test_damaged_checkpoint_is_refused(tmp_path, toy, damage, capsys):
    output = tmp_path / "run"
    path = unfinished(output) / FILE
    train(toy(0), SETTINGS, path.parent, epochs=2)
    content = path.read_bytes()
    if damage == "foreign":
        storage.write(path, {"x": np.zeros(3)}, {"diagnoser": "integrated"})
    else:
        path.write_bytes(content[: len(content) // 2] if damage == "truncated" else b"")
    capsys.readouterr()
    assert run(output) == 2
    refused(capsys, "checkpoint: got", "damaged", "add --restart to train anew")


def test_log_has_every_scalar_once(whole, toy):
    log = EventAccumulator(str(whole / LOG)).Reload()
    assert set(log.Tags()["tensors"]) == {
        "train/loss",
        "train/bias",
        "validation/loss",
        "validation/bias",
    }
    events = log.Tensors("validation/loss")
    assert [event.step for event in events] == list(range(1, toy.epochs + 1))
    logged = [float(make_ndarray(event.tensor_proto)) for event in events]
    np.testing.assert_allclose(
        logged, [epoch["validation"]["loss"] for epoch in card(whole)["history"]], rtol=1e-6
    )


def test_card_tells_how_the_weights_were_made(whole, toy):
    made = card(whole)
    assert made["command"] == "auv-fault train integrated --seed 0"
    assert (made["seed"], made["data"], made["epochs"]) == (0, toy.data, toy.epochs)
    assert made["figures"] == {"temperature": 1.25, "macro_f1": {"normal": 0.5}}
    assert made["validation"] == made["history"][made["best_epoch"] - 1]["validation"]
    assert made["versions"]["numpy"] == np.__version__
    assert made["versions"]["torch"] and made["versions"]["safetensors"]
    assert {"revision", "seconds"} < made.keys()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["limits"],
            "diagnoser to train: got 'limits'; "
            "allowed is one of raw_network, kalman_network, integrated",
        ),
        (["integratd"], "did you mean 'integrated'?"),
        ([NAME, "--epochs", "0"], "epochs: got 0"),
        ([NAME, "--epochs", "7"], "epochs: got 7; allowed is 1 to 6"),
        ([NAME, "--seed", "-1"], "seed: got -1"),
    ],
)
def test_bad_arguments_are_refused(tmp_path, arguments, message, capsys):
    assert cli.main(["train", *arguments, "--output", str(tmp_path / "run")]) == 2
    refused(capsys, message)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("place", ["output", "unfinished", "below a file"])
def test_bad_places_are_refused_before_training(tmp_path, monkeypatch, toy, place, capsys):
    monkeypatch.setattr(toy, "epoch", stop)
    output = tmp_path / "run"
    if place == "below a file":
        (tmp_path / "run").write_text("precious")
        assert run(output / "deeper") == 2
    else:
        folder = output if place == "output" else unfinished(output)
        folder.mkdir()
        (folder / "thesis.tex").write_text("precious")
        assert run(output, "--restart") == 2
        assert (folder / "thesis.tex").exists()
    refused(capsys, str(output))


def test_finished_run_is_kept_and_can_be_installed(tmp_path, monkeypatch, toy, capsys):
    output = tmp_path / "run"
    installed = tmp_path / "weights"
    monkeypatch.setattr(storage, "WEIGHTS", installed)
    assert run(output, "--epochs", "2") == 0
    with monkeypatch.context() as patch:
        patch.setattr(toy, "epoch", stop)
        assert run(output, "--epochs", "2", "--install") == 0
        assert "already trained" in capsys.readouterr().out
    assert {path.name for path in installed.iterdir()} == {f"{NAME}.safetensors", f"{NAME}.json"}
    assert (installed / f"{NAME}.safetensors").read_bytes() == weights(output)
    assert run(output) == 2
    refused(capsys, "training in", "'epochs': 2", "--restart")
    assert run(output, "--restart") == 0
    assert card(output)["epochs"] == toy.epochs


def test_unwritable_weights_folder_is_refused(tmp_path, monkeypatch, whole, capsys):
    (tmp_path / "weights").write_text("in the way")
    monkeypatch.setattr(storage, "WEIGHTS", tmp_path / "weights")
    assert run(whole, "--install") == 2
    refused(capsys, "installing weights", "a place that can be written")


def test_learning_curve_names_its_axes_and_marks_the_best():
    axis = learning_curve([3.0, 2.0, 1.0], [3.0, 2.5, 2.7], best=2).axes[0]
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("epoch", "loss")
    assert [line.get_label() for line in axis.lines] == ["training", "validation", "weights used"]
    assert (axis.lines[2].get_xdata()[0], axis.lines[2].get_ydata()[0]) == (2, 2.5)
