import numpy as np
import pytest

from diagnosers.residuals import Residuals, lasting
from training.learning import residuals
from training.learning.residuals import (
    LAYOUT,
    WITHIN,
    ResidualsTrainer,
    calibration_missions,
    with_limits,
)


@pytest.fixture(autouse=True)
def few_missions(monkeypatch):
    monkeypatch.setattr(residuals, "LANES", 16)
    monkeypatch.setattr(residuals, "SETS", 1)
    monkeypatch.setattr(residuals, "DURATION", 200.0)


def test_the_relations_of_an_average_vehicle_predict_others_of_the_band():
    trainer = ResidualsTrainer(0)
    assert trainer.validate()["loss"] > 0.5
    assert trainer.epoch(0)["loss"] < 0.3
    assert trainer.validate()["loss"] < 0.3


def test_a_restored_training_ends_with_the_same_relations_and_limits():
    trainer = ResidualsTrainer(1)
    trainer.epoch(0)
    other = ResidualsTrainer(2)
    other.restore(trainer.state())
    found, figures = trainer.finish()
    same, same_figures = other.finish()
    assert found.settings() == same.settings()
    assert figures == same_figures and all(0.01 < value < 1.0 for value in figures.values())


def test_a_share_of_the_healthy_missions_stays_within_each_limit():
    trainer = ResidualsTrainer(0)
    trainer.epoch(0)
    first, _ = trainer.finish()
    narrow = with_limits(first.model, list(calibration_missions())[:4])
    diagnoser = Residuals(with_limits(narrow, calibration_missions()))
    strengths = [diagnoser.course(one).strength.max(axis=0) for one in calibration_missions()]
    share = np.quantile(strengths, WITHIN, axis=0)
    for name in LAYOUT.residuals:
        for rule in (name, lasting(name)):
            assert share[diagnoser.rules.index(rule)] == pytest.approx(1.0)
