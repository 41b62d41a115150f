"""The thesis' second recommendation (VI.B): one network on readings and filter estimates.

Evaluated in numpy: a vehicle's computer needs no PyTorch for it, and one sample takes a third of
the time.
"""

from collections.abc import Sequence
from dataclasses import asdict
from itertools import pairwise
from typing import Any, NamedTuple, TypeVar

import numpy as np
from scipy.special import expit

from auv_fault_env.parameters import Vehicle, vehicle_of
from diagnosers import storage
from diagnosers.diagnoser import Belief, Recursive
from diagnosers.networks.class_list import SHIPPED_CLASSES, check_class_list, with_added_classes
from diagnosers.networks.features import (
    EVIDENCE,
    Features,
    FeatureState,
    bank_odds_columns,
    feature_names,
)
from diagnosers.networks.modes import log_softmax
from diagnosers.networks.smoothing import SmoothedBelief, initial_smoothing, update_share
from diagnosers.storage import Shapes, Weights

PACKAGED = storage.WEIGHTS / "integrated.safetensors"
Array = TypeVar("Array")
WIDTHS = (256, 128)  # of the encoder's hidden layers
N_MEMORY = 64  # units of the recurrent layer, and of the encoder's last
OPINION_SMOOTHING = 0.5  # s, because the first opinion on a single sample is noisy
LEAST_STD = 0.02  # of a severity: no diagnoser knows it better


def n_outputs(n_classes: int) -> int:
    """Outputs of the network: score, severity and scatter of the severity of every class."""
    return 3 * n_classes


def smooth_opinion(opinion: Array, previous: Array) -> Array:
    """The running mean of the opinion (n_lanes, n_outputs), arrays of numpy or torch."""
    return previous + (opinion - previous) * update_share(OPINION_SMOOTHING)


def _linear(name: str, n_inputs: int, n_out: int) -> Shapes:
    return {f"{name}.weight": (n_out, n_inputs), f"{name}.bias": (n_out,)}


def architecture(trained_classes: Sequence[str]) -> Shapes:
    """The tensors of `integrated_network.Network` with its gated recurrent unit, by name."""
    n_classes = len(trained_classes)
    widths = (len(feature_names(trained_classes)), *WIDTHS, N_MEMORY)
    n_gates = 3 * N_MEMORY
    shapes: Shapes = {}
    for k, (n_inputs, n_out) in enumerate(pairwise(widths)):
        shapes |= _linear(f"encoder.{2 * k}", n_inputs, n_out)
    for name in ("opinion", "correction"):
        shapes |= _linear(name, N_MEMORY, n_outputs(n_classes))
    return shapes | {
        "memory.weight_ih_l0": (n_gates, N_MEMORY + n_classes),
        "memory.weight_hh_l0": (n_gates, N_MEMORY),
        "memory.bias_ih_l0": (n_gates,),
        "memory.bias_hh_l0": (n_gates,),
        "trust": (n_classes - 1,),
        "lean": (1,),
        "sharpness": (1,),
        "bias": (n_classes,),
    }


class Layer(NamedTuple):
    """A linear layer: weight (n_inputs, n_outputs) and bias (n_outputs,)."""

    weight: np.ndarray
    bias: np.ndarray

    def __call__(self, inputs: np.ndarray) -> np.ndarray:
        """Outputs (n_lanes, n_outputs) of inputs (n_lanes, n_inputs)."""
        return inputs @ self.weight + self.bias


class NumpyNetwork:
    """What `integrated_network.Network` computes, one sample at a time, float32 in numpy."""

    def __init__(self, tensors: dict[str, np.ndarray]):
        def layer(weight: str, bias: str) -> Layer:
            return Layer(np.ascontiguousarray(tensors[weight].T), tensors[bias])

        depth = len(WIDTHS) + 1
        self.encoder = [
            layer(f"encoder.{2 * k}.weight", f"encoder.{2 * k}.bias") for k in range(depth)
        ]
        self.opinion = layer("opinion.weight", "opinion.bias")
        self.correction = layer("correction.weight", "correction.bias")
        self.input_gates = layer("memory.weight_ih_l0", "memory.bias_ih_l0")
        self.recurrent_gates = layer("memory.weight_hh_l0", "memory.bias_hh_l0")
        self.bank_weight = tensors["trust"]
        self.pool_weight = EVIDENCE * tensors["lean"]
        self.sharpness = tensors["sharpness"]
        self.bias = tensors["bias"]
        self.n_classes = len(self.bias)
        self.bank_odds = bank_odds_columns(self.n_classes)

    def encode(self, features: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As `Network.encode`."""
        encoded = features
        for layer in self.encoder:
            weighted = layer(encoded)
            encoded = weighted * expit(weighted)
        opinion = self.opinion(encoded)
        opinion[:, 1 : self.n_classes] += self.bank_weight * features[:, self.bank_odds]
        return encoded, opinion

    def recur(
        self, encoded: np.ndarray, opinion: np.ndarray, units: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """As `Network.recur`, of one sample."""
        scores = opinion[:, : self.n_classes] / EVIDENCE
        inputs = np.concatenate([encoded, scores], axis=1)
        by_input = self.input_gates(inputs)
        by_units = self.recurrent_gates(units)
        n_gates = 2 * N_MEMORY
        gates = expit(by_input[:, :n_gates] + by_units[:, :n_gates])
        reset, update = np.split(gates, 2, axis=1)
        candidate = np.tanh(by_input[:, n_gates:] + reset * by_units[:, n_gates:])
        units = candidate + update * (units - candidate)
        return opinion + self.correction(units), units

    def decode(
        self, outputs: np.ndarray, features: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As `Network.decode`, float64."""
        scores, severity, scatter = np.split(outputs.astype(np.float64), 3, axis=1)
        scores[:, 1:] += self.pool_weight * features[:, self.bank_odds]
        log_probability = log_softmax(self.sharpness * scores + self.bias)
        return log_probability, expit(severity), np.logaddexp(0.0, scatter) + LEAST_STD


class IntegratedState(NamedTuple):
    """The states of features, network and smoothing.

    units (n_lanes, n_memory) and mean opinion (n_lanes, n_outputs) are float32; the opinion is NaN
    before the first sample.
    """

    features: FeatureState
    units: np.ndarray
    opinion: np.ndarray
    smoothed: SmoothedBelief


class Integrated(Recursive):
    """A recurrent network on readings, residuals, and the filters' estimates and innovations.

    Trained on simulated vehicles (``auv-fault train integrated``; see the card beside the weights),
    on every sample of faulty, compound and healthy episodes of 60 s. A fault that is in no class
    shows as a belief that is neither `normal` nor any one class: `diagnosers.decide` names it
    `unknown`. A fault that joined the catalogue after the training gets probability and severity
    from the filter bank (see `diagnosers.networks.class_list`).

    When it misleads: on vehicles, noise or faults far from those it was trained on, its
    probabilities are no frequencies. It was trained on episodes of a minute whose faults begin
    within half of one, and stay: reset it after a repair. The odds of a fault fall over seconds at
    the soonest, so a false alarm lasts. Another nominal ``vehicle`` changes the filters and
    residuals, not what the network makes of them.

    Parameters
    ----------
    vehicle
        The nominal vehicle of the filters, a preset's name or a `Vehicle`.
    weights
        A safetensors file, or the tensors by name.
    trained_classes
        The classes of the training in their order; None for those that the file names, or those of
        the shipped weights if it names none.
    """

    name = "integrated"

    def __init__(
        self,
        vehicle: str | Vehicle = "thesis1992",
        weights: Weights = PACKAGED,
        trained_classes: Sequence[str] | None = None,
    ):
        self.vehicle = vehicle_of(vehicle)
        if trained_classes is None:
            trained_classes = storage.settings_of(weights).get("trained_classes", SHIPPED_CLASSES)
        self.trained_classes = check_class_list(trained_classes, self.classes)
        self._tensors = storage.load_tensors(weights, architecture(self.trained_classes))
        self._network = NumpyNetwork(self._tensors)
        self._features = Features(self.vehicle, self.trained_classes)
        self._trained_columns = [self.classes.index(name) for name in self.trained_classes]

    def initial(self, n_lanes: int) -> IntegratedState:
        """Filters at their start, an empty memory."""
        n_trained = len(self.trained_classes)
        units = np.zeros((n_lanes, N_MEMORY), np.float32)
        opinion = np.full((n_lanes, n_outputs(n_trained)), np.nan, np.float32)
        smoothed = initial_smoothing(n_lanes, n_trained - 1)
        return IntegratedState(self._features.initial(n_lanes), units, opinion, smoothed)

    def step(
        self, state: IntegratedState, observation: np.ndarray
    ) -> tuple[IntegratedState, Belief]:
        """The next state and the belief."""
        filters, features, bank = self._features.step_with_bank(state.features, observation)
        encoded, opinion = self._network.encode(features)
        previous = np.where(np.isnan(state.opinion), opinion, state.opinion)
        opinion = smooth_opinion(opinion, previous)
        outputs, units = self._network.recur(encoded, opinion, state.units)
        log_probability, *severity = self._network.decode(outputs, features)
        for moment in severity:
            moment[:, 0] = 0.0
        smoothed = state.smoothed.after(log_probability)
        belief = Belief(smoothed.log_probability(), *severity)
        if len(self.trained_classes) < len(self.classes):
            own = Belief(*(values[:, : len(self.classes)] for values in bank))
            belief = with_added_classes(belief, own, self._trained_columns)
        return IntegratedState(filters, units, opinion, smoothed), belief

    def tensors(self) -> dict[str, np.ndarray]:
        """Weights and calibration, by name."""
        tensors = self._tensors.items()
        return {name: tensor.copy() for name, tensor in tensors}

    def settings(self) -> dict[str, Any]:
        """The nominal vehicle and the classes of the training."""
        return {"vehicle": asdict(self.vehicle), "trained_classes": list(self.trained_classes)}
