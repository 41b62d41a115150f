"""The networks behind the parameter filter, V.D: trained on the fault map, fed with estimates."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from auv_fault_env.parameters import SAMPLE_RATE
from diagnosers.networks.fault_map import (
    MODES_5_2,
    fault_map,
    grid,
    normalise,
    severity,
)
from training.thesis.backpropagation import (
    Networks,
    NetworkSettings,
    evaluate,
    rms_error,
    train,
)
from training.thesis.comparison import ALPHA, BETA, Comparison

SIZES = (4, 8)  # hidden nodes, thesis V.D.1
GRID = 41  # points along an axis of the map
# presentations; the weights with the least rms error are used
CHECKPOINTS = tuple(range(100_000, 2_000_001, 100_000))
ONSET = 10.0  # s
POINTS = grid(GRID)
TARGETS = fault_map(POINTS)
TRUE_MODE = TARGETS.argmax(axis=1)
TRUE_SEVERITY = severity(TARGETS)


class Response(NamedTuple):
    """Estimates of a test run as points of the map, and the outputs of the networks.

    (n_networks, n_samples, 2) and (n_networks, n_samples, n_modes).
    """

    points: np.ndarray
    outputs: np.ndarray


class KalmanStudy(NamedTuple):
    """Networks by number of hidden nodes, and their outputs (n_networks, n_points, n_modes)."""

    networks: dict[int, Networks]
    outputs: dict[int, np.ndarray]


def run_study(seeds: Sequence[int], bar: tqdm) -> KalmanStudy:
    """Train networks of both sizes, one per seed, to their least rms error."""
    groups = {size: [NetworkSettings(seed, size) for seed in seeds] for size in SIZES}
    trained = train(groups, POINTS[None], TARGETS, CHECKPOINTS, bar)
    networks = {size: least_error(trained[size]) for size in SIZES}
    outputs = {size: evaluate(networks[size], POINTS) for size in SIZES}
    return KalmanStudy(networks, outputs)


def least_error(trained: Networks) -> Networks:
    """Every network at the checkpoint (the first axis) of its least rms error on the map."""
    best = rms_error(evaluate(trained, POINTS), TARGETS).argmin(axis=0)
    network = np.arange(len(trained.n_hidden))
    return Networks(trained.hidden[best, network], trained.output[best, network], trained.n_hidden)


def responses(comparison: Comparison, run: str, networks: Networks) -> tuple[Response, Response]:
    """Responses to a test run: of all networks without noise, of each to one of the noisy runs."""
    row = comparison.runs.index(run)
    network = np.arange(len(networks.n_hidden))
    clean = comparison.clean.mean[:, row, np.zeros_like(network)]
    n_seeds = comparison.noisy.mean.shape[2]
    noisy = comparison.noisy.mean[:, row, network % n_seeds]
    return _response(clean, networks), _response(noisy, networks)


def _response(estimates: np.ndarray, networks: Networks) -> Response:
    """The response to estimates (n_samples, n_networks, 3)."""
    points = normalise(estimates[..., ALPHA], estimates[..., BETA]).swapaxes(0, 1)
    return Response(points, evaluate(networks, points))


def accuracy_by_mode(outputs: np.ndarray) -> np.ndarray:
    """Share of each mode's points of the map that are named correctly, (n_networks, n_modes)."""
    is_right = outputs.argmax(axis=-1) == TRUE_MODE
    shares = [is_right[:, k == TRUE_MODE].mean(axis=1) for k in range(len(MODES_5_2))]
    return np.stack(shares, axis=1)


def severity_error(outputs: np.ndarray) -> np.ndarray:
    """Mean absolute error of the severity over the map's faulty points, (n_networks,)."""
    error = np.abs(severity(outputs) - TRUE_SEVERITY)
    return error[:, TRUE_MODE > 0].mean(axis=1)


def time_to_identification(response: Response, mode: str) -> np.ndarray:
    """Seconds from onset until the mode's output stays the largest to the end, (n_networks,)."""
    is_wrong = response.outputs.argmax(axis=-1) != MODES_5_2.index(mode)
    after_last_wrong = is_wrong.shape[1] - np.argmax(is_wrong[:, ::-1], axis=1)
    first_right = np.where(is_wrong.any(axis=1), after_last_wrong, 0)
    return first_right / SAMPLE_RATE - ONSET


def share_normal_before_onset(response: Response) -> np.ndarray:
    """Share of the samples up to the onset that are named normal, (n_networks,)."""
    before = response.outputs[:, : round(ONSET * SAMPLE_RATE) + 1]
    return (before.argmax(axis=-1) == 0).mean(axis=1)
