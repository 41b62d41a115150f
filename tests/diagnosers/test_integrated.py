"""The integrated network: what its weights must be, and what it says of faults it knows and does not know."""

import numpy as np
import pytest
import torch

from auv_fault_env.errors import InputError
from auv_fault_env.faults import CATALOGUE, Fault
from auv_fault_env.fleet import Fleet
from auv_fault_env.schedules import FaultEvent
from diagnosers import UNKNOWN, decide, make, storage
from diagnosers.integrated import CLASSES, N_OUTPUTS, PACKAGED, RELEASE, Integrated, Network, Steady, calmed
from training.rollouts import manoeuvres, roll_out


def watched(fault, severity, lanes=16, seconds=50, onset=10.0):
    rollout = roll_out(
        Fleet(lanes),
        range(lanes),
        10 * seconds,
        manoeuvres(1, 10 * seconds, lanes),
        [(FaultEvent(fault, onset, severity),)] * lanes,
    )
    diagnoser = make("integrated")
    diagnoser.reset(lanes)
    beliefs = [diagnoser.update(observation) for observation in rollout.observations]
    return beliefs, diagnoser.classes


def test_weights_of_the_package_are_small_and_complete():
    assert sum(path.stat().st_size for path in storage.WEIGHTS.iterdir()) < 2e6
    tensors, header = storage.read(PACKAGED)
    assert header["diagnoser"] == "integrated"
    assert tensors["sharpness"] > 0.0


@pytest.mark.parametrize("fault", ["seal_friction:port", "motor_overheating:starboard", "sensor_bias:port_voltage"])
def test_plain_faults_are_named_and_graded(fault):
    beliefs, classes = watched(fault, 0.6)
    assert decide(beliefs[80], classes).count("normal") >= 15
    diagnosis = CATALOGUE[fault].diagnosis
    assert decide(beliefs[-1], classes).count(diagnosis) >= 14
    severity = beliefs[-1].severity_mean[:, classes.index(diagnosis)]
    assert abs(np.median(severity) - 0.6) < 0.15


def test_a_fault_of_no_class_is_not_called_normal(monkeypatch):
    strange = Fault("strange", "hull", scale={"alpha": 4.0, "port_c1": 3.0, "port_resistance": 3.0})
    monkeypatch.setitem(CATALOGUE, "strange", strange)
    beliefs, classes = watched("strange", 1.0)
    words = decide(beliefs[-1], classes, name=0.9)
    assert "normal" not in words
    assert UNKNOWN in words


def belief_of(fault, probability):
    """Log probabilities (1, 4) of normal and three faults, `fault` having all that normal has not."""
    shares = np.full(3, 1e-6)
    shares[fault] = 1.0
    return np.log(np.concatenate([[1.0 - probability], probability * shares / shares.sum()]))[None]


def test_the_odds_of_a_fault_rise_at_once_and_fall_slowly():
    steady = Steady(np.full(1, np.nan), np.zeros((1, 3))).after(belief_of(0, 0.01))
    assert np.allclose(np.exp(steady.log_probability()[0, 0]), 0.99)
    steady = steady.after(belief_of(1, 0.999))
    assert np.allclose(np.exp(steady.log_probability()[0, 0]), 0.001)
    for _ in range(round(10 * RELEASE)):
        steady = steady.after(belief_of(1, 0.01))
    risen, fallen = np.log(0.999 / 0.001), np.log(0.01 / 0.99)
    assert np.isclose((steady.odds[0] - fallen) / (risen - fallen), np.exp(-1.0), rtol=0.05)
    assert np.isclose(np.exp(steady.log_probability()).sum(), 1.0)


def test_one_odd_sample_does_not_rename_a_fault():
    steady = Steady(np.full(1, np.nan), np.zeros((1, 3)))
    for fault in (2, 2, 2, 2, 0, 2):
        steady = steady.after(belief_of(fault, 0.99))
        assert steady.log_probability()[0, 1:].argmax() == 2
    for _ in range(20):
        steady = steady.after(belief_of(0, 0.99))
    assert steady.log_probability()[0, 1:].argmax() == 0


def test_an_untrained_network_says_what_the_bank_says():
    network = Network().requires_grad_(False)
    odds = torch.randn(5, len(CLASSES) - 1)
    features = torch.zeros(5, network.encoder[0].in_features)
    features[:, -2 * odds.shape[1] : -odds.shape[1]] = odds
    _, opinion = network.look(features)
    np.testing.assert_allclose(opinion[:, 1 : len(CLASSES)], 5.0 * odds, rtol=1e-6)
    assert (opinion[:, 0] == 0.0).all()


def test_a_calm_opinion_follows_within_its_time():
    before, opinion = torch.zeros(1, N_OUTPUTS), torch.ones(1, N_OUTPUTS)
    for _ in range(5):  # half a second
        before = calmed(opinion, before)
    assert 0.55 < float(before[0, 0]) < 0.7


@pytest.mark.parametrize(
    "break_it", [lambda t: t.pop("trust"), lambda t: t.update(trust=t["trust"][:-1]), lambda t: t["bias"].fill(np.nan)]
)
def test_weights_of_another_architecture_are_refused(break_it):
    tensors = storage.read(PACKAGED)[0]
    break_it(tensors)
    with pytest.raises(InputError, match=r"^tensor"):
        Integrated(weights=tensors)


def test_a_truncated_file_is_refused(tmp_path):
    path = tmp_path / "integrated.safetensors"
    path.write_bytes(PACKAGED.read_bytes()[:-100])
    with pytest.raises(InputError, match=r"weights file: got .*integrated.safetensors.*complete safetensors"):
        make("integrated", weights=path)
