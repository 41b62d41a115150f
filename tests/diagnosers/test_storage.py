"""Weights files: written whole or not at all; a file from outside is refused in one line, whatever
is wrong with it.
"""

import json

import numpy as np
import pytest
from safetensors.numpy import save_file

import diagnosers
from auv_fault_env.errors import InputError
from diagnosers import storage

TENSORS = {
    "weight": np.arange(6.0, dtype=np.float32).reshape(2, 3),
    "bias": np.zeros(3, np.float32),
}
HEADER = {"diagnoser": "random", "settings": {"seed": 4}}
SHAPES = {"weight": (2, 3), "bias": (3,)}


@pytest.fixture
def path(tmp_path):
    storage.write(tmp_path / "made" / "weights.safetensors", TENSORS, HEADER)
    return tmp_path / "made" / "weights.safetensors"


def refused(action, *args):
    with pytest.raises(InputError) as caught:
        action(*args)
    text = str(caught.value)
    assert "\n" not in text and "got" in text and "allowed is" in text
    return text


def test_what_is_written_is_read(path):
    tensors, header = storage.read(path)
    assert header == HEADER
    assert all((tensors[name] == TENSORS[name]).all() for name in TENSORS)
    assert storage.check_tensors(path, tensors, SHAPES).keys() == TENSORS.keys()
    assert [file.name for file in path.parent.iterdir()] == [path.name]


@pytest.mark.parametrize("keep", [0, 4, 40, -1])
def test_a_truncated_file_is_refused(path, keep):
    path.write_bytes(path.read_bytes()[:keep])
    assert "complete safetensors file" in refused(storage.read, path)


@pytest.mark.parametrize(
    "content", [b"\x80\x04pickle", b"{}", b"\xff" * 64], ids=["pickle", "json", "noise"]
)
def test_a_file_that_is_no_safetensors_is_refused(path, content):
    path.write_bytes(content)
    assert str(path) in refused(storage.read, path)


@pytest.mark.parametrize(
    "metadata", [None, {"other": "1"}, {storage.HEADER: "{"}], ids=["none", "other", "broken"]
)
def test_a_missing_or_broken_header_is_refused(path, metadata):
    save_file(TENSORS, path, metadata=metadata)
    refused(storage.read, path)


@pytest.mark.parametrize(
    "header", [[], {}, {"settings": {}}, {"diagnoser": "nobody", "settings": {}}]
)
def test_load_refuses_a_header_that_names_no_diagnoser(path, header):
    save_file({}, path, metadata={storage.HEADER: json.dumps(header)})
    refused(diagnosers.load, path)


def test_load_refuses_a_vehicle_with_other_parameters(path):
    settings = {"vehicle": {"mass": 1.0}}
    save_file(
        {},
        path,
        metadata={storage.HEADER: json.dumps({"diagnoser": "limits", "settings": settings})},
    )
    assert "mass" in refused(diagnosers.load, path)


def test_a_missing_file_is_refused(tmp_path):
    assert "existing" in refused(storage.read, tmp_path / "nothing.safetensors")


@pytest.mark.parametrize(
    "tensors",
    [
        {"weight": TENSORS["weight"]},
        TENSORS | {"more": np.zeros(1)},
        TENSORS | {"bias": np.zeros(4)},
        TENSORS | {"bias": np.array([0.0, np.nan, 0.0])},
    ],
    ids=["missing", "too many", "shape", "NaN"],
)
def test_tensors_of_another_architecture_are_refused(path, tensors):
    refused(storage.check_tensors, path, tensors, SHAPES)


def test_a_failed_write_leaves_the_old_file_and_nothing_else(path, monkeypatch):
    def fail(*args, **kwargs):
        raise OSError(28, "No space left on device")

    before = path.read_bytes()
    monkeypatch.setattr(storage, "save_file", fail)
    assert "No space left" in refused(storage.write, path, {}, {})
    assert path.read_bytes() == before
    assert [file.name for file in path.parent.iterdir()] == [path.name]


def test_a_place_that_cannot_be_written_is_refused(path):
    assert "choose another path" in refused(
        storage.write, path / "below" / "weights.safetensors", TENSORS, HEADER
    )
