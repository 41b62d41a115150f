"""The thesis' second recommendation (VI.B): one network on the sensors and on what the Kalman filters make of them.

Recalled in numpy: a vehicle's computer needs no PyTorch for it, and one sample takes a third of the
time.
"""

from dataclasses import asdict
from itertools import pairwise
from typing import Any, NamedTuple, TypeVar

import numpy as np
from scipy.special import expit

from auv_fault_env.faults import classes
from auv_fault_env.parameters import Vehicle, vehicle_of
from diagnosers import storage
from diagnosers.diagnoser import Belief, Recursive
from diagnosers.networks.features import BANK_ODDS, EVIDENCE, FEATURES, Features, FeatureState
from diagnosers.networks.modes import log_softmax
from diagnosers.networks.smoothing import SmoothedBelief, initial_smoothing, update_share
from diagnosers.storage import Shapes, Weights, load_tensors

PACKAGED = storage.WEIGHTS / "integrated.safetensors"
Array = TypeVar("Array")
CLASSES = classes()
N_CLASSES = len(CLASSES)
N_OUTPUTS = 3 * N_CLASSES  # score, severity and its spread of every class
WIDTHS = (256, 128)  # of the encoder's hidden layers
N_MEMORY = 64  # units of the recurrent layer, and of the encoder's last
# s, over which the first opinion is averaged: single samples are noisy, and a label must not
# flicker
OPINION_SMOOTHING = 0.5
LEAST_STD = 0.02  # of a severity: finer than anybody can know it


def smooth_opinion(opinion: Array, before: Array) -> Array:
    """The opinion averaged over `OPINION_SMOOTHING`, given the average before; (n_lanes, 3 n_classes), of numpy or torch."""
    return before + (opinion - before) * update_share(OPINION_SMOOTHING)


def _linear(name: str, n_inputs: int, n_outputs: int) -> Shapes:
    return {f"{name}.weight": (n_outputs, n_inputs), f"{name}.bias": (n_outputs,)}


def _architecture() -> Shapes:
    """The tensors of `integrated_network.Network` with its gated recurrent unit, by name."""
    widths = (len(FEATURES), *WIDTHS, N_MEMORY)
    gates = 3 * N_MEMORY
    shapes = {}
    for k, (before, after) in enumerate(pairwise(widths)):
        shapes |= _linear(f"encoder.{2 * k}", before, after)
    shapes |= _linear("opinion", N_MEMORY, N_OUTPUTS) | _linear("correction", N_MEMORY, N_OUTPUTS)
    shapes |= {
        "memory.weight_ih_l0": (gates, N_MEMORY + N_CLASSES),
        "memory.weight_hh_l0": (gates, N_MEMORY),
    }
    shapes |= {"memory.bias_ih_l0": (gates,), "memory.bias_hh_l0": (gates,)}
    return shapes | {
        "trust": (N_CLASSES - 1,),
        "lean": (1,),
        "sharpness": (1,),
        "bias": (N_CLASSES,),
    }


ARCHITECTURE = _architecture()


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
        self.opinion, self.correction = (
            layer(f"{name}.weight", f"{name}.bias") for name in ("opinion", "correction")
        )
        self.input_gates, self.recurrent_gates = (
            layer(f"memory.weight_{name}_l0", f"memory.bias_{name}_l0") for name in ("ih", "hh")
        )
        self.trust = tensors["trust"]
        self.lean = EVIDENCE * tensors["lean"]
        self.sharpness = tensors["sharpness"]
        self.bias = tensors["bias"]

    def encode(self, features: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As `Network.encode`."""
        encoded = features
        for layer in self.encoder:
            weighted = layer(encoded)
            encoded = weighted * expit(weighted)
        opinion = self.opinion(encoded)
        opinion[:, 1:N_CLASSES] += self.trust * features[:, BANK_ODDS]
        return encoded, opinion

    def recur(
        self, encoded: np.ndarray, opinion: np.ndarray, units: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """As `Network.recur`, of one sample."""
        input_gates = self.input_gates(
            np.concatenate([encoded, opinion[:, :N_CLASSES] / EVIDENCE], axis=1)
        )
        recurrent_gates = self.recurrent_gates(units)
        gates = 2 * N_MEMORY
        reset, update = np.split(
            expit(input_gates[:, :gates] + recurrent_gates[:, :gates]), 2, axis=1
        )
        fresh = np.tanh(input_gates[:, gates:] + reset * recurrent_gates[:, gates:])
        units = fresh + update * (units - fresh)
        return opinion + self.correction(units), units

    def decode(
        self, outputs: np.ndarray, features: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As `Network.decode`, float64."""
        scores, mean, spread = np.split(outputs.astype(np.float64), 3, axis=1)
        scores[:, 1:] += self.lean * features[:, BANK_ODDS]
        return (
            log_softmax(self.sharpness * scores + self.bias),
            expit(mean),
            np.logaddexp(0.0, spread) + LEAST_STD,
        )


class IntegratedState(NamedTuple):
    """State of the features; the network's units (n_lanes, n_memory) and calm opinion (n_lanes, 3 n_classes), float32.

    The opinion is NaN before the first sample.
    """

    features: FeatureState
    units: np.ndarray
    opinion: np.ndarray
    steady: SmoothedBelief


class Integrated(Recursive):
    """A recurrent network on readings, motor and surge residuals, and the filters' estimates, innovations, variances.

    Trained on simulated vehicles (``auv-fault train integrated``; see the card beside the weights),
    on every sample of faulty, compound and healthy episodes of 60 s. An unknown fault shows as a
    belief that is neither `normal` nor any one class: `diagnosers.decide` calls it so.

    When it misleads: on vehicles, noise or faults far from those it was trained on, its
    probabilities are no frequencies. It was trained on episodes of a minute whose faults begin
    within half of one, and stay: reset it after a repair. The odds of a fault fall over seconds at
    the soonest, so a false alarm lasts. Another nominal ``vehicle`` changes the filters and
    residuals, not what the network makes of them.
    """

    name = "integrated"
    classes = CLASSES

    def __init__(self, vehicle: str | Vehicle = "thesis1992", weights: Weights = PACKAGED):
        self.vehicle = vehicle_of(vehicle)
        self._tensors = load_tensors(weights, ARCHITECTURE)
        self._network, self._features = NumpyNetwork(self._tensors), Features(self.vehicle)

    def initial(self, n_lanes: int) -> IntegratedState:
        """Filters at their start, an empty memory."""
        units = np.zeros((n_lanes, N_MEMORY), np.float32)
        opinion = np.full((n_lanes, N_OUTPUTS), np.nan, np.float32)
        return IntegratedState(
            self._features.initial(n_lanes),
            units,
            opinion,
            initial_smoothing(n_lanes, N_CLASSES - 1),
        )

    def step(
        self, state: IntegratedState, observation: np.ndarray
    ) -> tuple[IntegratedState, Belief]:
        """The next state and the belief."""
        following, features = self._features.step(state.features, observation)
        encoded, opinion = self._network.encode(features)
        opinion = smooth_opinion(opinion, np.where(np.isnan(state.opinion), opinion, state.opinion))
        outputs, units = self._network.recur(encoded, opinion, state.units)
        told, *severity = self._network.decode(outputs, features)
        for moment in severity:
            moment[:, 0] = 0.0
        steady = state.steady.after(told)
        return IntegratedState(following, units, opinion, steady), Belief(
            steady.log_probability(), *severity
        )

    def tensors(self) -> dict[str, np.ndarray]:
        """Weights and calibration, by name."""
        return {name: tensor.copy() for name, tensor in self._tensors.items()}

    def settings(self) -> dict[str, Any]:
        """The nominal vehicle; what has been learnt is in `tensors`."""
        return {"vehicle": asdict(self.vehicle)}
