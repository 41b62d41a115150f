"""Run an exported network on a saved episode, with numpy and ONNX Runtime alone.

    auv-fault export integrated --output integrated.onnx
    python onnx_runner.py integrated.onnx               # on integrated.npz, which lies beside it
    python onnx_runner.py integrated.onnx episode.npz

The episode holds the network's inputs, (n_samples, n_lanes, n_columns) each, and, if it comes from
the export, the answers that PyTorch gave; the largest difference from these is printed, relative
where a value is larger than 1.
"""

import json
import sys
from pathlib import Path

import numpy as np
import onnxruntime


def run(
    session: onnxruntime.InferenceSession, episode: dict[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """The outputs of the network, sample by sample; its state starts at zeros."""
    inputs = session.get_inputs()
    outputs = [output.name for output in session.get_outputs()]
    fed = {entry.name: episode[entry.name] for entry in inputs if entry.name != "state"}
    n_samples, n_lanes, _ = next(iter(fed.values())).shape
    state = {
        entry.name: np.zeros((n_lanes, entry.shape[1]), np.float32)
        for entry in inputs
        if entry.name == "state"
    }
    answers: dict[str, list[np.ndarray]] = {name: [] for name in outputs if name != "next_state"}
    for k in range(n_samples):
        sample = {name: values[k] for name, values in fed.items()}
        told = dict(zip(outputs, session.run(outputs, sample | state), strict=True))
        state = {"state": told.pop("next_state")} if state else {}
        for name, values in told.items():
            answers[name].append(values)
    return {name: np.stack(values) for name, values in answers.items()}


def show(answers: dict[str, np.ndarray], about: dict[str, str]) -> None:
    """Print the outputs of the first lane: a diagnosis per second, or every action."""
    if "action" in answers:
        print(" ".join(f"{action:+.2f}" for action in answers["action"][:, 0, 0]))
        return
    classes = json.loads(about["classes"])
    samples_per_second = round(1 / json.loads(about["sample_time"]))
    for k in range(0, len(answers["log_probability"]), samples_per_second):
        log_probability, mean, std = (answers[name][k, 0] for name in answers)
        best = log_probability.argmax()
        told = f"{classes[best]:28} p = {np.exp(log_probability[best]):.3f}"
        print(
            f"{k / samples_per_second:4.0f} s  {told}  severity {mean[best]:.2f} +- {std[best]:.2f}"
        )


def main(model: str, episode: str | None = None) -> None:
    """Run, print, and compare with the answers that the episode holds."""
    session = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])
    with np.load(episode or Path(model).with_suffix(".npz")) as file:
        saved = dict(file)
    answers = run(session, saved)
    show(answers, session.get_modelmeta().custom_metadata_map)
    expected = {name: saved[name] for name in answers if name in saved}
    differences = [
        np.abs(answers[name] - values) / np.maximum(1.0, np.abs(values))
        for name, values in expected.items()
    ]
    if differences:
        print(f"largest difference from PyTorch: {max(map(np.max, differences)):.1e}")


if __name__ == "__main__":
    main(*sys.argv[1:])
