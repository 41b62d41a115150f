"""Training of the integrated network on a few short episodes."""

import numpy as np
import pytest
import torch

from auv_fault_env import classes
from diagnosers.networks.class_list import SHIPPED_CLASSES
from diagnosers.networks.features import feature_names
from training.learning import episode_sets, integrated
from training.learning.episode_sets import mirror_order, mirrored, simulate_set
from training.learning.integrated import IntegratedTrainer, calibrate

FEATURES = feature_names(SHIPPED_CLASSES)

CLASSES = classes()


@pytest.fixture(autouse=True)
def small(monkeypatch):
    for name, value in dict(
        LANES=8, SETS=2, ENCODER_STEPS=3, SAMPLES_PER_SET=16, ENCODER_EPOCHS=1, VALIDATION_SETS=1
    ).items():
        monkeypatch.setattr(integrated, name, value)
    monkeypatch.setattr(episode_sets, "LANES", 8)
    monkeypatch.setattr(episode_sets, "BATCH", 4)
    monkeypatch.setattr("training.learning.episodes.N_SAMPLES", 60)


def test_a_restored_trainer_goes_on_bit_for_bit():
    trainer = IntegratedTrainer(3)
    restored = IntegratedTrainer(3)
    trainer.epoch(0)
    restored.restore({name: np.array(tensor) for name, tensor in trainer.state().items()})
    assert trainer.epoch(1) == restored.epoch(1)
    assert trainer.validate() == restored.validate()
    for name, tensor in trainer.state().items():
        np.testing.assert_array_equal(restored.state()[name], tensor, strict=True)


def test_memory_learns_only_after_the_encoder():
    trainer = IntegratedTrainer(0)
    at_start = trainer.state()
    trainer.epoch(0)
    after = trainer.state()
    assert np.array_equal(after["memory.weight_hh_l0"], at_start["memory.weight_hh_l0"])
    assert not np.array_equal(after["encoder.0.weight"], at_start["encoder.0.weight"])
    trainer.epoch(1)
    assert not np.array_equal(trainer.state()["memory.weight_hh_l0"], after["memory.weight_hh_l0"])


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
    episodes = episodes._replace(label=torch.full_like(episodes.label, port))
    swapped = mirrored(episodes)
    assert (swapped.label == starboard).all()
    assert not torch.equal(swapped.features, episodes.features)
    assert torch.equal(mirrored(swapped).features, episodes.features)
    assert FEATURES[mirror_order(FEATURES)[FEATURES.index("port_rpm:step")]] == "starboard_rpm:step"


def test_calibration_mends_what_is_too_sure():
    generator = torch.Generator().manual_seed(0)
    network = IntegratedTrainer(0).network
    truth = torch.randn(4000, len(SHIPPED_CLASSES), generator=generator)
    label = torch.distributions.Categorical(logits=truth).sample()
    before, after = calibrate(network, 3.0 * truth, label)
    assert after < before
    assert abs(float(network.sharpness) - 1 / 3) < 0.05


def test_finish_gives_a_diagnoser_with_what_was_learnt():
    trainer = IntegratedTrainer(0)
    trainer.epoch(0)
    diagnoser, figures = trainer.finish()
    assert figures["calibration_loss"] <= figures["calibration_loss_before"]
    assert np.array_equal(diagnoser.tensors()["trust"], trainer.state()["trust"])
