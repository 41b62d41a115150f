import numpy as np
import pytest

from auv_fault_env.faults import classes
from diagnosers import Belief, load, make
from diagnosers.diagnoser import with_impossible_unknown

from .runs import final_belief

CLASSES = classes()


def saying(part, belief):
    """The part, made to say a fixed belief."""
    part.step = lambda state, observation: (
        state,
        with_impossible_unknown(Belief(np.log(belief)[None], *np.zeros((2, 1, len(belief))))),
    )


def test_the_pool_by_hand():
    prior = np.array([0.5, *[0.5 / 18] * 18])
    drag, loss, damage = (
        CLASSES.index(name)
        for name in ("increased_drag", "propeller_loss:port", "propeller_damage:port")
    )
    shaft = prior.copy()
    hull = prior.copy()
    shaft[[loss, damage]] *= 3.0  # evidence for the port propeller
    hull[loss] *= 5.0  # evidence for a loss, half of which it gives to the port side
    parallel = make("parallel")
    saying(parallel.raw, shaft / shaft.sum())
    saying(parallel.kalman, hull / hull.sum())
    _, belief = parallel.step(None, np.zeros((1, 12)))
    ratio = np.exp(belief.log_probability[0, :-1] - belief.log_probability[0, 0]) / prior * prior[0]
    # 9 = 3 (5 + 1) / 2
    np.testing.assert_allclose(ratio[[0, drag, damage, loss]], [1.0, 1.0, 3.0, 9.0])


def test_labels_join_those_of_both():
    labels = make("parallel").labels
    assert labels["propeller_loss:port"] == "degraded propeller:port, severe propulsion failure"
    assert labels["decreased_drag"] == "decreased drag" and labels["normal"] == "normal"
    assert labels["seal_friction:port"] == "increased seal friction:port"
    assert labels["motor_overheating:port"] is None


@pytest.mark.parametrize(
    "fault",
    [
        "increased_drag",
        "decreased_drag",
        "propeller_loss:port",
        "propeller_loss:starboard",
        "seal_friction:port",
    ],
)
def test_names_what_takes_both_networks(fault):
    assert CLASSES[final_belief("parallel", fault).log_probability.argmax()] == fault


def test_a_healthy_vehicle_is_normal():
    assert final_belief("parallel", None).log_probability.argmax() == 0


def test_saves_the_weights_of_both(tmp_path):
    parallel = make("parallel")
    parallel.raw.network.hidden_bias.data += 1.0
    parallel.save(tmp_path / "weights.safetensors")
    loaded = load(tmp_path / "weights.safetensors").tensors()
    for name, tensor in parallel.tensors().items():
        np.testing.assert_array_equal(loaded[name], tensor)
