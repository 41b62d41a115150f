"""Training of the integrated network on a few short episodes."""

import numpy as np
import pytest
import torch

from auv_fault_env import classes
from diagnosers.networks.features import feature_names
from training.learning import episode_sets, integrated, learner
from training.learning.episode_sets import EpisodeSet, mirror_order, mirrored, simulate_set
from training.learning.integrated import IntegratedTrainer
from training.learning.learner import Learner, calibrate

CLASSES = classes()
UNKNOWN = CLASSES.index("unknown")
FEATURES = feature_names(CLASSES)


@pytest.fixture(autouse=True)
def small(monkeypatch):
    for name, value in dict(LANES=8, SETS=2, ENCODER_EPOCHS=1, VALIDATION_SETS=1).items():
        monkeypatch.setattr(integrated, name, value)
    monkeypatch.setattr(learner, "ENCODER_STEPS", 3)
    monkeypatch.setattr(learner, "SAMPLES_PER_SET", 16)
    monkeypatch.setattr(episode_sets, "LANES", 8)
    monkeypatch.setattr(episode_sets, "BATCH", 4)
    monkeypatch.setattr("training.learning.episodes.N_SAMPLES", 60)


@pytest.fixture
def two_networks(monkeypatch):
    monkeypatch.setattr(integrated, "NETWORKS", 2)


def test_a_restored_trainer_goes_on_bit_for_bit(two_networks):
    trainer = IntegratedTrainer(3)
    restored = IntegratedTrainer(3)
    trainer.epoch(0)
    restored.restore({name: np.array(tensor) for name, tensor in trainer.state().items()})
    assert trainer.epoch(1) == restored.epoch(1)
    assert trainer.validate() == restored.validate()
    for name, tensor in trainer.state().items():
        np.testing.assert_array_equal(restored.state()[name], tensor, strict=True)


def test_memory_learns_only_after_the_encoder(two_networks):
    trainer = IntegratedTrainer(0)
    at_start = trainer.state()
    trainer.epoch(0)
    after = trainer.state()
    assert np.array_equal(after["1.memory.weight_hh_l0"], at_start["1.memory.weight_hh_l0"])
    assert not np.array_equal(after["1.encoder.0.weight"], at_start["1.encoder.0.weight"])
    trainer.epoch(1)
    later = trainer.state()
    assert not np.array_equal(later["1.memory.weight_hh_l0"], after["1.memory.weight_hh_l0"])


def test_the_first_network_learns_what_it_learns_alone(monkeypatch):
    states = []
    for n_networks in (1, 2):
        monkeypatch.setattr(integrated, "NETWORKS", n_networks)
        trainer = IntegratedTrainer(5)
        trainer.epoch(0)
        trainer.epoch(1)
        states.append(trainer.state())
    alone, together = states
    assert len(together) == 2 * len(alone)
    for name, tensor in alone.items():
        np.testing.assert_array_equal(together[name], tensor, strict=True)
    assert not np.array_equal(together["1.encoder.0.weight"], together["0.encoder.0.weight"])


def test_the_weights_are_those_of_the_better_seed_and_the_card_has_all(two_networks, monkeypatch):
    monkeypatch.setattr("training.learning.episodes.N_SAMPLES", 250)  # some have a fault by then
    trainer = IntegratedTrainer(7)
    trainer.epoch(0)
    with torch.no_grad():
        trainer.learners[0].network.opinion.bias[3] = 9.0  # a class out of nowhere
    validation = trainer.validate()
    assert validation["loss"] == validation["loss_of_seed_8"] < validation["loss_of_seed_7"]
    diagnoser, figures = trainer.finish()
    assert diagnoser.trained_classes == CLASSES
    assert figures["seed_of_weights"] == 8
    assert figures["validation_losses_of_seeds"][1] == validation["loss"]
    losses = figures["calibration_losses_of_seeds"]
    assert figures["calibration_loss"] == losses[1] <= figures["calibration_loss_before"]
    assert figures["spread_of_calibration_losses"] == abs(losses[0] - losses[1]) > 0.0
    assert np.array_equal(diagnoser.tensors()["trust"], trainer.state()["1.trust"])
    assert not np.array_equal(diagnoser.tensors()["trust"], trainer.state()["0.trust"])


def test_epochs_and_purposes_learn_from_different_episodes():
    features = [
        simulate_set(purpose, first).features
        for purpose, first in (("training", 0), ("training", 8), ("validation", 0))
    ]
    assert all(not torch.equal(features[a], features[b]) for a, b in ((0, 1), (0, 2), (1, 2)))
    assert torch.equal(simulate_set("training", 0).features, features[0])


def test_mirror_image_is_its_own_inverse_and_swaps_the_label():
    episodes = simulate_set("training", 0)
    port, starboard = (CLASSES.index(f"seal_friction:{side}") for side in ("port", "starboard"))
    episodes.label[:] = port
    episodes.label[30:] = UNKNOWN
    swapped = mirrored(episodes)
    assert (swapped.label[:30] == starboard).all()
    assert (swapped.label[30:] == UNKNOWN).all()
    assert not torch.equal(swapped.features, episodes.features)
    assert torch.equal(mirrored(swapped).features, episodes.features)
    assert FEATURES[mirror_order(FEATURES)[FEATURES.index("port_rpm:step")]] == "starboard_rpm:step"


@pytest.mark.parametrize(("label", "has_severity"), [(0, False), (5, True), (UNKNOWN, False)])
def test_only_known_faults_teach_a_severity(label, has_severity):
    one = Learner(0)
    features = torch.zeros(2, one.network.encoder[0].in_features)
    losses = []
    for severity in (0.2, 0.9):
        samples = EpisodeSet(features, torch.full((2,), label), torch.full((2,), severity))
        _, severity_loss = one.losses(one.network.encode(features)[1], samples)
        losses.append(severity_loss.item())
    assert (losses[0] != losses[1]) == has_severity


def test_calibration_mends_what_is_too_sure():
    generator = torch.Generator().manual_seed(0)
    network = Learner(0).network
    truth = torch.randn(4000, len(CLASSES), generator=generator)
    label = torch.distributions.Categorical(logits=truth).sample()
    before, after = calibrate(network, 3.0 * truth, label)
    assert after < before
    assert abs(float(network.sharpness) - 1 / 3) < 0.05
