"""The integrated network in numpy, without PyTorch and three times as fast on one sample."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.special import expit

from diagnosers.networks.features import EVIDENCE, bank_odds_columns, feature_names
from diagnosers.networks.modes import log_softmax
from diagnosers.networks.smoothing import update_share
from diagnosers.storage import Shapes

Arrays = tuple[np.ndarray, ...]
WIDTHS = (256, 128)  # of the encoder's hidden layers
N_MEMORY = 64  # units of the recurrent layer, and of the encoder's last
OPINION_SMOOTHING = 0.5  # s, because the first opinion on a single sample is noisy
LEAST_STD = 0.02  # of a severity: no diagnoser knows it better


def n_outputs(n_classes: int) -> int:
    """Outputs of the network: score, severity and scatter of the severity of every class."""
    return 3 * n_classes


def encoder_widths(trained_classes: Sequence[str]) -> tuple[int, ...]:
    """Inputs of the encoder and outputs of each of its layers."""
    return len(feature_names(trained_classes)), *WIDTHS, N_MEMORY


def smooth_opinion(opinion: Any, previous: Any) -> Any:
    """The running mean of the opinion (n_lanes, n_outputs), arrays of numpy or torch."""
    return previous + (opinion - previous) * update_share(OPINION_SMOOTHING)


def architecture(trained_classes: Sequence[str]) -> Shapes:
    """The tensors of `integrated_network.Network` with its gated recurrent unit, by name."""
    n_classes = len(trained_classes)
    of_encoder = enumerate(pairwise(encoder_widths(trained_classes)))
    layers = {f"encoder.{2 * k}": widths for k, widths in of_encoder}
    for name in ("opinion", "correction"):
        layers[name] = N_MEMORY, n_outputs(n_classes)
    shapes: Shapes = {}
    for name, (n_inputs, n_out) in layers.items():
        shapes |= {f"{name}.weight": (n_out, n_inputs), f"{name}.bias": (n_out,)}
    n_gates = 3 * N_MEMORY
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
    """A linear layer."""

    weight: np.ndarray  # (n_inputs, n_outputs)
    bias: np.ndarray

    def __call__(self, inputs: np.ndarray) -> np.ndarray:
        """Outputs (n_lanes, n_outputs) of inputs (n_lanes, n_inputs)."""
        return inputs @ self.weight + self.bias


class NumpyNetwork:
    """What `integrated_network.Network` computes, one sample at a time."""

    def __init__(self, tensors: Mapping[str, np.ndarray]):
        def layer(name: str, suffix: str = "") -> Layer:
            weight, bias = (tensors[f"{name}{kind}{suffix}"] for kind in ("weight", "bias"))
            return Layer(np.ascontiguousarray(weight.T), bias)

        self.encoder = [layer(f"encoder.{2 * k}.") for k in range(len(WIDTHS) + 1)]
        self.opinion = layer("opinion.")
        self.correction = layer("correction.")
        self.input_gates = layer("memory.", "_ih_l0")
        self.recurrent_gates = layer("memory.", "_hh_l0")
        self.bank_weight = tensors["trust"]
        self.pool_weight = EVIDENCE * tensors["lean"]
        self.sharpness = tensors["sharpness"]
        self.bias = tensors["bias"]
        self.n_classes = len(self.bias)
        self.bank_odds = bank_odds_columns(self.n_classes)

    def encode(self, features: np.ndarray) -> Arrays:
        """As `Network.encode`."""
        encoded = features
        for layer in self.encoder:
            weighted = layer(encoded)
            encoded = weighted * expit(weighted)
        opinion = self.opinion(encoded)
        opinion[:, 1 : self.n_classes] += self.bank_weight * features[:, self.bank_odds]
        return encoded, opinion

    def recur(self, encoded: np.ndarray, opinion: np.ndarray, units: np.ndarray) -> Arrays:
        """As `Network.recur`, of one sample."""
        scores = opinion[:, : self.n_classes] / EVIDENCE
        by_input = self.input_gates(np.concatenate([encoded, scores], axis=1))
        by_units = self.recurrent_gates(units)
        n_gates = 2 * N_MEMORY
        gates = expit(by_input[:, :n_gates] + by_units[:, :n_gates])
        reset, update = np.split(gates, 2, axis=1)
        candidate = np.tanh(by_input[:, n_gates:] + reset * by_units[:, n_gates:])
        units = candidate + update * (units - candidate)
        return opinion + self.correction(units), units

    def decode(self, outputs: np.ndarray, features: np.ndarray) -> Arrays:
        """As `Network.decode`, float64."""
        scores, severity, scatter = np.split(outputs.astype(np.float64), 3, axis=1)
        scores[:, 1:] += self.pool_weight * features[:, self.bank_odds]
        log_probability = log_softmax(self.sharpness * scores + self.bias)
        return (
            log_probability,
            expit(severity),
            np.logaddexp(0.0, scatter) + LEAST_STD,
        )
