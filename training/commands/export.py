"""``auv-fault export``: a trained network as an ONNX file, and beside it an episode with PyTorch's answers.

The file runs wherever ONNX Runtime does, without Python packages of this project; its metadata say
what its columns are, what to feed it with and what it was made from.
``docs/examples/onnx_runner.py`` runs it on the episode.
"""

import hashlib
import io
import json
import logging
import os
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path

import numpy as np
import torch

import diagnosers
from auv_fault_env.errors import finite_in_range, known_name, refusal
from auv_fault_env.parameters import SAMPLE_TIME
from diagnosers import storage
from training.arguments import Export
from training.extras import import_from_extra
from training.formats.onnx import GRAPHS, Graph, PolicyGraph
from training.stimuli.policy import LearnedPolicy

WEIGHTS = ".safetensors"


def main(arguments: Export) -> None:
    """Write the ONNX file, and the episode as .npz of the same name."""
    seed = int(finite_in_range("seed", arguments.seed, 0, 2**62))
    output = (
        arguments.output or Path("runs") / f"{Path(arguments.name).name.removesuffix(WEIGHTS)}.onnx"
    )
    if output.suffix != ".onnx":
        raise refusal("output", str(output), "a file that ends in .onnx", "add the ending")
    graph = graph_of(arguments.name)
    model = to_onnx(graph)
    episode = graph.episode(seed)
    packed = io.BytesIO()
    np.savez_compressed(packed, **episode, **answers(graph, episode))
    _write({output: model, output.with_suffix(".npz"): packed.getvalue()})
    print(
        f"{output}: {len(model) / 1e3:.0f} kB, {', '.join(widths(graph))} in, {', '.join(graph.outputs)} out"
    )
    print(f"try it: python docs/examples/onnx_runner.py {output}")


def graph_of(name: str) -> Graph:
    """What to export of a diagnoser or policy of the package, by name, or of a safetensors file."""
    policies = {path.stem: path for path in sorted(storage.WEIGHTS.glob(f"stimulus-*{WEIGHTS}"))}
    path = policies.get(name, Path(name))
    if path.suffix != WEIGHTS:
        return GRAPHS[known_name("network to export", name, [*GRAPHS, *policies])](
            diagnosers.make(name)
        ).eval()
    header = storage.read(path)[1]
    if isinstance(header, dict) and "features" in header:
        return PolicyGraph(LearnedPolicy.load(path)).eval()
    diagnoser = diagnosers.load(path)
    return GRAPHS[known_name(f"diagnoser of {path}", diagnoser.name, GRAPHS)](diagnoser).eval()


def to_onnx(graph: Graph) -> bytes:
    """The ONNX model with its metadata; any number of lanes."""
    onnx = import_from_extra("onnx", "formats")
    import_from_extra("onnxscript", "formats")
    given = tuple(torch.zeros(2, width) for width in widths(graph).values())
    # they are equal, and the first names them
    lanes = ["n_lanes"] + [torch.export.Dim.DYNAMIC] * (len(given) - 1)
    with quiet(), torch.no_grad():
        program = torch.onnx.export(
            graph,
            given,
            input_names=list(widths(graph)),
            output_names=list(graph.outputs),
            dynamic_shapes=tuple({0: dimension} for dimension in lanes),
            dynamo=True,
            verbose=False,
        )
    model = program.model_proto
    for part in (model.graph, *model.graph.node):  # where in the source each came from
        del part.metadata_props[:]
    onnx.helper.set_model_props(model, metadata(graph))
    onnx.checker.check_model(model)
    return model.SerializeToString()


@contextmanager
def quiet() -> Iterator[None]:
    """Keep back what PyTorch's exporter says of itself: it misses torchvision, and uses what it has deprecated."""
    log = logging.getLogger("torch.onnx._internal.exporter._registration")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", ".*LeafSpec.* is deprecated", FutureWarning)
            yield
    finally:
        log.setLevel(level)


def widths(graph: Graph) -> dict[str, int]:
    """Number of columns by input, the state's included."""
    state = {"state": graph.n_state} if graph.n_state else {}
    return {name: len(columns) for name, columns in graph.inputs.items()} | state


def metadata(graph: Graph) -> dict[str, str]:
    """What the file says of itself; everything but `about` is JSON."""
    plain = {
        "version": version("auv-fault"),
        "weights": digest(graph.tensors),
        "sample_time": SAMPLE_TIME,
        "inputs": graph.inputs,
        **graph.notes,
    }
    return {"about": graph.about} | {name: json.dumps(value) for name, value in plain.items()}


def digest(tensors: Mapping[str, np.ndarray]) -> str:
    """SHA-256 of tensors, by name: equal for equal weights, however they are stored."""
    found = hashlib.sha256()
    for name, tensor in sorted(tensors.items()):
        found.update(f"{name} {tensor.shape} {tensor.dtype.str}".encode() + tensor.tobytes())
    return found.hexdigest()


def answers(graph: Graph, episode: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """What PyTorch makes of an episode's inputs, sample by sample: outputs (n_samples, n_lanes, n_columns)."""
    told: list[list[np.ndarray]] = []
    inputs = [torch.from_numpy(values) for values in episode.values()]
    state = [torch.zeros(inputs[0].shape[1], graph.n_state)] if graph.n_state else []
    for sample in zip(*inputs, strict=True):
        with torch.inference_mode():
            outputs = graph(*sample, *state)
        outputs = [outputs] if isinstance(outputs, torch.Tensor) else list(outputs)
        state = [outputs.pop()] if graph.n_state else []
        told.append([values.numpy() for values in outputs])
    return {
        name: np.stack(values)
        for name, values in zip(graph.outputs, zip(*told, strict=True), strict=False)
    }


def _write(contents: Mapping[Path, bytes]) -> None:
    """Write files, aside first: each is whole, the old or the new one."""
    for path, content in contents.items():
        aside = path.with_name(f".{path.name}-{os.getpid()}")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            try:
                aside.write_bytes(content)
                os.replace(aside, path)
            finally:
                aside.unlink(missing_ok=True)
        except OSError as error:
            allowed = f"a place that can be written ({error.strerror or error})"
            raise refusal("output", str(path), allowed, "choose another --output") from None
