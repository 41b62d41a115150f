import numpy as np
import pytest

from auv_fault_env.errors import InputError
from diagnosers import make, storage
from diagnosers.kalman_network import ARCHITECTURE as KALMAN
from diagnosers.networks import feed_forward
from diagnosers.networks.feed_forward import FeedForward
from diagnosers.raw_network import ARCHITECTURE as RAW

NETWORKS = ("raw_network", "kalman_network", "parallel")


@pytest.mark.parametrize(
    ("architecture", "count"),
    [(RAW, 58), (KALMAN, 69)],  # 4-6-4: 6 (4 + 1) + 4 (6 + 1); 2-8-5: 8 (2 + 1) + 5 (8 + 1)
)
def test_no_larger_than_in_the_thesis(architecture, count):
    assert (
        sum(tensor.size for tensor in feed_forward.random_tensors(architecture, 0).values())
        == count
    )


def test_forward_by_hand():
    ones = {name: np.ones(shape) for name, shape in feed_forward.tensor_shapes(2, 3, 1).items()}
    expected = 1.0 + 3.0 / (1.0 + np.exp(-4.0))  # hidden sums 1 + 2 + 1
    np.testing.assert_allclose(
        FeedForward(ones).evaluate(np.array([[1.0, 2.0]])), [[expected]], rtol=1e-6
    )


def test_tensors_come_back_as_they_were_given_and_as_copies():
    tensors = feed_forward.random_tensors(RAW, 3)
    network = FeedForward(tensors)
    network.tensors()["hidden_bias"][:] = 9.0
    for name, tensor in network.tensors().items():
        np.testing.assert_array_equal(tensor, tensors[name])


def test_the_start_depends_on_the_seed_alone():
    one, same, other = (
        feed_forward.random_tensors(RAW, seed)["hidden_weight"] for seed in (1, 1, 2)
    )
    assert (one == same).all() and (one != other).all()


@pytest.mark.parametrize("name", NETWORKS)
def test_a_truncated_file_is_refused_in_one_line(name, tmp_path):
    path = tmp_path / "weights.safetensors"
    make(name).save(path)
    path.write_bytes(path.read_bytes()[:-8])
    with pytest.raises(InputError, match="weights file") as caught:
        make(name, weights=path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", NETWORKS)
def test_another_architecture_is_refused_in_one_line(name, tmp_path):
    path = tmp_path / "weights.safetensors"
    storage.write(path, feed_forward.random_tensors(feed_forward.tensor_shapes(4, 7, 4), 0), {})
    with pytest.raises(InputError, match="architecture") as caught:
        make(name, weights=path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", NETWORKS)
def test_a_missing_file_is_refused(name, tmp_path):
    with pytest.raises(InputError, match="check the path, or train first"):
        make(name, weights=tmp_path / "none.safetensors")
