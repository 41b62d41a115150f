"""Both networks of the thesis side by side (VI.B): one for the shafts, one for the hull.

Each network counts only for what it can isolate, its `labels`: the ratio of its probability of a
label to the label's prior is its evidence for every class of that label. The belief is the prior
times both pieces of evidence, as if they were independent.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from auv_fault_env.parameters import Vehicle
from diagnosers import kalman_network, raw_network
from diagnosers.diagnoser import Belief, Recursive, with_impossible_unknown
from diagnosers.kalman import Estimate
from diagnosers.kalman_network import KalmanNetwork
from diagnosers.networks.modes import log_softmax
from diagnosers.raw_network import RawNetwork
from diagnosers.storage import Weights, load_tensors

PRIOR_NORMAL = 0.5  # all faults share the rest evenly
RAW = "raw_network."  # prefix of the names of its tensors
KALMAN = "kalman_network."


def _prefixed(parts: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    return {prefix + name: value for prefix, part in parts.items() for name, value in part.items()}


OF_KALMAN = kalman_network.ARCHITECTURE | kalman_network.CALIBRATION
ARCHITECTURE = _prefixed({RAW: raw_network.ARCHITECTURE, KALMAN: OF_KALMAN})


class Parallel(Recursive):
    """The raw network on the shafts beside the Kalman network on the hull, one belief.

    Severity is the Kalman network's. Misleads as each of its parts does; and as both read the same
    speed and rpm, a fault of these sensors counts twice. `vehicle` is the nominal vehicle of the
    filter, or a preset's name; `weights` are those of both networks, None for the package's.
    """

    name = "parallel"

    def __init__(self, vehicle: str | Vehicle = "thesis1992", weights: Weights | None = None):
        if weights is None:
            self.raw = RawNetwork()
            self.kalman = KalmanNetwork(vehicle)
        else:
            tensors = load_tensors(weights, ARCHITECTURE)
            self.raw = RawNetwork(_with_prefix(RAW, tensors))
            self.kalman = KalmanNetwork(vehicle, _with_prefix(KALMAN, tensors))
        self.classes = self.kalman.classes
        self.labels = {}
        for name in self.classes:
            both = (self.raw.labels[name], self.kalman.labels[name])
            different = dict.fromkeys(filter(None, both))
            self.labels[name] = ", ".join(different) or None
        n_faults = len(self.known_classes) - 1
        prior_fault = (1.0 - PRIOR_NORMAL) / n_faults
        prior = np.array([PRIOR_NORMAL] + [prior_fault] * n_faults)
        self.log_prior = np.log(prior)
        self.ratios = []
        for network in (self.raw, self.kalman):
            known_labels = [network.labels[name] for name in self.known_classes]
            self.ratios.append(_ratios(known_labels, prior))

    def initial(self, n_lanes: int) -> Estimate:
        """The filter's state at the start; the raw network has none."""
        return self.kalman.initial(n_lanes)

    def step(self, state: Estimate, observation: np.ndarray) -> tuple[Estimate, Belief]:
        """The filter's next state, and the belief pooled from those of both networks."""
        _, shaft = self.raw.step((), observation)
        state, hull = self.kalman.step(state, observation)
        total = self.log_prior
        for ratios, belief in zip(self.ratios, (shaft, hull), strict=True):
            probability = np.exp(belief.log_probability[:, :-1])
            total = total + np.log(probability @ ratios)
        severity = (moment[:, :-1] for moment in hull[1:])
        return state, with_impossible_unknown(Belief(log_softmax(total), *severity))

    def tensors(self) -> dict[str, np.ndarray]:
        """Those of both networks."""
        return _prefixed({RAW: self.raw.tensors(), KALMAN: self.kalman.tensors()})

    def settings(self) -> dict[str, Any]:
        """The nominal vehicle."""
        return self.kalman.settings()


def _with_prefix(prefix: str, tensors: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    names = [name for name in tensors if name.startswith(prefix)]
    return {name.removeprefix(prefix): tensors[name] for name in names}


def _ratios(labels: Sequence[str | None], prior: np.ndarray) -> np.ndarray:
    """The matrix from probabilities of classes to those of their labels over the labels' priors."""
    of_class = np.array(labels, dtype=object)
    have_one_label = (of_class[:, None] == of_class).astype(np.float64)
    return have_one_label / (prior @ have_one_label)
