"""Trains the thesis' network on Kalman-filtered data (V.D): 2-8-5 on the fault map alone; calibrated on episodes."""

from typing import Any

import numpy as np
import torch
from scipy.optimize import minimize
from scipy.special import logsumexp

from diagnosers.kalman import ParameterFilter
from diagnosers.kalman_network import ARCHITECTURE, KalmanNetwork, labels, outputs, points
from diagnosers.networks.fault_map import MODES_5_2, fault_map, grid, severity
from diagnosers.networks.feed_forward import FeedForward, random_tensors
from diagnosers.networks.modes import class_shares, log_softmax
from training.learning.episodes import training_episodes

POINTS = 41  # along an axis of the map
VALIDATION_POINTS = 60  # no point in common but the corners
ITERATIONS = 50  # of L-BFGS in an epoch
STEEPNESS = 10.0  # of the hidden nodes' edges at the start, per unit of the map
# of the weights: 0 learns less of the map (84 to 90 %, not 95) and 1e-5 too (93 %), with smoother
# edges
DECAY = 3e-6
LANES = 1024  # episodes to calibrate on
EVERY = 8  # one sample in so many


class KalmanNetworkTrainer:
    """Squared error of the outputs on a grid over the fault map, the thesis' single training file, and weight decay.

    The map is one data set without randomness, so every epoch is a full-batch run of L-BFGS,
    started afresh.
    """

    epochs = 20
    patience = 5
    data = (
        f"trained on {POINTS} x {POINTS} points of the fault map, validated on {VALIDATION_POINTS} x "
        f"{VALIDATION_POINTS} others; calibrated on {LANES} episodes of 60 s, half with the thesis' stimulus, half "
        "with random missions and manoeuvres; default faults, band and noise"
    )

    def __init__(self, seed: int) -> None:
        self.network = FeedForward(started(seed))

    def epoch(self, number: int) -> dict[str, float]:
        """Go on descending; the data are the same in every epoch."""
        inputs, target = _map(POINTS)
        optimiser = torch.optim.LBFGS(
            self.network.parameters(),
            max_iter=ITERATIONS,
            tolerance_change=0.0,
            line_search_fn="strong_wolfe",
        )

        def closure() -> torch.Tensor:
            optimiser.zero_grad()
            loss = self._loss(inputs, target)
            loss.backward()
            return loss

        optimiser.step(closure)
        return {"loss": closure().item()}

    def _loss(self, inputs: torch.Tensor, target: torch.Tensor) -> torch.Tensor:
        weights = (
            self.network.hidden_weight.square().sum() + self.network.output_weight.square().sum()
        )
        return (
            torch.nn.functional.mse_loss(torch.sigmoid(self.network(inputs)), target)
            + DECAY * weights
        )

    def validate(self) -> dict[str, float]:
        """The same loss between the points."""
        with torch.inference_mode():
            return {"loss": self._loss(*_map(VALIDATION_POINTS)).item()}

    def state(self) -> dict[str, np.ndarray]:
        """The weights, by name."""
        return self.network.tensors()

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Take over what `state` gave."""
        self.network = FeedForward(state)

    def finish(self) -> tuple[KalmanNetwork, dict[str, Any]]:
        """The calibrated diagnoser, and what the calibration came to."""
        sums, label, grown = _filtered(self.network)
        slope, offset, loss = calibrated(sums, label)
        tensors = self.network.tensors() | {
            "slope": slope.astype(np.float32),
            "offset": offset.astype(np.float32),
            "severity": lines(severity(outputs(sums)), label, grown).astype(np.float32),
        }
        figures = {"calibration_loss": loss, "share_of_map_right": share_right(self.network)}
        return KalmanNetwork(weights=tensors), figures


def started(seed: int) -> dict[str, np.ndarray]:
    """Tensors to start from: the edge of every hidden node, of any direction, goes through the map's square."""
    random = np.random.default_rng(seed)
    tensors = random_tensors(ARCHITECTURE, seed)
    normals = STEEPNESS * random.normal(size=tensors["hidden_weight"].shape)
    through = random.uniform(size=normals.shape)
    edges = {"hidden_weight": normals, "hidden_bias": -(normals * through).sum(axis=1)}
    return tensors | {name: tensor.astype(np.float32) for name, tensor in edges.items()}


def _map(n: int) -> tuple[torch.Tensor, torch.Tensor]:
    inputs = grid(n)
    return torch.from_numpy(inputs).float(), torch.from_numpy(fault_map(inputs)).float()


def share_right(network: FeedForward) -> float:
    """Share of the map on which the largest output is the right mode."""
    between = grid(VALIDATION_POINTS)
    return float(
        np.mean(network.evaluate(between).argmax(axis=1) == fault_map(between).argmax(axis=1))
    )


def _filtered(network: FeedForward) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Output nodes' sums (n, 5), true class and severity (n,) of samples from the calibration episodes."""
    parts = []
    for rollout in training_episodes("calibration", LANES):
        parameters = ParameterFilter()
        estimate = parameters.initial(rollout.observations.shape[1])
        for k, observation in enumerate(rollout.observations):
            estimate = parameters.update(estimate, observation)
            if k % EVERY == 0:
                parts.append(
                    (network.evaluate(points(estimate)), rollout.label[k], rollout.severity[k])
                )
    sums, label, grown = (np.concatenate(part) for part in zip(*parts, strict=True))
    return sums, label, grown


def calibrated(sums: np.ndarray, label: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Slopes and offsets (n_modes,) that give the true classes (n,) the most probability, and the loss they leave."""
    with np.errstate(divide="ignore"):
        log_share = np.log(class_shares(labels(), MODES_5_2)).T[label]
    n_samples, n_modes = sums.shape

    def loss(parameters: np.ndarray) -> tuple[float, np.ndarray]:
        slope, offset = parameters.reshape(2, n_modes)
        log_modes = log_softmax(slope * sums + offset)
        joint = log_modes + log_share
        pull = (np.exp(log_modes) - np.exp(log_softmax(joint))) / n_samples
        return -logsumexp(joint, axis=1).mean(), np.concatenate(
            [(pull * sums).sum(axis=0), pull.sum(axis=0)]
        )

    start = np.concatenate([np.ones(n_modes), np.zeros(n_modes)])
    found = minimize(loss, start, jac=True, method="L-BFGS-B")
    return *found.x.reshape(2, n_modes), float(found.fun)


def lines(height: np.ndarray, label: np.ndarray, grown: np.ndarray) -> np.ndarray:
    """Intercept, slope and scatter of the severity in the map's height, by mode (n_modes, 3); zeros for `normal`."""
    mode = np.array([MODES_5_2.index(name) if name else -1 for name in labels().values()])[label]
    table = np.zeros((len(MODES_5_2), 3))
    for k in range(1, len(MODES_5_2)):
        x = height[mode == k]
        y = grown[mode == k]
        slope, intercept = np.polyfit(x, y, 1)
        table[k] = intercept, slope, np.std(y - intercept - slope * x)
    return table
