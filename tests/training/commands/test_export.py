"""ONNX files: their answers are those of PyTorch and of the package, and they say what they are."""

import json
import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS
from auv_fault_env.fleet import Fleet
from auv_fault_env.parameters import PRESETS
from auv_fault_env.schedules import FaultEvent
from diagnosers import make
from training import cli
from training.formats.onnx import GRAPHS, PolicyGraph
from training.formats.onnx_export import (
    digest,
    evaluate,
    graph_of,
    metadata,
    n_columns,
    to_onnx,
)
from training.rollouts import manoeuvres, roll_out
from training.stimuli import policy_inputs
from training.stimuli.policy import REACH, LearnedPolicy, policy_shapes

onnxruntime = pytest.importorskip("onnxruntime")
RUNNER = Path(__file__).parents[3] / "docs" / "examples" / "onnx_runner.py"
run = runpy.run_path(str(RUNNER))["run"]
FAULTS = (
    "motor_overheating:port",
    "increased_drag",
    "propeller_loss:starboard",
    "seal_friction:port",
)


def policy():
    random = np.random.default_rng(0)
    tensors = {
        name: random.normal(0.0, 0.3, shape).astype(np.float32)
        for name, shape in policy_shapes(31).items()
    }
    return LearnedPolicy(tensors, "cusum")


@pytest.fixture(scope="module", params=[*GRAPHS, "policy"])
def graph(request):
    return PolicyGraph(policy()).eval() if request.param == "policy" else graph_of(request.param)


@pytest.fixture(scope="module")
def model(graph):
    return to_onnx(graph)


@pytest.fixture(scope="module")
def session(model):
    return onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])


@pytest.fixture(scope="module")
def rollout():
    schedules = [(FaultEvent(fault, 10.0, 0.8),) for fault in FAULTS]
    return roll_out(Fleet(4), range(4), 300, manoeuvres(7, 300, 4), schedules)


def assert_alike(got, expected):
    """Within 1e-5, relative where a value is larger than 1: logarithms of probabilities reach -100
    and beyond.
    """
    assert set(got) == set(expected)
    for name, values in expected.items():
        assert np.isfinite(values).all() and np.ptp(values) > 0.0
        error = np.abs(got[name] - values) / np.maximum(1.0, np.abs(values))
        assert error.max() < 1e-5, f"{name}: {error.max()}"


@pytest.mark.parametrize("n_lanes", [1, 5])
def test_answers_to_random_inputs_are_those_of_torch(graph, session, n_lanes):
    random = np.random.default_rng(n_lanes)
    inputs = {
        name: random.normal(0.5, 1.0, (30, n_lanes, len(columns))).astype(np.float32)
        for name, columns in graph.inputs.items()
    }
    assert_alike(run(session, inputs), evaluate(graph, inputs))


def test_answers_along_an_episode_are_those_of_torch(graph, session):
    episode = graph.episode(3)
    assert all(np.ptp(values) > 0.1 for values in episode.values())
    assert_alike(run(session, episode), evaluate(graph, episode))


def test_the_example_is_an_episode_of_the_seed(graph):
    for name, values in graph.episode(3).items():
        np.testing.assert_array_equal(values, graph.episode(3)[name])
        assert (values != graph.episode(4)[name]).any()


@pytest.mark.parametrize("name", GRAPHS)
def test_the_graph_believes_what_the_diagnoser_believes(name, rollout):
    graph = graph_of(name)
    diagnoser = make(name)
    outputs = evaluate(graph, graph.feed(rollout.observations))
    diagnoser.reset(4)
    beliefs = [diagnoser.update(observation) for observation in rollout.observations]
    for part, values in outputs.items():
        n_classes = values.shape[-1]  # a graph of `integrated` has the classes of its training
        expected = np.stack([getattr(belief, part)[:, :n_classes] for belief in beliefs])
        if part == "log_probability":
            assert len(set(expected[-1].argmax(axis=1))) > 1  # they do not all say the same
            values = np.exp(values)
            expected = np.exp(expected)
            expected /= expected.sum(axis=-1, keepdims=True)
        np.testing.assert_allclose(values, expected, rtol=0, atol=2e-4, err_msg=part)


def test_the_policy_of_the_graph_is_the_policy():
    graph = PolicyGraph(policy())
    low, high = np.transpose(list(policy_inputs.BOUNDS.values()))
    features = np.random.default_rng(1).uniform(low, high, (20, 3, low.size)).astype(np.float32)
    expected = np.stack([policy().action(sample) for sample in features])
    np.testing.assert_allclose(
        evaluate(graph, {"features": features})["action"], expected, atol=3e-6
    )


def test_the_file_says_what_it_is(graph, model, session):
    about = session.get_modelmeta().custom_metadata_map
    assert about == metadata(graph)
    assert (
        json.loads(about["weights"]) == digest(graph.tensors)
        and len(json.loads(about["weights"])) == 64
    )
    assert json.loads(about["sample_time"]) == 0.1
    named = {name: len(columns) for name, columns in json.loads(about["inputs"]).items()}
    assert {name: width for name, width in n_columns(graph).items() if name != "state"} == named
    assert {entry.name: entry.shape for entry in session.get_inputs()} == {
        name: ["n_lanes", width] for name, width in n_columns(graph).items()
    }
    for trace in (b"site-packages", b".py", b"ExportedProgram"):
        assert trace not in model


def test_files_of_diagnosers_name_classes_and_columns():
    about = metadata(graph_of("raw_network"))
    assert json.loads(about["diagnoser"]) == "raw_network"
    assert json.loads(about["classes"]) == list(make("raw_network").classes)
    assert json.loads(about["inputs"]) == {"observation": list(CHANNELS)}


def test_the_digest_tells_weights_apart():
    tensors = policy().tensors
    assert digest(tensors) == digest(dict(reversed(tensors.items())))
    assert digest(tensors) != digest(tensors | {"first_bias": tensors["first_bias"] + 1e-6})


def test_command_writes_two_files_that_need_nothing_but_onnx_runtime_and_numpy(tmp_path, capsys):
    assert cli.main(["export", "integrated", "--output", str(tmp_path / "new" / "it.onnx")]) == 0
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == ["it.npz", "it.onnx"]
    assert "features, state in, log_probability, " in capsys.readouterr().out
    code = (
        "import runpy, sys\n"
        "for name in ('torch', 'numba', 'scipy', 'auv_fault_env', 'diagnosers', 'training'):\n"
        "    sys.modules[name] = None\n"
        f"sys.argv = ['onnx_runner.py', {str(tmp_path / 'new' / 'it.onnx')!r}]\n"
        f"runpy.run_path({str(RUNNER)!r}, run_name='__main__')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert (
        len(lines) == 61
        and lines[0].startswith("   0 s  normal")
        and "motor_overheating:port" in lines[59]
    )
    assert float(lines[60].removeprefix("largest difference from PyTorch: ")) < 1e-5


def test_weights_of_ones_own_are_exported_from_their_file(tmp_path):
    make("kalman_network", vehicle="npsnet1995").save(tmp_path / "mine.safetensors")
    mine = graph_of(str(tmp_path / "mine.safetensors"))
    assert digest(mine.tensors) == digest(graph_of("kalman_network").tensors)
    assert json.loads(metadata(mine)["vehicle"])["alpha"] == PRESETS["npsnet1995"].alpha
    policy().save(tmp_path / "policy.safetensors")
    saved = graph_of(str(tmp_path / "policy.safetensors"))
    assert digest(saved.tensors) == digest(policy().tensors)
    assert json.loads(metadata(saved)["reach"]) == REACH


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["integrate"], ["network to export", "'integrate'", "did you mean 'integrated'"]),
        (["cusum"], ["network to export", "'cusum'", "raw_network"]),
        (["nowhere.safetensors"], ["weights file", "nowhere.safetensors"]),
        (["raw_network", "--output", "raw.pt"], ["output", "raw.pt", ".onnx"]),
        (["raw_network", "--output", "/proc/raw.onnx"], ["output", "/proc/raw.onnx", "--output"]),
        (["raw_network", "--seed", "-1"], ["seed", "-1"]),
    ],
    ids=lambda value: " ".join(value) if value and len(value) < 4 and " " not in value[0] else "",
)
def test_bad_input_ends_with_two_and_one_line(arguments, words, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["export", *arguments]) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    for word in words:
        assert word in message
    assert not list(tmp_path.iterdir())


def test_a_missing_package_is_named_with_its_extra(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnx", None)
    assert cli.main(["export", "raw_network", "--output", str(tmp_path / "raw.onnx")]) == 2
    assert "pip install 'auv-fault[formats]'" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
