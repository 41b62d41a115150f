"""The thesis' network on filtered data (V.D, Table 5.2): parameter filter, then 2-8-5.

The filter estimates alpha and beta; the network, trained on the thesis' `fault_map` alone, gives
mode and grade. What makes its outputs a belief is fitted afterwards on episodes: a slope and an
offset for every output node's sum (Platt, "Probabilistic outputs for support vector machines",
1999), and a line from the height of Fig. 5.12 to the severity; see `training.learning`.
"""

from dataclasses import asdict
from typing import Any

import numpy as np

from auv_fault_env.faults import CATALOGUE, classes
from auv_fault_env.faults import labels as tables
from auv_fault_env.parameters import Vehicle, vehicle_of
from diagnosers.diagnoser import (
    Belief,
    Recursive,
    two_shaft_vehicle,
    with_impossible_unknown,
)
from diagnosers.kalman import Estimate, ParameterFilter
from diagnosers.networks import modes
from diagnosers.networks.fault_map import MODES_5_2, normalise, severity
from diagnosers.networks.feed_forward import FeedForward, tensor_shapes
from diagnosers.shafts import with_equal_readings, with_equal_shafts
from diagnosers.storage import WEIGHTS, Shapes, Weights, load_tensors

PACKAGED = WEIGHTS / "kalman_network.safetensors"
ARCHITECTURE = tensor_shapes(2, 8, 5)
CALIBRATION: Shapes = {
    "slope": (5,),  # of a mode's score in its output node's sum
    "offset": (5,),
    # of a mode, if it is the fault: intercept and slope in the height of Fig. 5.12, and scatter
    "severity": (5, 3),
}


def labels() -> dict[str, str | None]:
    """The mode of every class in Table 5.2, None where it has none."""
    return {name: mode if mode in MODES_5_2 else None for name, (_, mode) in tables().items()}


def shares_of(vehicle: Vehicle) -> np.ndarray:
    """The share of every class in each mode on a vehicle, (n_modes, n_known)."""
    faults = [fault for fault in CATALOGUE.values() if not fault.is_possible(vehicle)]
    return modes.class_shares(labels(), MODES_5_2, {fault.diagnosis for fault in faults})


def points(estimate: Estimate) -> np.ndarray:
    """The points (n_lanes, 2) of the fault map at which a filter's estimate stands."""
    columns = [ParameterFilter.states.index(name) for name in ("alpha", "beta")]
    return normalise(*estimate.mean[:, columns].T)


def outputs(sums: np.ndarray) -> np.ndarray:
    """The outputs (n, 5), mode times grade: sigmoids of the sums, as in the thesis."""
    return 1.0 / (1.0 + np.exp(-sums))


class KalmanNetwork(Recursive):
    """2-8-5 on normalised alpha and beta, as the parameter filter estimates them.

    Propulsion modes have no side; port and starboard share theirs evenly. For classes without a
    mode in Table 5.2 see `networks.modes.class_shares`. Misleads at constant speed, where only
    beta/alpha is observable; under faults of the speed, acceleration and rpm sensors, which look
    like drag or thrust; and on what stays in the window of normal operation: a damaged propeller,
    at most 25 % of the thrust, is detected late or never, and isolated as a lost one.

    `vehicle` is the nominal vehicle of the filter, or a preset's name; with the shipped weights it
    has two shafts.
    """

    name = "kalman_network"

    def __init__(self, vehicle: str | Vehicle = "thesis1992", weights: Weights = PACKAGED):
        is_shipped = weights == PACKAGED
        self.vehicle = two_shaft_vehicle(vehicle) if is_shipped else vehicle_of(vehicle)
        self.filter = ParameterFilter(with_equal_shafts(self.vehicle))
        self.learnt = load_tensors(weights, ARCHITECTURE | CALIBRATION)
        self.network = FeedForward({name: self.learnt[name] for name in ARCHITECTURE})
        self.classes = classes()
        self.labels = labels()
        self.shares = shares_of(self.vehicle)
        prior_mean, prior_std = modes.PRIOR_SEVERITY
        table = np.vstack([self.learnt["severity"], (prior_mean, 0.0, prior_std)])
        known_modes = [self.labels[name] for name in self.known_classes]
        rows = [MODES_5_2.index(mode) if mode else -1 for mode in known_modes]
        self.severity = table[rows]

    def initial(self, n_lanes: int) -> Estimate:
        """The filter's state at the start."""
        return self.filter.initial(n_lanes)

    def step(self, state: Estimate, observation: np.ndarray) -> tuple[Estimate, Belief]:
        """The filter's next state, and the belief at the point of the map where it stands."""
        observation = with_equal_readings(observation, self.vehicle)
        state = self.filter.update(state, observation)
        sums = self.network.evaluate(points(state))
        log_modes = modes.log_softmax(self.learnt["slope"] * sums + self.learnt["offset"])
        log_probability = modes.class_log_probability(log_modes, self.shares)
        intercept, slope, std = self.severity.T
        height = severity(outputs(sums))[:, None]
        mean = np.clip(intercept + slope * height, 0.0, 1.0)
        severity_std = np.tile(std, (len(mean), 1))
        known = Belief(log_probability, mean, severity_std)
        return state, with_impossible_unknown(known)

    def tensors(self) -> dict[str, np.ndarray]:
        """Weights, biases and calibration by name."""
        return dict(self.learnt)

    def settings(self) -> dict[str, Any]:
        """The nominal vehicle."""
        return {"vehicle": asdict(self.vehicle)}
