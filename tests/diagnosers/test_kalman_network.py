import numpy as np
import pytest

from auv_fault_env.faults import classes
from diagnosers import load, make
from diagnosers.kalman_network import KalmanNetwork, outputs
from diagnosers.networks.fault_map import MODES_5_2, fault_map, normalise

from .runs import final_belief

CLASSES = classes()


@pytest.mark.parametrize(
    ("alpha", "beta"),
    [(1.0, 1.0), (1.35, 1.0), (1.9, 1.0), (0.55, 1.0), (1.0, 0.63), (1.0, 0.5), (1.0, 0.2)],
)
def test_the_network_has_learnt_the_map(alpha, beta):
    point = normalise(np.array([alpha]), np.array([beta]))
    got = outputs(make("kalman_network").network.evaluate(point))
    target = fault_map(point)
    assert got.argmax() == target.argmax()
    np.testing.assert_allclose(got, target, atol=0.2)


def test_labels_are_the_modes_of_table_5_2():
    labels = make("kalman_network").labels
    assert (
        labels["propeller_loss:port"]
        == labels["propeller_loss:starboard"]
        == "severe propulsion failure"
    )
    assert (
        labels["propeller_damage:port"] == "decreased propulsion"
        and labels["decreased_drag"] == "decreased drag"
    )
    assert labels["seal_friction:port"] is labels["sensor:speed"] is None
    assert set(labels.values()) - {None} == set(MODES_5_2)


@pytest.mark.parametrize("fault", ["increased_drag", "decreased_drag"])
def test_names_severe_faults_of_the_hull(fault):
    assert CLASSES[final_belief("kalman_network", fault).log_probability.argmax()] == fault


def test_a_lost_propeller_is_severe_and_has_no_side():
    belief = final_belief("kalman_network", "propeller_loss:port")
    probability = dict(zip(CLASSES, np.exp(belief.log_probability[0]), strict=True))
    assert probability["propeller_loss:port"] == probability["propeller_loss:starboard"]
    assert probability["propeller_loss:port"] == max(probability.values())
    assert belief.severity_mean[0, CLASSES.index("propeller_loss:port")] > 0.75


def test_a_healthy_vehicle_is_normal():
    assert final_belief("kalman_network", None).log_probability.argmax() == 0


def test_severity_grows_with_the_drag():
    means = [
        final_belief("kalman_network", "increased_drag", severity).severity_mean[0, 1]
        for severity in (0.3, 0.9)
    ]
    assert means[0] + 0.15 < means[1]


def test_the_vehicle_is_kept(tmp_path):
    path = tmp_path / "weights.safetensors"
    KalmanNetwork("npsnet1995").save(path)
    assert load(path).vehicle.name == "npsnet1995"
