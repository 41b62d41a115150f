"""An ONNX network from outside as a diagnoser.

The file has the inputs and outputs of an exported `raw_network`: `observation` (n_lanes,
n_channels) goes in, `log_probability`, `severity_mean` and `severity_std` (n_lanes, n_classes) come
out, float32. A memory is one more input, `state` (n_lanes, n_numbers), zeros at the start of an
episode, and one more output, `next_state`. The metadata `classes` is the JSON list of the classes.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from auv_fault_env.errors import refusal
from diagnosers import Belief, Recursive
from training.extras import import_from_extra

OBSERVATION = "observation"
STATE = "state"
NEXT_STATE = "next_state"
ALLOWED = "an ONNX network as docs/leaderboard.md has it"


@dataclass(frozen=True)
class OnnxNetwork(Recursive):
    """The network in a file, which is read whole: it may name no other file."""

    path: Path
    name = "onnx_network"

    def __post_init__(self):
        inputs = {entry.name for entry in self.session.get_inputs()}
        outputs = {entry.name for entry in self.session.get_outputs()}
        if inputs not in ({OBSERVATION}, {OBSERVATION, STATE}):
            self._refuse("inputs", sorted(inputs), f"{OBSERVATION}, or that and {STATE}")
        wanted = {*Belief._fields} | ({NEXT_STATE} if STATE in inputs else set())
        if outputs != wanted:
            self._refuse("outputs", sorted(outputs), ", ".join(sorted(wanted)))

    @cached_property
    def session(self) -> Any:
        """The network in ONNX Runtime, on one thread."""
        runtime = import_from_extra("onnxruntime", "formats", "an ONNX network")
        options = runtime.SessionOptions()
        options.intra_op_num_threads = 1
        options.inter_op_num_threads = 1
        options.log_severity_level = 4
        try:
            return runtime.InferenceSession(
                self.path.read_bytes(), options, providers=["CPUExecutionProvider"]
            )
        except Exception as error:  # of ONNX Runtime, which has no common base
            remedy = "export it again"
            raise refusal(f"network {self.path.name}", str(error), ALLOWED, remedy) from None

    @cached_property
    def classes(self) -> tuple[str, ...]:
        """The classes of its beliefs, from the metadata."""
        written = self.session.get_modelmeta().custom_metadata_map.get("classes")
        try:
            names = json.loads(written)
        except (TypeError, ValueError, RecursionError):
            names = None
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            self._refuse("classes in the metadata", written, "a JSON list of names")
        return tuple(names)

    @cached_property
    def n_numbers(self) -> int:
        """Columns of the state, 0 without one."""
        entries = {entry.name: entry.shape for entry in self.session.get_inputs()}
        if STATE not in entries:
            return 0
        shape = entries[STATE]
        if len(shape) != 2 or not isinstance(shape[1], int) or shape[1] < 1:
            self._refuse("shape of the state", shape, "(n_lanes, n_numbers), the latter a number")
        return shape[1]

    def initial(self, n_lanes: int) -> np.ndarray:
        """Zeros, (n_lanes, n_numbers)."""
        return np.zeros((n_lanes, self.n_numbers), np.float32)

    def step(self, state: np.ndarray, observation: np.ndarray) -> tuple[np.ndarray, Belief]:
        """The next state and the belief, its probabilities normalised from float32."""
        fed = {OBSERVATION: observation.astype(np.float32)}
        if self.n_numbers:
            fed[STATE] = state
        outputs = [entry.name for entry in self.session.get_outputs()]
        answers: Mapping[str, np.ndarray] = dict(
            zip(outputs, self.session.run(outputs, fed), strict=True)
        )
        log_probability, mean, std = (answers[name].astype(np.float64) for name in Belief._fields)
        log_probability -= np.logaddexp.reduce(log_probability, axis=1, keepdims=True)
        return answers.get(NEXT_STATE, state), Belief(log_probability, mean, std)

    def _refuse(self, thing: str, got: Any, allowed: str) -> None:
        raise refusal(f"{thing} of {self.path.name}", got, allowed, "export it so")
