"""Both networks of the thesis side by side (VI.B): one for the shafts, one for the hull.

Each network counts only for what it can isolate, its `labels`: the ratio of its probability of a
label to the label's prior is its evidence for every class of that label. The belief is the prior
times both pieces of evidence, as if they were independent, which they are not. Powers below 1 on
either (a logarithmic opinion pool) raised the log loss; on the Kalman network's evidence they
isolated a few more faults.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from auv_fault_env.parameters import Vehicle
from diagnosers import kalman_network, raw_network
from diagnosers.diagnoser import Belief, Recursive
from diagnosers.kalman import Estimate
from diagnosers.kalman_network import KalmanNetwork
from diagnosers.networks.modes import log_softmax
from diagnosers.raw_network import RawNetwork
from diagnosers.storage import Weights, load_tensors

PRIOR_NORMAL = 0.5  # all faults share the rest evenly
# prefixes of the names of their tensors
RAW = "raw_network."
KALMAN = "kalman_network."
PARTS = {
    RAW: raw_network.ARCHITECTURE,
    KALMAN: kalman_network.ARCHITECTURE | kalman_network.CALIBRATION,
}
ARCHITECTURE = {
    prefix + name: shape for prefix, part in PARTS.items() for name, shape in part.items()
}


class Parallel(Recursive):
    """The raw network on the shafts beside the Kalman network on the hull, one belief.

    Severity is the Kalman network's, which gives the prior's to a class without a mode.
    Misleads as each of its parts does; and as both read the same speed and rpm, a fault of these
    sensors counts twice.

    Parameters
    ----------
    vehicle
        The nominal vehicle of the filter, a preset's name or a `Vehicle`.
    weights
        A safetensors file or the tensors by name, those of both networks; None for those that come
        with the package.
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
        self.labels = {
            name: _joined(label, self.kalman.labels[name])
            for name, label in self.raw.labels.items()
        }
        n_faults = len(self.classes) - 1
        prior_fault = (1.0 - PRIOR_NORMAL) / n_faults
        prior = np.array([PRIOR_NORMAL] + [prior_fault] * n_faults)
        self.log_prior = np.log(prior)
        self.ratios = [_ratios(self.raw.labels, prior), _ratios(self.kalman.labels, prior)]

    def initial(self, n_lanes: int) -> Estimate:
        """The filter's state at the start; the raw network has none."""
        return self.kalman.initial(n_lanes)

    def step(self, state: Estimate, observation: np.ndarray) -> tuple[Estimate, Belief]:
        """The filter's next state, and the belief pooled from those of both networks."""
        _, shaft = self.raw.step((), observation)
        state, hull = self.kalman.step(state, observation)
        total = self.log_prior
        for ratios, belief in zip(self.ratios, (shaft, hull), strict=True):
            probability = np.exp(belief.log_probability)
            total = total + np.log(probability @ ratios)
        return state, hull._replace(log_probability=log_softmax(total))

    def tensors(self) -> dict[str, np.ndarray]:
        """Those of both networks."""
        parts = {RAW: self.raw.tensors(), KALMAN: self.kalman.tensors()}
        return {
            prefix + name: tensor
            for prefix, tensors in parts.items()
            for name, tensor in tensors.items()
        }

    def settings(self) -> dict[str, Any]:
        """The nominal vehicle."""
        return self.kalman.settings()


def _joined(*labels: str | None) -> str | None:
    """Different labels of a class in one; None where it has none."""
    return ", ".join(dict.fromkeys(filter(None, labels))) or None


def _with_prefix(prefix: str, tensors: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {
        name.removeprefix(prefix): tensor
        for name, tensor in tensors.items()
        if name.startswith(prefix)
    }


def _ratios(labels: Mapping[str, str | None], prior: np.ndarray) -> np.ndarray:
    """The matrix from probabilities of classes to those of their labels over the labels' priors."""
    of_class = np.array(list(labels.values()), dtype=object)
    have_one_label = (of_class[:, None] == of_class).astype(np.float64)
    return have_one_label / (prior @ have_one_label)
