"""``auv-fault export``: a trained network as ONNX file, and an episode with PyTorch's outputs.

The file runs in any ONNX Runtime, without Python packages of this project; its metadata describe
its columns, its inputs and its origin. ``docs/examples/onnx_runner.py`` runs it on the episode.
"""

import io
from pathlib import Path

import numpy as np

from auv_fault_env.errors import refusal
from training.arguments import Export
from training.formats.onnx_export import (
    WEIGHTS,
    evaluate,
    graph_of,
    n_columns,
    to_onnx,
)
from training.report.whole_file import write_whole


def main(arguments: Export) -> None:
    """Write the ONNX file, and the episode as .npz of the same name."""
    name = Path(arguments.name).name.removesuffix(WEIGHTS)
    output = arguments.output or Path("runs") / f"{name}.onnx"
    graph = graph_of(arguments.name)
    if output.suffix != ".onnx":
        raise refusal("output", str(output), "a file that ends in .onnx", "add the ending")
    model = to_onnx(graph)
    episode = graph.episode(arguments.seed)
    archive = io.BytesIO()
    np.savez_compressed(archive, **episode, **evaluate(graph, episode))
    write_whole(output, model)
    write_whole(output.with_suffix(".npz"), archive.getvalue())
    inputs = ", ".join(n_columns(graph))
    outputs = ", ".join(graph.outputs)
    print(f"{output}: {len(model) / 1e3:.0f} kB, {inputs} in, {outputs} out")
    print(f"try it: python docs/examples/onnx_runner.py {output}")
