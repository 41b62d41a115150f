import numpy as np
import pytest

from diagnosers.kalman_network import labels
from diagnosers.networks.fault_map import MODES_5_2
from diagnosers.networks.modes import class_log_probability, class_shares, log_softmax
from training.learning import kalman_network
from training.learning.kalman_network import KalmanNetworkTrainer, calibrate, severity_lines

CLASSES = list(labels())


def trained(trainer, epochs):
    for number in epochs:
        trainer.epoch(number)
    return trainer


def test_a_resumed_training_equals_an_uninterrupted_one():
    straight = trained(KalmanNetworkTrainer(1), range(2)).state()
    resumed = KalmanNetworkTrainer(1)
    resumed.restore(trained(KalmanNetworkTrainer(1), range(1)).state())
    for name, tensor in trained(resumed, range(1, 2)).state().items():
        np.testing.assert_array_equal(tensor, straight[name])


def test_training_learns_the_map():
    trainer = KalmanNetworkTrainer(0)
    before = trainer.validate()["loss"]
    trained(trainer, range(4))
    assert trainer.validate()["loss"] < 0.25 * before
    assert kalman_network.share_right(trainer.network) > 0.9


def test_calibration_finds_slopes_and_offsets_that_made_the_classes():
    random = np.random.default_rng(0)
    sums = random.normal(size=(20_000, len(MODES_5_2)))
    slope = np.array([1.0, 2.0, 0.5, 1.5, 1.0])
    offset = np.array([0.0, 1.0, -1.0, 0.5, 0.0])
    belief = np.exp(
        class_log_probability(log_softmax(slope * sums + offset), class_shares(labels(), MODES_5_2))
    )
    label = (belief.cumsum(axis=1) > random.uniform(size=(len(sums), 1))).argmax(axis=1)
    found_slope, found_offset, loss = calibrate(sums, label)
    np.testing.assert_allclose(found_slope, slope, atol=0.3)
    np.testing.assert_allclose(found_offset - found_offset[0], offset, atol=0.3)
    assert loss == pytest.approx(-np.log(belief[np.arange(len(sums)), label]).mean(), abs=1e-3)


def test_lines_by_hand():
    drag = CLASSES.index("increased_drag")
    loss = CLASSES.index("propeller_loss:starboard")
    label = np.repeat(
        [drag, loss, CLASSES.index("decreased_drag"), CLASSES.index("propeller_damage:port")], 4
    )
    height = np.tile([0.0, 0.0, 1.0, 1.0], 4)
    true_severity = np.concatenate([[0.2, 0.4, 0.8, 1.0], np.full(4, 0.7), height[:8]])
    table = severity_lines(height, label, true_severity)
    np.testing.assert_allclose(table[:2], [[0, 0, 0], [0.3, 0.6, 0.1]], atol=1e-12)
    np.testing.assert_allclose(table[-1], [0.7, 0, 0], atol=1e-12)


def test_finish_gives_a_diagnoser_with_the_weights_of_the_training(monkeypatch):
    monkeypatch.setattr(kalman_network, "LANES", 128)
    trainer = trained(KalmanNetworkTrainer(0), range(1))
    diagnoser, figures = trainer.finish()
    np.testing.assert_array_equal(
        diagnoser.tensors()["output_weight"], trainer.state()["output_weight"]
    )
    assert np.isfinite(list(figures.values())).all()
    assert (diagnoser.tensors()["severity"][1:, 2] > 0.0).all()
