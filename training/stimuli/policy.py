"""The learned policy: a small network from the features of `policy_inputs` to an action."""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from auv_fault_env.errors import refusal
from auv_fault_env.faults import NORMAL, classes
from diagnosers import storage
from diagnosers.networks.class_list import check_class_list
from training.stimuli.policy_inputs import CLASSES, FEATURES, classes_of, feature_names

LAYERS = ("first", "second", "action")
HIDDEN = 64
REACH = 5.0  # offset of the action 1 in units of the budget


def policy_shapes(n_features: int) -> storage.Shapes:
    """The shapes of the tensors of a policy with that many features, by name."""
    widths = (n_features, HIDDEN, HIDDEN, 1)
    shapes = {}
    for layer, (n_inputs, n_outputs) in zip(LAYERS, pairwise(widths), strict=True):
        shapes[f"{layer}_weight"] = (n_outputs, n_inputs)
        shapes[f"{layer}_bias"] = (n_outputs,)
    return shapes


def policy_name(diagnoser: str, seed: int) -> str:
    """The name of the files of a policy, from its diagnoser and the seed of its training."""
    return f"stimulus-{diagnoser}-{seed}"


@dataclass(frozen=True)
class LearnedPolicy:
    """Two hidden layers, all tanh, from the features of the active environment to an action.

    An action is an offset in units of `REACH` times the budget, which is among the features: one
    policy serves all of `training.stimuli.policy_inputs.BUDGETS`.

    Beside another diagnoser than that of its training, with other beliefs, it may excite without a
    reason.
    """

    tensors: dict[str, np.ndarray]  # weights and biases, float32, shaped as `policy_shapes`
    diagnoser: str  # name of that beside which it has learned
    classes: tuple[str, ...] = CLASSES  # of its training, whose log odds it sees

    def __post_init__(self):
        storage.check_tensors("the policy", self.tensors, policy_shapes(len(self.features)))

    @property
    def features(self) -> tuple[str, ...]:
        """The names of its inputs in their order."""
        return feature_names(self.classes)

    def action(self, features: np.ndarray) -> np.ndarray:
        """Actions (n_lanes, 1) float32, -1 to 1, without noise, of features (n_lanes, n)."""
        import torch  # takes a second, and only policies need it

        features = np.asarray(features, np.float32)
        if features.ndim != 2 or features.shape[1] != len(self.features):
            allowed = f"(n_lanes, {len(self.features)})"
            raise refusal("shape of the features", features.shape, allowed, "one row per lane")
        with torch.inference_mode():
            values = torch.from_numpy(features)
            for layer in LAYERS:
                weight = torch.from_numpy(self.tensors[f"{layer}_weight"])
                bias = torch.from_numpy(self.tensors[f"{layer}_bias"])
                # no matrix product: the sum of a lane must not depend on the number of lanes
                weighted_sum = (values[:, None, :] * weight).sum(dim=2)
                values = torch.tanh(weighted_sum + bias)
            return values.numpy()

    def save(self, path: str | Path) -> None:
        """Write a safetensors file for `load`; its header names the features in their order."""
        settings = ("features", "diagnoser")
        header = {name: getattr(self, name) for name in settings}
        storage.write(path, self.tensors, header)

    @classmethod
    def load(cls, path: str | Path) -> "LearnedPolicy":
        """The policy in a file of `save`; a damaged one or one of other features is refused."""
        tensors, header = storage.read(path)
        header = header if isinstance(header, dict) else {}
        features = header.get("features")
        remedy = "train it anew"
        is_list = isinstance(features, list) and all(isinstance(name, str) for name in features)
        trained_classes = classes_of(features) if is_list else ()
        is_layout = is_list and features == list(feature_names(trained_classes))
        if not is_layout or trained_classes[:1] != (NORMAL,):
            where = "training.stimuli.policy_inputs.FEATURES"
            allowed = f"the {len(FEATURES)} of {where} in their order"
            got = _first_difference(features)
            raise refusal(f"features of the policy {path}", got, allowed, remedy)
        diagnoser = header.get("diagnoser")
        if not isinstance(diagnoser, str):
            raise refusal(f"diagnoser of the policy {path}", diagnoser, "a name", remedy)
        storage.check_tensors(path, tensors, policy_shapes(len(features)))
        check_class_list(trained_classes, classes())
        return cls(tensors, diagnoser, trained_classes)


def _first_difference(features: Any) -> Any:
    """The first difference of a header's features from `FEATURES`, short enough for one line."""
    if not isinstance(features, list):
        return features
    count = f"{len(features)} features"
    for number, (found, expected) in enumerate(zip(features, FEATURES, strict=False), start=1):
        if found != expected:
            return f"{count}, number {number} {found!r}"
    return count
