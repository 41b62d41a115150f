"""``auv-fault train-stimulus`` on a handful of vehicles: it runs, goes on after a break, and
refuses bad input.
"""

import json

import numpy as np
import pytest

from auv_fault_env import classes
from diagnosers import storage
from training import cli
from training.learning import budgeted, stimulus
from training.learning.checkpoint import FILE, LOG
from training.learning.reproducible import seeded_generators
from training.learning.stimulus import SETTINGS, StimulusTrainer
from training.seeds import purpose_of
from training.stimuli.policy import LearnedPolicy
from training.stimuli.policy_inputs import BOUNDS

N_DECISIONS = 8
SMALL = dict(LANES=4, ROLLOUTS=2, VALIDATION_LANES=3, N_DECISIONS=N_DECISIONS, DEMONSTRATED=10)
SMALL["SETTINGS"] = SETTINGS | {"n_epochs": 2, "batch_size": 16}
NAME = "stimulus-filter_bank-0"
EPOCHS = 3
STEPS = str(3 * 64 - 5)  # rounded up to three epochs


@pytest.fixture(autouse=True, scope="module")
def small():
    with pytest.MonkeyPatch.context() as patch:
        for name, value in SMALL.items():
            patch.setattr(stimulus, name, value)
        patch.setattr(budgeted, "N_DECISIONS", N_DECISIONS)
        yield


def run(output, *arguments):
    return cli.main(
        [
            "train-stimulus",
            "--output",
            str(output),
            "--steps",
            STEPS,
            *arguments,
        ]
    )


def card(output):
    return json.loads((output / f"{NAME}.json").read_text())


def refused(capsys, *parts):
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("auv-fault")]
    assert len(lines) == 1
    for part in parts:
        assert part in lines[0]


@pytest.fixture(scope="module")
def whole(small, tmp_path_factory):
    output = tmp_path_factory.mktemp("whole") / "run"
    assert run(output) == 0
    return output


def test_run_is_complete_and_its_policy_can_be_loaded(whole):
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
    policy = LearnedPolicy.load(whole / f"{NAME}.safetensors")
    assert policy.diagnoser == "filter_bank" and policy.classes == classes()
    action = policy.action(np.transpose(list(BOUNDS.values())))
    assert action.shape == (2, 1) and np.abs(action).max() <= 1.0
    assert "Learning curve" in (whole / "index.html").read_text()


def test_card_tells_how_the_policy_was_made(whole):
    made = card(whole)
    command = f"auv-fault train-stimulus --diagnoser filter_bank --seed 0 --steps {STEPS}"
    assert made["command"] == command
    assert (made["epochs"], len(made["history"]), made["seed"]) == (EPOCHS, EPOCHS, 0)
    assert made["features"] == list(BOUNDS)
    assert made["figures"].keys() == {"decisions_per_second"}
    assert made["figures"]["decisions_per_second"] > 0
    assert made["validation"] == made["history"][made["best_epoch"] - 1]["validation"]
    assert {"loss", "delay", "healthy_share", "approx_kl"} < made["history"][0]["train"].keys()
    assert made["versions"]["torch"] and made["versions"]["stable-baselines3"]


def test_broken_off_run_goes_on_bit_for_bit(whole, tmp_path, monkeypatch, capsys):
    output = tmp_path / "run"
    epoch = StimulusTrainer.epoch

    def broken(self, number):
        if number == 2:
            raise KeyboardInterrupt
        return epoch(self, number)

    with monkeypatch.context() as patch:
        patch.setattr(StimulusTrainer, "epoch", broken)
        assert run(output) == 130
    refused(capsys, "stopped; the same command goes on after the last complete epoch")
    assert not output.exists()
    assert {path.name for path in output.with_name("run-unfinished").iterdir()} == {FILE, LOG}
    for name, other, kept, asked in (
        ("seed", "1", "0", "1"),
        ("steps", "64", STEPS, "64"),
        ("diagnoser", "integrated", "'filter_bank'", "'integrated'"),
    ):
        assert run(output, f"--{name}", other) == 2
        refused(capsys, "checkpoint in", f"'{name}': {kept}", f"'{name}': {asked}", "--restart")
    numbers = []
    monkeypatch.setattr(
        StimulusTrainer, "epoch", lambda self, number: numbers.append(number) or epoch(self, number)
    )
    assert run(output) == 0
    assert numbers == [2]
    files = [folder / f"{NAME}.safetensors" for folder in (output, whole)]
    assert files[0].read_bytes() == files[1].read_bytes()
    strip = lambda made: [epoch | {"seconds": 0} for epoch in made["history"]]  # noqa: E731
    assert strip(card(output)) == strip(card(whole))


def test_finished_run_is_kept_and_can_be_installed(whole, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(storage, "WEIGHTS", tmp_path / "weights")
    monkeypatch.setattr(StimulusTrainer, "epoch", None)
    assert run(whole, "--install") == 0
    assert "already trained" in capsys.readouterr().out
    assert {path.name for path in (tmp_path / "weights").iterdir()} == {
        f"{NAME}.safetensors",
        f"{NAME}.json",
    }
    assert run(whole, "--seed", "1") == 2
    refused(capsys, "training in", "'seed': 0", "--restart")


def test_a_trainer_learns_and_restores_all_that_the_next_epoch_needs():
    trainer = StimulusTrainer(3)
    restored = StimulusTrainer(4)
    before = {name: np.array(tensor) for name, tensor in trainer.state().items()}
    trainer.epoch(0)
    after = {name: np.array(tensor) for name, tensor in trainer.state().items()}
    assert not np.array_equal(before["action_net.0.weight"], after["action_net.0.weight"])
    assert not np.array_equal(before["value_net.weight"], after["value_net.weight"])
    restored.restore(after)
    restored.seed = 3
    assert trainer.epoch(1) == restored.epoch(1)
    assert trainer.validate() == restored.validate()
    for name, tensor in trainer.state().items():
        np.testing.assert_array_equal(restored.state()[name], tensor, strict=True)


def test_validation_counts_one_whole_episode_of_each_vehicle(monkeypatch):
    seen = []
    monkeypatch.setattr(stimulus, "VALIDATION_LANES", 12)
    monkeypatch.setattr(stimulus, "figures", lambda outcomes: seen.extend(outcomes) or {"loss": 1})
    trainer = StimulusTrainer(0)
    assert trainer.validate() == {"loss": 1}
    assert sorted(outcome.lane for outcome in seen) == list(range(12))
    assert all(outcome.healthy_time + outcome.delay <= N_DECISIONS for outcome in seen)


def test_training_and_validation_have_seeds_of_their_own(monkeypatch):
    trainer = StimulusTrainer(0)
    used = []
    for env in (trainer.env, trainer.validation_env):
        fleet = env.env.fleet
        reset = fleet.reset
        monkeypatch.setattr(
            fleet,
            "reset",
            lambda seeds=None, *rest, reset=reset, **named: (
                used.append(seeds) or reset(seeds, *rest, **named)
            ),
        )
    trainer.epoch(0)
    trainer.epoch(1)
    trainer.validate()
    imitated, first, second, tried = (run for run in used if run is not None)
    assert {purpose_of(seed) for seed in (*imitated, *first, *second)} == {"training"}
    assert not set(imitated) & set(first) and set(first) != set(second)
    assert {purpose_of(seed) for seed in tried} == {"validation"}


def test_global_generators_are_left_as_they_were():
    torch = pytest.importorskip("torch")
    state = torch.random.get_rng_state()
    numbers = np.random.get_state()[1].copy()  # noqa: NPY002
    with seeded_generators(5):
        drawn = torch.rand(1), np.random.rand()  # noqa: NPY002
    with seeded_generators(5):
        assert (torch.rand(1), np.random.rand()) == drawn  # noqa: NPY002
    assert torch.equal(torch.random.get_rng_state(), state)
    assert np.array_equal(np.random.get_state()[1], numbers)  # noqa: NPY002


BAD = {
    "diagnoser": (
        ["--diagnoser", "filter_bnak"],
        "diagnoser: got 'filter_bnak'",
        "did you mean 'filter_bank'?",
    ),
    "reference": (["--diagnoser", "oracle"], "diagnoser: got 'oracle'"),
    "steps": (["--steps", "0"], "steps: got 0; allowed is a whole number from 1"),
    "seed": (["--seed", "-1"], "seed: got -1"),
}


@pytest.mark.parametrize("bad", BAD.values(), ids=BAD)
def test_bad_arguments_are_refused_in_one_line(tmp_path, bad, capsys):
    arguments, *parts = bad
    assert run(tmp_path / "run", *arguments) == 2
    refused(capsys, "auv-fault train-stimulus: ", *parts)
    assert not list(tmp_path.iterdir())
