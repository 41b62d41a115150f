"""``auv-fault train --vehicle`` and ``auv-fault diagnose --weights``."""

import json
from dataclasses import replace

import pytest

from diagnosers import storage
from training import cli
from training.field.logged import logged_vehicle
from training.field.vehicle_file import write_vehicle
from training.learning import raw_network

from ..field.fleet_logs import VEHICLE, episode, write_log

NAME = "raw_network"


@pytest.fixture(scope="module", autouse=True)
def small():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(raw_network, "LANES", 16)
        patch.setattr(raw_network, "BATCH", 64)
        patch.setattr("training.learning.episodes.N_SAMPLES", 60)
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Vehicle files of a vehicle and of another one, a log, and the trained weights."""
    folder = tmp_path_factory.mktemp("vehicle")
    write_vehicle(folder / "v.toml", VEHICLE)
    other = replace(VEHICLE.vehicle, alpha=1.2 * VEHICLE.vehicle.alpha)
    write_vehicle(folder / "other.toml", replace(VEHICLE, vehicle=other))
    write_log(folder / "log.csv", episode())
    assert train(folder / "run", folder / "v.toml") == 0
    return folder


def train(output, vehicle, *more):
    options = ["--output", output, "--epochs", "1", *more]
    options += ["--vehicle", vehicle] if vehicle else []
    return cli.main(["train", NAME, *map(str, options)])


def diagnose(folder, output, vehicle="v.toml", *more, weights=None):
    weights = weights or folder / "run" / f"{NAME}.safetensors"
    options = ["--vehicle", folder / vehicle, "--weights", weights, "--output", output, *more]
    return cli.main(["diagnose", str(folder / "log.csv"), *map(str, options)])


def refusal(capsys):
    """The one line of a refusal."""
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("auv-fault")]
    assert len(lines) == 1
    return lines[0]


def test_card_weights_and_manifest_name_the_vehicle(folder):
    note = {"name": "thesis1992", "digest": logged_vehicle(VEHICLE).digest}
    card = json.loads((folder / "run" / f"{NAME}.json").read_text())
    assert card["vehicle"] == note
    assert f"--vehicle {folder / 'v.toml'}" in card["command"]
    assert "its channels, sample rate, band and noise" in card["data"]
    assert storage.read(folder / "run" / f"{NAME}.safetensors")[1]["vehicle"] == note
    assert json.loads((folder / "run" / "manifest.json").read_text())["vehicle"] == note


def test_the_weights_diagnose_the_vehicle(folder, tmp_path):
    assert diagnose(folder, tmp_path / "out", "v.toml", "--diagnoser", NAME) in (0, 3)
    results = json.loads((tmp_path / "out" / "results.json").read_text())
    assert f"--diagnoser {NAME}" in results["command"] and "--weights" in results["command"]
    assert results["verdicts"][0]["verdict"] in ("healthy", "fault")


def test_a_change_that_the_training_does_not_see_leaves_the_weights_valid(folder, tmp_path):
    write_vehicle(folder / "renamed.toml", replace(VEHICLE, hotel_load=20.0, diagnoser="limits"))
    assert diagnose(folder, tmp_path / "out", "renamed.toml", "--diagnoser", NAME) in (0, 3)


def test_weights_of_another_vehicle_are_refused(folder, tmp_path, capsys):
    assert diagnose(folder, tmp_path / "out", "other.toml", "--diagnoser", NAME) == 2
    line = refusal(capsys)
    assert logged_vehicle(VEHICLE).digest in line and "auv-fault train raw_network" in line
    assert not (tmp_path / "out").exists()


def test_weights_of_no_vehicle_file_are_refused(folder, tmp_path, capsys):
    packaged = storage.WEIGHTS / f"{NAME}.safetensors"
    assert diagnose(folder, tmp_path, "v.toml", "--diagnoser", NAME, weights=packaged) == 2
    assert "got None; allowed is this vehicle file, digest" in refusal(capsys)


@pytest.mark.parametrize("more", [(), ("--diagnoser", "integrated")], ids=["default", "other"])
def test_weights_of_another_diagnoser_are_refused(folder, tmp_path, capsys, more):
    assert diagnose(folder, tmp_path / "out", "v.toml", *more) == 2
    assert "add --diagnoser raw_network" in refusal(capsys)


def test_without_weights_raw_network_is_no_diagnoser_of_a_vehicle(folder, tmp_path, capsys):
    options = ["--vehicle", folder / "v.toml", "--diagnoser", NAME, "--output", tmp_path / "out"]
    assert cli.main(["diagnose", str(folder / "log.csv"), *map(str, options)]) == 2
    assert "diagnoser: got 'raw_network'" in refusal(capsys)


def test_a_finished_run_of_another_vehicle_is_kept(folder, capsys):
    before = (folder / "run" / f"{NAME}.safetensors").read_bytes()
    assert train(folder / "run", folder / "v.toml") == 0
    assert "already trained" in capsys.readouterr().out
    for vehicle in (folder / "other.toml", None):
        assert train(folder / "run", vehicle) == 2
        assert "training in" in refusal(capsys)
    assert (folder / "run" / f"{NAME}.safetensors").read_bytes() == before


def test_an_unfinished_run_of_another_vehicle_does_not_go_on(folder, tmp_path, monkeypatch, capsys):
    def stop(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(raw_network.RawNetworkTrainer, "finish", stop)
        assert train(tmp_path / "run", folder / "v.toml") != 0
    capsys.readouterr()
    for vehicle in (folder / "other.toml", None):
        assert train(tmp_path / "run", vehicle) == 2
        assert "checkpoint in" in refusal(capsys)
    assert train(tmp_path / "run", folder / "v.toml") == 0


def test_weights_of_a_vehicle_are_not_installed(folder, tmp_path, capsys):
    assert train(tmp_path / "run", folder / "v.toml", "--install") == 2
    assert "leave out --install or --vehicle" in refusal(capsys)
    assert not (tmp_path / "run").exists()
