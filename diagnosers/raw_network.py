"""The thesis' network on raw data (V.C, Table 5.1): 4-6-4, once per shaft, without memory.

Its inputs are voltage, current and rpm of one shaft and the speed; its outputs the modes of Table
5.1. Under each hypothesis on the vehicle (nothing wrong, drag, friction or propeller of one side)
every shaft is in one mode, and the hypothesis' score is the sum of these two outputs; the softmax
of the scores is the belief, through which `training.learning.raw_network` trains.
"""

from typing import Any

import numpy as np

from auv_fault_env.channels import INDEX
from auv_fault_env.faults import classes
from auv_fault_env.faults import labels as tables
from auv_fault_env.parameters import SIDES
from diagnosers.diagnoser import Belief, Memoryless, same_severity, with_impossible_unknown
from diagnosers.networks import modes
from diagnosers.networks.fault_map import MODES_5_1
from diagnosers.networks.feed_forward import FeedForward, tensor_shapes
from diagnosers.storage import WEIGHTS, Weights, load_tensors

PACKAGED = WEIGHTS / "raw_network.safetensors"
ARCHITECTURE = tensor_shapes(4, 6, 4)
SCALE = (
    2.0,
    0.5,
    300.0,
    0.3,
)  # V, A, rpm, m/s: about those of 0.3 m/s, the middle of the missions
READINGS = ("voltage", "current", "rpm")
COLUMNS = tuple([INDEX[f"{side}_{name}"] for name in READINGS] for side in SIDES)
SPEED = INDEX["speed"]

NORMAL, FRICTION, DRAG, PROPELLER = range(4)
HYPOTHESES = {  # modes of (port, starboard)
    MODES_5_1[NORMAL]: (NORMAL, NORMAL),
    MODES_5_1[DRAG]: (DRAG, DRAG),
    f"{MODES_5_1[FRICTION]}:port": (FRICTION, NORMAL),
    f"{MODES_5_1[PROPELLER]}:port": (PROPELLER, NORMAL),
    f"{MODES_5_1[FRICTION]}:starboard": (NORMAL, FRICTION),
    f"{MODES_5_1[PROPELLER]}:starboard": (NORMAL, PROPELLER),
}
PORT, STARBOARD = map(list, zip(*HYPOTHESES.values(), strict=True))


def labels() -> dict[str, str | None]:
    """The hypothesis of every class, its mode in Table 5.1 with the side; None without one."""
    label_of = {}
    for name, (mode, _) in tables().items():
        side = name.partition(":")[2]
        label = f"{mode}:{side}" if side in SIDES else mode
        label_of[name] = label if label in HYPOTHESES else None
    return label_of


def inputs(observation: np.ndarray) -> np.ndarray:
    """The inputs (2 n, 4) of both networks, port first, from observations (n, n_channels)."""
    port, starboard = (observation[:, [*columns, SPEED]] for columns in COLUMNS)
    return np.concatenate([port, starboard]) / SCALE


def scores(outputs: Any) -> Any:
    """Scores (n, 6) of the hypotheses from both networks' outputs (2 n, 4), arrays or tensors."""
    half = len(outputs) // 2
    return outputs[:half][:, PORT] + outputs[half:][:, STARBOARD]


class RawNetwork(Memoryless):
    """4-6-4 on the readings of one shaft, once per shaft, without memory.

    Severity is that of the prior throughout. For classes without a mode in Table 5.1 see
    `networks.modes.class_shares`. Misleads in transients, which look like drag to a network without
    memory, so that it hardly ever names drag; and under faults of the sensors it reads.
    """

    name = "raw_network"

    def __init__(self, weights: Weights = PACKAGED):
        self.network = FeedForward(load_tensors(weights, ARCHITECTURE))
        self.classes = classes()
        self.labels = labels()
        self.shares = modes.class_shares(self.labels, tuple(HYPOTHESES))

    def step(self, state: tuple[()], observation: np.ndarray) -> tuple[tuple[()], Belief]:
        """The belief from this observation (n_lanes, n_channels) alone."""
        outputs = self.network.evaluate(inputs(observation))
        log_modes = modes.log_softmax(scores(outputs))
        log_probability = modes.class_log_probability(log_modes, self.shares)
        severity = same_severity(log_probability.shape, *modes.PRIOR_SEVERITY)
        return state, with_impossible_unknown(Belief(log_probability, *severity))

    def tensors(self) -> dict[str, np.ndarray]:
        """Weights and biases by name."""
        return self.network.tensors()
