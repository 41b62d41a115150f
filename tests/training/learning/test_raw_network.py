import numpy as np
import pytest
import torch

from diagnosers.networks import feed_forward
from diagnosers.raw_network import ARCHITECTURE
from training.learning import raw_network
from training.learning.raw_network import RawNetworkTrainer


@pytest.fixture(autouse=True)
def few_episodes(monkeypatch):
    monkeypatch.setattr(raw_network, "LANES", 64)


def trained(trainer, epochs):
    for number in epochs:
        trainer.epoch(number)
    return trainer


def test_a_resumed_training_equals_an_uninterrupted_one():
    straight = trained(RawNetworkTrainer(1), range(3)).state()
    resumed = RawNetworkTrainer(1)
    resumed.restore(trained(RawNetworkTrainer(1), range(1)).state())
    for name, tensor in trained(resumed, range(1, 3)).state().items():
        np.testing.assert_array_equal(tensor, straight[name])


def test_later_epochs_leave_a_state_as_it_was():
    trainer = trained(RawNetworkTrainer(0), range(1))
    state = trainer.state()
    copy = {name: tensor.copy() for name, tensor in state.items()}
    trainer.epoch(1)
    for name, tensor in state.items():
        np.testing.assert_array_equal(tensor, copy[name])


def test_other_seeds_learn_from_other_episodes():
    one, two = (RawNetworkTrainer(seed).epoch(0)["loss"] for seed in (0, 1))
    assert one != two


def test_training_lowers_the_loss_on_seeds_of_its_own():
    trainer = RawNetworkTrainer(0)
    before = trainer.validate()["loss"]
    assert trained(trainer, range(4)).validate()["loss"] < before - 0.1


def test_the_loss_is_that_of_the_belief_it_ends_in():
    trainer = RawNetworkTrainer(0)
    observations, label = raw_network.samples("training", 4, 0, np.random.default_rng(0))
    diagnoser, _ = trainer.finish()
    log_probability = diagnoser.step((), observations.astype(float))[1].log_probability
    expected = -log_probability[np.arange(len(label)), label].mean()
    with torch.inference_mode():
        assert trainer.loss(observations, label).item() == pytest.approx(expected, rel=1e-5)


def test_the_diagnoser_has_the_weights_of_the_training():
    trainer = trained(RawNetworkTrainer(0), range(1))
    diagnoser, figures = trainer.finish()
    assert {name: tensor.shape for name, tensor in diagnoser.tensors().items()} == ARCHITECTURE
    np.testing.assert_array_equal(
        diagnoser.tensors()["hidden_weight"], trainer.state()["hidden_weight"]
    )
    assert (
        diagnoser.tensors()["hidden_weight"]
        != feed_forward.random_tensors(ARCHITECTURE, 0)["hidden_weight"]
    ).any()
    assert np.isfinite(figures["calibration_loss"])
