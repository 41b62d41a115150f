"""ONNX networks from outside as diagnosers."""

import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS
from auv_fault_env.errors import InputError
from auv_fault_env.faults import classes
from diagnosers.checks import check_beliefs

pytest.importorskip("onnxruntime")
networks = pytest.importorskip("tests.training.submissions.networks")
from training.submissions.onnx_network import OnnxNetwork  # noqa: E402


@pytest.fixture
def written(tmp_path):
    def write(content):
        path = tmp_path / "mine.onnx"
        path.write_bytes(content)
        return path

    return write


def test_a_network_with_a_memory_is_a_diagnoser(written):
    network = OnnxNetwork(written(networks.counting_network()))
    check_beliefs(network)
    network.reset(2)
    beliefs = [network.update(np.zeros((2, len(CHANNELS)))) for _ in range(50)]
    n_others = len(classes()) - 1
    for k in (0, 49):
        score = 3.0 + 0.01 * (k + 1)
        expected = score - np.log(np.exp(score) + n_others)
        np.testing.assert_allclose(beliefs[k].log_probability[:, 0], expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (lambda: b"no network", "an ONNX network"),
        (lambda: networks.counting_network()[:-300], "an ONNX network"),
        (lambda: networks.counting_network(without=("severity_std",)), "outputs of mine.onnx"),
        (lambda: networks.counting_network(names="normal"), "a JSON list of names"),
    ],
    ids=["text", "cut off", "output missing", "classes"],
)
def test_another_file_is_refused_in_one_line(written, content, words):
    with pytest.raises(InputError, match=words) as refused:
        check_beliefs(OnnxNetwork(written(content())))
    assert "\n" not in str(refused.value)
