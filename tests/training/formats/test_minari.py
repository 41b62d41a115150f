"""Minari data sets: what was simulated comes back equal, and the environment replays it."""

import json
import os
import sys
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet
import pytest

import auv_fault_env  # noqa: F401  registers the environment
from auv_fault_env.channels import CHANNELS
from training import cli
from training.commands import simulate
from training.formats.columns import EPISODES
from training.formats.minari import DATASET

minari = pytest.importorskip("minari")
FAULT = '[{"fault": "propeller_loss:port", "onset": 1.0, "severity": 1.0}]'


def simulated(folder, *arguments, steps=30):
    options = [
        "--output",
        str(folder),
        "--duration",
        str(steps / 10),
        "--vehicles",
        "3",
        "--seed",
        "5",
    ]
    assert cli.main(["simulate", *options, "--formats", "parquet", "minari", *arguments]) == 0
    return folder


@pytest.fixture(autouse=True)
def no_page(monkeypatch):
    """Leave out the page, which takes longer than all else here."""
    monkeypatch.setattr(simulate, "write_report", lambda *_: None)


@pytest.fixture
def load(monkeypatch):
    def load(folder):
        monkeypatch.setenv("MINARI_DATASETS_PATH", str(folder / "minari"))
        return minari.load_dataset(DATASET)

    return load


def test_what_was_simulated_comes_back_equal(tmp_path, load):
    folder = simulated(tmp_path / "run")
    table = pyarrow.parquet.read_table(folder / "episodes.parquet").to_pydict()
    data = load(folder)
    assert (data.total_episodes, data.total_steps) == (3, 90)
    for lane, episode in enumerate(data):
        rows = slice(30 * lane, 30 * lane + 30)
        assert episode.observations.shape == (31, 12) and episode.actions.shape == (30, 3)
        assert episode.observations.dtype == episode.actions.dtype == np.float32
        for k, name in enumerate(CHANNELS):
            assert episode.observations[1:, k].tolist() == table[name][rows]
        assert in_the_table("truth_reward", episode.rewards) == table["truth_reward"][rows]
        assert (
            episode.truncations.tolist() == [False] * 29 + [True] and not episode.terminations.any()
        )
        infos = dict(episode.infos)
        assert len(infos.pop("truth_cost")) == 31  # which the table leaves to its reader
        assert len(infos) == len(table) - len(CHANNELS) - 3  # but vehicle, seed and reward
        for name, values in infos.items():
            assert len(values) == 31 and in_the_table(name, values[1:]) == table[name][rows]


def in_the_table(name, values):
    """The values as the table rounds them."""
    kind = EPISODES.field(name).type
    return (values.astype(np.float32) if kind == pyarrow.float32() else values).tolist()


MISSIONS = {
    "drawn": (),
    "from rest": ("--mission", "acceleration"),
    "one speed": ("--mission", "0.4"),
}


def test_the_recovered_environment_draws_from_the_same_distributions(tmp_path, load):
    (tmp_path / "faults.json").write_text('{"healthy": 0.0, "onset": [0.5, 2.0]}')
    (tmp_path / "missions.json").write_text('{"speed": [0.3, 0.4]}')
    options = (
        "--schedules",
        str(tmp_path / "faults.json"),
        "--missions",
        str(tmp_path / "missions.json"),
        "--realism",
        "1",
    )
    data = load(simulated(tmp_path / "run", *options))
    env = data.recover_environment()
    for episode, made in zip(data, data.storage.get_episode_metadata(range(3)), strict=True):
        observation, _ = env.reset(seed=made["seed"])
        observations = [observation]
        for action in episode.actions:
            observations.append(env.step(action)[0])
        np.testing.assert_array_equal(episode.observations, np.stack(observations))


@pytest.mark.parametrize("mission", MISSIONS.values(), ids=MISSIONS)
def test_the_recovered_environment_replays_every_episode(tmp_path, load, mission):
    (tmp_path / "fault.json").write_text(FAULT)
    settings = (
        "--preset",
        "npsnet1995",
        "--sensor-noise",
        "0.5",
        "--schedule",
        str(tmp_path / "fault.json"),
    )
    data = load(simulated(tmp_path / "run", *settings, *mission))
    env = data.recover_environment()
    assert data.observation_space == env.observation_space and data.action_space == env.action_space
    for episode, made in zip(data, data.storage.get_episode_metadata(range(3)), strict=True):
        observation, info = env.reset(seed=made["seed"], options=made["options"])
        told = [(observation, 0.0, info["truth"]["label"], info["energy"])]
        for action in episode.actions:
            observation, reward, terminated, truncated, info = env.step(action)
            told.append((observation, reward, info["truth"]["label"], info["energy"]))
        assert truncated and not terminated
        observations, rewards, labels, energy = zip(*told, strict=True)
        np.testing.assert_array_equal(episode.observations, np.stack(observations))
        assert episode.rewards.tolist() == list(rewards[1:])
        assert episode.infos["truth_label"].tolist() == list(labels)
        assert episode.infos["truth_energy"][1:].tolist() == list(energy[1:])
        assert labels[10:12] == ("normal", "propeller_loss:port")


def test_sampled_schedules_replay_too(tmp_path, load):
    data = load(simulated(tmp_path / "run", "--vehicles", "6", steps=400))
    recorded = json.loads((tmp_path / "run" / "schedules.json").read_text())
    env = data.recover_environment()
    for lane, made in enumerate(data.storage.get_episode_metadata(range(6))):
        assert made["options"] == {"schedule": recorded[str(lane)]}
        observation, _ = env.reset(seed=made["seed"], options=made["options"])
        for action in data[lane].actions:
            observation, *_ = env.step(action)
        np.testing.assert_array_equal(data[lane].observations[-1], observation)


def test_episodes_in_chunks_equal_those_at_once(tmp_path, load, monkeypatch):
    whole = [episode.observations for episode in load(simulated(tmp_path / "whole"))]
    monkeypatch.setattr(simulate, "ROWS_AT_ONCE", 60)
    parts = [episode.observations for episode in load(simulated(tmp_path / "parts"))]
    np.testing.assert_array_equal(parts, whole)


def test_nothing_outside_the_output_changes(tmp_path, monkeypatch):
    monkeypatch.delenv("MINARI_DATASETS_PATH", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    before = dict(os.environ)
    simulated(tmp_path / "run")
    assert dict(os.environ) == before
    assert [path.name for path in tmp_path.iterdir()] == ["run"]
    assert (
        str(tmp_path)
        not in (Path(tmp_path) / "run" / "minari" / DATASET / "data" / "metadata.json").read_text()
    )


def refused(tmp_path, capfd, *arguments):
    code = cli.main(
        ["simulate", "--output", str(tmp_path / "run"), "--formats", "minari", *arguments]
    )
    message = capfd.readouterr().err.splitlines()[-1]
    assert code == 2 and not list(tmp_path.iterdir())
    return message


def test_a_missing_package_is_named_with_its_extra(tmp_path, capfd, monkeypatch):
    monkeypatch.setitem(sys.modules, "minari.dataset.minari_storage", None)
    assert "pip install 'auv-fault[formats]'" in refused(tmp_path, capfd)


def test_an_episode_too_long_for_minari_is_refused(tmp_path, capfd):
    assert "duration of Minari's episodes: got 20000.0" in refused(
        tmp_path, capfd, "--duration", "20000"
    )
