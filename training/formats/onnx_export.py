"""The conversion of a trained network to ONNX, with PyTorch as the reference of its outputs."""

import hashlib
import json
import logging
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path

import numpy as np
import torch

import diagnosers
from auv_fault_env.errors import known_name
from auv_fault_env.parameters import SAMPLE_TIME
from diagnosers import storage
from training.extras import import_from_extra
from training.formats.onnx import GRAPHS, Graph, PolicyGraph
from training.stimuli.policy import LearnedPolicy

WEIGHTS = ".safetensors"


def graph_of(name: str) -> Graph:
    """The graph of a diagnoser or policy of the package, by name, or of a safetensors file."""
    policies = {path.stem: path for path in sorted(storage.WEIGHTS.glob(f"stimulus-*{WEIGHTS}"))}
    path = policies.get(name, Path(name))
    if path.suffix != WEIGHTS:
        graph = GRAPHS[known_name("network to export", name, [*GRAPHS, *policies])]
        return graph(diagnosers.make(name)).eval()
    card = storage.read(path)[1]
    if isinstance(card, dict) and "features" in card:
        return PolicyGraph(LearnedPolicy.load(path)).eval()
    diagnoser = diagnosers.load(path)
    graph = GRAPHS[known_name(f"diagnoser of {path}", diagnoser.name, GRAPHS)]
    return graph(diagnoser).eval()


def to_onnx(graph: Graph) -> bytes:
    """The ONNX model with its metadata, for any number of lanes."""
    onnx = import_from_extra("onnx", "formats", "`export`")
    import_from_extra("onnxscript", "formats", "`export`")
    widths = n_columns(graph)
    inputs = tuple(torch.zeros(2, width) for width in widths.values())
    # all inputs have the same number of lanes, which the first one names
    lanes = ["n_lanes"] + [torch.export.Dim.DYNAMIC] * (len(inputs) - 1)
    with quiet(), torch.no_grad():
        program = torch.onnx.export(
            graph,
            inputs,
            input_names=list(widths),
            output_names=list(graph.outputs),
            dynamic_shapes=tuple({0: dimension} for dimension in lanes),
            dynamo=True,
            verbose=False,
        )
    model = program.model_proto
    for element in (model.graph, *model.graph.node):
        del element.metadata_props[:]  # its place in the source
    onnx.helper.set_model_props(model, metadata(graph))
    onnx.checker.check_model(model)
    return model.SerializeToString()


@contextmanager
def quiet() -> Iterator[None]:
    """Suppress messages of PyTorch's exporter about torchvision and about its own deprecations."""
    log = logging.getLogger("torch.onnx._internal.exporter._registration")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", ".*LeafSpec.* is deprecated", FutureWarning)
            yield
    finally:
        log.setLevel(level)


def n_columns(graph: Graph) -> dict[str, int]:
    """Number of columns by input, the state included."""
    state = {"state": graph.n_state} if graph.n_state else {}
    return {name: len(columns) for name, columns in graph.inputs.items()} | state


def metadata(graph: Graph) -> dict[str, str]:
    """Metadata of the file; everything but `about` is JSON."""
    plain = {
        "version": version("auv-fault"),
        "weights": digest(graph.tensors),
        "sample_time": SAMPLE_TIME,
        "inputs": graph.inputs,
        **graph.notes,
    }
    return {"about": graph.about} | {name: json.dumps(value) for name, value in plain.items()}


def digest(tensors: Mapping[str, np.ndarray]) -> str:
    """SHA-256 of tensors by name, whatever the file format."""
    checksum = hashlib.sha256()
    for name, tensor in sorted(tensors.items()):
        checksum.update(f"{name} {tensor.shape} {tensor.dtype.str}".encode() + tensor.tobytes())
    return checksum.hexdigest()


def evaluate(graph: Graph, episode: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """PyTorch's outputs for the inputs of an episode, (n_samples, n_lanes, n_columns) each."""
    names = graph.outputs[:-1] if graph.n_state else graph.outputs
    samples: dict[str, list[np.ndarray]] = {name: [] for name in names}
    inputs = [torch.from_numpy(values) for values in episode.values()]
    state = [torch.zeros(inputs[0].shape[1], graph.n_state)] if graph.n_state else []
    for sample in zip(*inputs, strict=True):
        with torch.inference_mode():
            outputs = graph(*sample, *state)
        outputs = [outputs] if isinstance(outputs, torch.Tensor) else list(outputs)
        state = [outputs.pop()] if graph.n_state else []
        for name, values in zip(samples, outputs, strict=True):
            samples[name].append(values.numpy())
    return {name: np.stack(values) for name, values in samples.items()}
