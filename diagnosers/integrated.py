"""The thesis' second recommendation (VI.B): one network on readings and filter estimates."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from auv_fault_env.parameters import Vehicle, vehicle_of
from diagnosers import storage
from diagnosers.diagnoser import Belief, Recursive, two_shaft_vehicle
from diagnosers.networks.class_list import (
    SHIPPED_CLASSES,
    check_class_list,
    is_fault,
    with_added_classes,
)
from diagnosers.networks.features import N_COMMANDS, Features, FeatureState
from diagnosers.networks.numpy_network import (
    N_MEMORY,
    NumpyNetwork,
    architecture,
    n_outputs,
    smooth_opinion,
)
from diagnosers.networks.smoothing import SmoothedBelief, initial_smoothing

PACKAGED = storage.WEIGHTS / "integrated.safetensors"


class IntegratedState(NamedTuple):
    """The states of features, network and smoothing."""

    features: FeatureState
    units: np.ndarray  # (n_lanes, n_memory) float32
    opinion: np.ndarray  # (n_lanes, n_outputs) float32, smoothed; NaN before the first sample
    smoothed: SmoothedBelief


class Integrated(Recursive):
    """A recurrent network on readings, residuals, and the filters' estimates and innovations.

    Trained on simulated vehicles (``auv-fault train integrated``; see the card beside the weights).
    A class that is not among those of the training, such as that of a fault that joined the
    catalogue later, gets probability and severity from the filter bank (see
    `diagnosers.networks.class_list`).

    Misleads: on vehicles, noise or faults far from those it was trained on, its probabilities are
    no frequencies. It was trained on episodes of a minute whose faults begin within half of one of
    motion; few are repaired. It learnt `unknown` from random changes of the vehicle and from the
    same fault on both sides; another kind of fault may look to it like a known one. The odds of a
    fault fall over seconds at the soonest, so a false alarm lasts. Another nominal ``vehicle``
    changes the filters and residuals, not what the network makes of them.

    Without `trained_classes` the classes are those that the weights name, else those of the shipped
    weights, which are of a vehicle with two shafts. `bank` has settings of the filter bank among
    the features, of weights that were trained on the vehicle of a vehicle file (see `Features`).
    """

    name = "integrated"
    filled_channels = slice(0, N_COMMANDS)  # the filter bank takes a gap for what it is

    def __init__(
        self,
        vehicle: str | Vehicle = "thesis1992",
        weights: storage.Weights = PACKAGED,
        trained_classes: Sequence[str] | None = None,
        bank: Mapping[str, Any] = MappingProxyType({}),
    ):
        is_shipped = weights == PACKAGED
        self.vehicle = two_shaft_vehicle(vehicle) if is_shipped else vehicle_of(vehicle)
        self.bank = dict(bank)
        if trained_classes is None:
            trained_classes = storage.settings_of(weights).get("trained_classes", SHIPPED_CLASSES)
        self.trained_classes = check_class_list(trained_classes, self.classes)
        self._tensors = storage.load_tensors(weights, architecture(self.trained_classes))
        self._network = NumpyNetwork(self._tensors)
        self._features = Features(self.vehicle, self.trained_classes, self.bank)
        self._trained_columns = [self.classes.index(name) for name in self.trained_classes]
        self._is_fault = np.array([is_fault(name) for name in self.trained_classes])
        # a fault that joins the catalogue later stands before `unknown` in the bank's belief
        self._bank_columns = [*range(len(self.known_classes)), -1]

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
        filters, features, bank = self._features.step(state.features, observation)
        encoded, opinion = self._network.encode(features)
        previous = np.where(np.isnan(state.opinion), opinion, state.opinion)
        opinion = smooth_opinion(opinion, previous)
        outputs, units = self._network.recur(encoded, opinion, state.units)
        log_probability, *severity = self._network.decode(outputs, features)
        severity = [moment * self._is_fault for moment in severity]
        smoothed = state.smoothed.after(log_probability)
        belief = Belief(smoothed.log_probability(), *severity)
        if len(self.trained_classes) < len(self.classes):
            own = Belief(*(values[:, self._bank_columns] for values in bank))
            belief = with_added_classes(belief, own, self._trained_columns)
        return IntegratedState(filters, units, opinion, smoothed), belief

    def tensors(self) -> dict[str, np.ndarray]:
        """Weights and calibration, by name."""
        return {name: tensor.copy() for name, tensor in self._tensors.items()}

    def settings(self) -> dict[str, Any]:
        """The nominal vehicle and the classes of the training, and settings of the bank."""
        settings = {
            "vehicle": asdict(self.vehicle),
            "trained_classes": list(self.trained_classes),
        }
        return settings | ({"bank": self.bank} if self.bank else {})
