"""What an agent has learnt about when to excite: a small network, run by PyTorch alone."""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import torch

from auv_fault_env.channels import MAXIMUM_COMMAND
from auv_fault_env.errors import finite_in_range, refusal
from diagnosers import storage
from training.stimuli.policy_inputs import FEATURES

LAYERS = ("first", "second", "action")
HIDDEN = 64
WIDTHS = (len(FEATURES), HIDDEN, HIDDEN, 1)
SHAPES: storage.Shapes = {
    f"{layer}_{part}": shape
    for layer, (inputs, outputs) in zip(LAYERS, pairwise(WIDTHS), strict=True)
    for part, shape in (("weight", (outputs, inputs)), ("bias", (outputs,)))
}


@dataclass(frozen=True)
class LearnedPolicy:
    """From the features of `auv_fault_env/ActiveDiagnosis-v0` to its action: two hidden layers, all tanh, no noise.

    It has learnt beside one diagnoser and within one budget. Beside another diagnoser, whose
    beliefs move otherwise, it may excite for nothing; and the budget is kept on the average of the
    episodes it was trained on, not in every one.

    Attributes
    ----------
    tensors
        Weights and biases, float32, of the shapes in `SHAPES`.
    diagnoser
        Name of the diagnoser whose beliefs it has seen.
    budget
        Root mean square of the speed offsets within which it was trained [m/s].
    amplitude
        Speed offset [m/s] of the action 1.
    """

    tensors: dict[str, np.ndarray]
    diagnoser: str
    budget: float
    amplitude: float

    def __post_init__(self):
        storage.check_tensors("the policy", self.tensors, SHAPES)

    def action(self, features: np.ndarray) -> np.ndarray:
        """The actions (n_lanes, 1) float32, within -1 to 1, for features (n_lanes, n_features) as in `FEATURES`."""
        features = np.asarray(features, np.float32)
        if features.ndim != 2 or features.shape[1] != len(FEATURES):
            raise refusal(
                "shape of the features",
                features.shape,
                f"(n_lanes, {len(FEATURES)})",
                "one row per lane",
            )
        with torch.inference_mode():
            values = torch.from_numpy(features)
            for layer in LAYERS:
                weight, bias = (
                    torch.from_numpy(self.tensors[f"{layer}_{part}"]) for part in ("weight", "bias")
                )
                # the same for a lane, however many there are
                summed = (values[:, None, :] * weight).sum(dim=2)
                values = torch.tanh(summed + bias)
            return values.numpy()

    def save(self, path: str | Path) -> None:
        """Write a safetensors file for `load`; its header names the features in their order."""
        settings = {"diagnoser": self.diagnoser, "budget": self.budget, "amplitude": self.amplitude}
        storage.write(path, self.tensors, {"features": FEATURES, **settings})

    @classmethod
    def load(cls, path: str | Path) -> "LearnedPolicy":
        """The policy that `save` wrote; a damaged file, or one with other features, is refused in one line."""
        tensors, header = storage.read(path)
        header = header if isinstance(header, dict) else {}
        layout = header.get("features")
        if layout != list(FEATURES):
            allowed = (
                f"the {len(FEATURES)} of training.stimuli.policy_inputs.FEATURES in their order"
            )
            raise refusal(
                f"features of the policy {path}", _unlike(layout), allowed, "train it anew"
            )
        diagnoser = header.get("diagnoser")
        if not isinstance(diagnoser, str):
            raise refusal(f"diagnoser of the policy {path}", diagnoser, "a name", "train it anew")
        numbers = (
            finite_in_range(
                f"{name} of the policy {path}", header.get(name), 0.001, MAXIMUM_COMMAND
            )
            for name in ("budget", "amplitude")
        )
        return cls(storage.check_tensors(path, tensors, SHAPES), diagnoser, *numbers)


def _unlike(layout: Any) -> Any:
    """What of a layout of features is not as it should be: the first place, short enough for one line."""
    if not isinstance(layout, list):
        return layout
    place = next(
        (k for k, pair in enumerate(zip(layout, FEATURES, strict=False)) if pair[0] != pair[1]),
        None,
    )
    return f"{len(layout)} features" + (
        "" if place is None else f", number {place + 1} {layout[place]!r}"
    )
