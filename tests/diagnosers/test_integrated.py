"""The integrated network: what its weights must be, and what it says of faults it knows and does
not know.
"""

import numpy as np
import pytest
import torch

from auv_fault_env.errors import InputError
from auv_fault_env.faults import CATALOGUE, Fault, classes
from auv_fault_env.fleet import Fleet
from auv_fault_env.schedules import FaultEvent
from diagnosers import UNKNOWN, decide, make, storage
from diagnosers.integrated import PACKAGED, Integrated
from diagnosers.networks.class_list import SHIPPED_CLASSES
from diagnosers.networks.integrated_network import Network
from diagnosers.networks.numpy_network import (
    N_MEMORY,
    NumpyNetwork,
    architecture,
    n_outputs,
    smooth_opinion,
)
from training.rollouts import manoeuvres, roll_out


def beliefs_of(diagnoser, fault, severity, lanes=16, seconds=50, onset=10.0):
    rollout = roll_out(
        Fleet(lanes),
        range(lanes),
        10 * seconds,
        manoeuvres(1, 10 * seconds, lanes),
        [(FaultEvent(fault, onset, severity),)] * lanes,
    )
    diagnoser.reset(lanes)
    return [diagnoser.update(observation) for observation in rollout.observations]


def test_weights_of_the_package_are_small_and_complete():
    assert sum(path.stat().st_size for path in storage.WEIGHTS.iterdir()) < 2e6
    tensors, header = storage.read(PACKAGED)
    assert header["diagnoser"] == "integrated"
    assert tensors["sharpness"] > 0.0


@pytest.mark.parametrize(
    "fault", ["seal_friction:port", "motor_overheating:starboard", "sensor_bias:port_voltage"]
)
def test_plain_faults_are_named_and_graded(fault):
    diagnoser = make("integrated")
    classes = diagnoser.classes
    beliefs = beliefs_of(diagnoser, fault, 0.6)
    assert decide(beliefs[80], classes).count("normal") >= 15
    diagnosis = CATALOGUE[fault].diagnosis
    assert decide(beliefs[-1], classes).count(diagnosis) >= 14
    severity = beliefs[-1].severity_mean[:, classes.index(diagnosis)]
    assert abs(np.median(severity) - 0.6) < 0.15


def test_a_fault_of_no_class_is_not_called_normal(monkeypatch):
    strange = Fault("strange", "hull", scale={"alpha": 4.0, "port_c1": 3.0, "port_resistance": 3.0})
    diagnoser = make("integrated")
    monkeypatch.setitem(CATALOGUE, "strange", strange)
    beliefs = beliefs_of(diagnoser, "strange", 1.0)
    words = decide(beliefs[-1], diagnoser.classes, name=0.9)
    assert "normal" not in words
    assert UNKNOWN in words


def test_an_untrained_network_says_what_the_bank_says():
    network = Network().requires_grad_(False)
    odds = torch.randn(5, len(SHIPPED_CLASSES) - 1)
    features = torch.zeros(5, network.encoder[0].in_features)
    features[:, -2 * odds.shape[1] : -odds.shape[1]] = odds
    _, opinion = network.encode(features)
    np.testing.assert_allclose(opinion[:, 1 : len(SHIPPED_CLASSES)], 5.0 * odds, rtol=1e-6)
    assert (opinion[:, 0] == 0.0).all()


def test_a_calm_opinion_follows_within_its_time():
    before = np.zeros((1, n_outputs(19)))
    opinion = np.ones((1, n_outputs(19)))
    for _ in range(5):  # half a second
        before = smooth_opinion(opinion, before)
    assert 0.55 < before[0, 0] < 0.7


def test_the_architecture_is_that_of_the_network_in_torch():
    assert {
        name: tuple(tensor.shape) for name, tensor in Network().state_dict().items()
    } == architecture(SHIPPED_CLASSES)


def test_a_network_that_learnt_unknown_says_so_without_a_severity():
    weights = Network(classes=classes()).tensors()
    weights["bias"][-1] = 60.0
    diagnoser = Integrated(weights=weights, trained_classes=classes())
    diagnoser.reset(2)
    observation = Fleet(2).reset([1, 2])
    belief = diagnoser.update(observation)
    assert decide(belief, diagnoser.classes) == [UNKNOWN] * 2
    np.testing.assert_allclose(np.exp(belief.log_probability).sum(axis=1), 1.0)
    for moment in belief[1:]:
        assert (moment[:, [0, -1]] == 0.0).all()
        assert (moment[:, 1:-1] > 0.0).all()


def test_numpy_recalls_what_torch_does():
    trained = storage.settings_of(PACKAGED).get("trained_classes", SHIPPED_CLASSES)
    network = Network(classes=trained)
    tensors = storage.read(PACKAGED)[0]
    network.load_state_dict({name: torch.from_numpy(tensor) for name, tensor in tensors.items()})
    recall = NumpyNetwork(tensors)
    random = np.random.default_rng(0)
    features = random.normal(size=(40, 3, network.encoder[0].in_features)).astype(np.float32)
    units = np.zeros((3, N_MEMORY), np.float32)
    with torch.inference_mode():
        outputs, _ = network.recur(*network.encode(torch.from_numpy(features)))
        told = network.decode(outputs, torch.from_numpy(features))
    for k, sample in enumerate(features):
        ours, units = recall.recur(*recall.encode(sample), units)
        for one, other in zip(recall.decode(ours, sample), told, strict=True):
            np.testing.assert_allclose(one, other[k], atol=1e-4)


@pytest.mark.parametrize(
    "break_it",
    [
        lambda t: t.pop("trust"),
        lambda t: t.update(trust=t["trust"][:-1]),
        lambda t: t["bias"].fill(np.nan),
    ],
)
def test_weights_of_another_architecture_are_refused(break_it):
    tensors = storage.read(PACKAGED)[0]
    break_it(tensors)
    with pytest.raises(InputError, match=r"^tensor"):
        Integrated(weights=tensors)


def test_a_truncated_file_is_refused(tmp_path):
    path = tmp_path / "integrated.safetensors"
    path.write_bytes(PACKAGED.read_bytes()[:-100])
    with pytest.raises(
        InputError, match=r"weights file: got .*integrated.safetensors.*complete safetensors"
    ):
        make("integrated", weights=path)
