"""Trains the thesis' network on Kalman-filtered data (V.D): 2-8-5, on the fault map alone."""

from typing import Any

import numpy as np
import torch
from scipy.optimize import minimize
from scipy.special import logsumexp

from auv_fault_env.parameters import Vehicle
from diagnosers.kalman import ParameterFilter
from diagnosers.kalman_network import (
    ARCHITECTURE,
    KalmanNetwork,
    labels,
    outputs,
    points,
    shares_of,
)
from diagnosers.networks.fault_map import MODES_5_2, fault_map, grid, severity
from diagnosers.networks.feed_forward import FeedForward, random_tensors
from diagnosers.networks.modes import log_softmax
from diagnosers.shafts import with_equal_readings, with_equal_shafts
from training.learning.episodes import KINDS, training_episodes, without_gaps
from training.logged_vehicle import THESIS, LoggedVehicle

POINTS = 41  # along an axis of the map
VALIDATION_POINTS = 60  # in common with the others only the corners
ITERATIONS = 50  # of L-BFGS in an epoch
STEEPNESS = 10.0  # of the hidden nodes' edges at the start, per unit of the map
# of the weights: with 0 or with 1e-5 less of the map is right (84 to 90 %, and 93 %, not 95 %)
DECAY = 3e-6
LANES = 1024  # episodes to calibrate on
STRIDE = 8  # one sample in so many is used


class KalmanNetworkTrainer:
    """Squared error of the outputs on a grid over the fault map, and weight decay.

    The map is the only training file of the thesis. It is one data set without randomness, so every
    epoch is a full-batch run of L-BFGS with a new start of its memory.
    """

    epochs = 20
    patience = 5
    data = (
        f"trained on {POINTS} x {POINTS} points of the fault map, validated on "
        f"{VALIDATION_POINTS} x {VALIDATION_POINTS} others; calibrated on {LANES} episodes of "
        f"60 s, {KINDS}; default faults, band and noise"
    )

    def __init__(self, seed: int, vehicle: LoggedVehicle = THESIS) -> None:
        self.vehicle = vehicle
        self.network = FeedForward(initial_tensors(seed))

    def epoch(self, number: int) -> dict[str, float]:
        """Continue the descent; the data are the same in every epoch."""
        inputs, target = _map_points(POINTS)
        settings = {"tolerance_change": 0.0, "line_search_fn": "strong_wolfe"}
        parameters = self.network.parameters()
        optimiser = torch.optim.LBFGS(parameters, max_iter=ITERATIONS, **settings)

        def closure() -> torch.Tensor:
            optimiser.zero_grad()
            loss = self._loss(inputs, target)
            loss.backward()
            return loss

        optimiser.step(closure)
        return {"loss": closure().item()}

    def _loss(self, inputs: torch.Tensor, target: torch.Tensor) -> torch.Tensor:
        network = self.network
        error = torch.nn.functional.mse_loss(torch.sigmoid(network(inputs)), target)
        weights = network.hidden_weight.square().sum() + network.output_weight.square().sum()
        return error + DECAY * weights

    def validate(self) -> dict[str, float]:
        """The same loss at other points."""
        with torch.inference_mode():
            return {"loss": self._loss(*_map_points(VALIDATION_POINTS)).item()}

    def state(self) -> dict[str, np.ndarray]:
        """The weights, by name."""
        return self.network.tensors()

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Take over a result of `state`."""
        self.network = FeedForward(state)

    def finish(self) -> tuple[KalmanNetwork, dict[str, Any]]:
        """The calibrated diagnoser, and the figures of its calibration."""
        sums, label, true_severity = _calibration_samples(self.network, self.vehicle)
        slope, offset, loss = calibrate(sums, label, self.vehicle.vehicle)
        height = severity(outputs(sums))
        lines = severity_lines(height, label, true_severity)
        calibration = {"slope": slope, "offset": offset, "severity": lines}
        tensors = self.network.tensors()
        tensors |= {name: array.astype(np.float32) for name, array in calibration.items()}
        figures = {
            "calibration_loss": loss,
            "share_of_map_right": share_right(self.network),
        }
        return KalmanNetwork(self.vehicle.vehicle, tensors), figures


def initial_tensors(seed: int) -> dict[str, np.ndarray]:
    """Tensors at the start; the edge of each hidden node, in a random direction, cuts the map."""
    random = np.random.default_rng(seed)
    tensors = random_tensors(ARCHITECTURE, seed)
    normals = STEEPNESS * random.normal(size=tensors["hidden_weight"].shape)
    points_on_edges = random.uniform(size=normals.shape)
    bias = -(normals * points_on_edges).sum(axis=1)
    tensors["hidden_weight"] = normals.astype(np.float32)
    tensors["hidden_bias"] = bias.astype(np.float32)
    return tensors


def _map_points(n: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Inputs and targets at n x n points of the map."""
    inputs = grid(n)
    return torch.from_numpy(inputs).float(), torch.from_numpy(fault_map(inputs)).float()


def share_right(network: FeedForward) -> float:
    """Share of the map on which the largest output is the right mode."""
    inputs = grid(VALIDATION_POINTS)
    chosen = network.evaluate(inputs).argmax(axis=1)
    return float(np.mean(chosen == fault_map(inputs).argmax(axis=1)))


def _calibration_samples(
    network: FeedForward, vehicle: LoggedVehicle
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sums of the output nodes (n, n_modes), true class and severity (n,) of episodes."""
    samples = []
    parameters = ParameterFilter(with_equal_shafts(vehicle.vehicle))
    for rollout in training_episodes("calibration", LANES, vehicle=vehicle):
        estimate = parameters.initial(rollout.observations.shape[1])
        for k, observation in enumerate(without_gaps(rollout.observations)):
            observation = with_equal_readings(observation, vehicle.vehicle)
            estimate = parameters.update(estimate, observation)
            if k % STRIDE == 0:
                sums = network.evaluate(points(estimate))
                samples.append((sums, rollout.label[k], rollout.severity[k]))
    return tuple(map(np.concatenate, zip(*samples, strict=True)))


def calibrate(
    sums: np.ndarray, label: np.ndarray, vehicle: Vehicle = THESIS.vehicle
) -> tuple[np.ndarray, np.ndarray, float]:
    """Slopes and offsets (n_modes,) with the largest likelihood, and the loss.

    Of the sums of the output nodes (n, n_modes) and the true classes (n,).
    """
    with np.errstate(divide="ignore"):
        log_share = np.log(shares_of(vehicle)).T[label]
    n_samples, n_modes = sums.shape

    def loss_and_gradient(parameters: np.ndarray) -> tuple[float, np.ndarray]:
        slope, offset = parameters.reshape(2, n_modes)
        log_modes = log_softmax(slope * sums + offset)
        joint = log_modes + log_share
        pull = (np.exp(log_modes) - np.exp(log_softmax(joint))) / n_samples
        gradient = np.concatenate([(pull * sums).sum(axis=0), pull.sum(axis=0)])
        return -logsumexp(joint, axis=1).mean(), gradient

    start = np.concatenate([np.ones(n_modes), np.zeros(n_modes)])
    optimum = minimize(loss_and_gradient, start, jac=True, method="L-BFGS-B")
    slope, offset = optimum.x.reshape(2, n_modes)
    return slope, offset, float(optimum.fun)


def severity_lines(height: np.ndarray, label: np.ndarray, true_severity: np.ndarray) -> np.ndarray:
    """Intercept, slope and scatter (n_modes, 3) of the severity over the height in the map.

    Each argument is (n,), of samples; the line of `normal` is zeros.
    """
    mode_of_class = [MODES_5_2.index(name) if name else -1 for name in labels().values()]
    mode = np.array(mode_of_class)[label]
    lines = np.zeros((len(MODES_5_2), 3))
    for k in range(1, len(MODES_5_2)):
        x = height[mode == k]
        y = true_severity[mode == k]
        slope, intercept = np.polyfit(x, y, 1)
        scatter = np.std(y - intercept - slope * x)
        lines[k] = intercept, slope, scatter
    return lines
