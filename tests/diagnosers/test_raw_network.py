import re

import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.faults import classes
from diagnosers import make
from diagnosers.networks import feed_forward
from diagnosers.raw_network import ARCHITECTURE, HYPOTHESES, RawNetwork, inputs, scores

from .runs import final_belief

CLASSES = classes()


OTHER = {"port": "starboard", "starboard": "port"}


def mirrored(names):
    """For every name the place of that of the other side."""
    swapped = [re.sub("port|starboard", lambda side: OTHER[side[0]], name) for name in names]
    return [list(names).index(name) for name in swapped]


def test_inputs_are_those_of_one_shaft_and_the_speed():
    observation = np.zeros((1, len(CHANNELS)))
    for name, value in dict(
        speed=0.3, port_voltage=2.0, starboard_current=1.0, starboard_rpm=300.0
    ).items():
        observation[0, INDEX[name]] = value
    np.testing.assert_allclose(inputs(observation), [[1, 0, 0, 1], [0, 2, 1, 1]])


def test_scores_by_hand():
    # normal, friction, drag, propeller
    port = [1.0, 2.0, 3.0, 4.0]
    starboard = [10.0, 20.0, 30.0, 40.0]
    np.testing.assert_allclose(
        scores(np.array([port, starboard])), [[11.0, 33.0, 12.0, 14.0, 21.0, 41.0]]
    )


def test_labels_are_the_modes_of_table_5_1_with_the_side():
    labels = make("raw_network").labels
    assert (
        labels["propeller_loss:port"]
        == labels["propeller_damage:port"]
        == "degraded propeller:port"
    )
    assert labels["seal_friction:starboard"] == "increased seal friction:starboard"
    assert labels["increased_drag"] == "increased drag" and labels["normal"] == "normal"
    assert (
        labels["motor_overheating:port"]
        is labels["sensor:speed"]
        is labels["decreased_drag"]
        is None
    )
    assert set(labels.values()) - {None} == set(HYPOTHESES)


def test_classes_of_one_label_get_equal_shares():
    probability = np.exp(final_belief("raw_network", "propeller_loss:port").log_probability[0])
    of = dict(zip(CLASSES, probability, strict=True))
    assert of["propeller_loss:port"] == of["propeller_damage:port"] > 0.1
    assert of["motor_overheating:port"] == of["sensor:speed"] == of["decreased_drag"] > 0.01


@pytest.mark.parametrize("side", ["port", "starboard"])
@pytest.mark.parametrize("fault", ["seal_friction", "propeller_loss"])
def test_names_the_mode_and_the_side_of_severe_faults_of_a_shaft(fault, side):
    labels = make("raw_network").labels
    belief = final_belief("raw_network", f"{fault}:{side}")
    assert labels[CLASSES[belief.log_probability.argmax()]] == labels[f"{fault}:{side}"]


def test_a_healthy_vehicle_is_normal():
    assert final_belief("raw_network", None).log_probability.argmax() == 0


def test_both_sides_are_alike():
    observation = np.abs(np.random.default_rng(0).normal(size=(5, len(CHANNELS))))
    network = RawNetwork(feed_forward.random_tensors(ARCHITECTURE, 0))
    straight, swapped = (
        network.step((), one)[1].log_probability
        for one in (observation, observation[:, mirrored(CHANNELS)])
    )
    np.testing.assert_allclose(swapped, straight[:, mirrored(CLASSES)], atol=1e-6)


def test_severity_is_that_of_the_prior():
    belief = final_belief("raw_network", "seal_friction:port")
    np.testing.assert_allclose(
        belief.severity_mean[0], [0.0, *[0.6] * 18, 0.0]
    )  # uniform on 0.2 to 1
    np.testing.assert_allclose(belief.severity_std[0], [0.0, *[0.8 / 12**0.5] * 18, 0.0])
