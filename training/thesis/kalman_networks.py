"""The networks behind the parameter filter, V.D: trained on the fault map alone, then fed with recorded estimates."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from auv_fault_env.parameters import SAMPLE_RATE
from diagnosers.networks.fault_map import MODES_5_2, fault_map, grid, normalise, severity
from training.thesis.backpropagation import Lane, Networks, recall, rms, train
from training.thesis.comparison import ALPHA, BETA, Comparison

SIZES = (4, 8)  # hidden nodes, thesis V.D.1
GRID = 41  # points along an axis of the map
# presentations; the weights of the least rms error are kept
CHECKPOINTS = tuple(range(100_000, 2_000_001, 100_000))
ONSET = 10.0  # s
POINTS = grid(GRID)
TARGETS = fault_map(POINTS)
MODE = TARGETS.argmax(axis=1)
GRADE = severity(TARGETS)


class Response(NamedTuple):
    """Estimates as points of the map (n_networks, n_samples, 2) and the networks' outputs (..., n_modes)."""

    points: np.ndarray
    outputs: np.ndarray


class KalmanStudy(NamedTuple):
    """By hidden nodes: the networks and their outputs (n_networks, n_points, n_modes) over the map."""

    networks: dict[int, Networks]
    surface: dict[int, np.ndarray]


def study(seeds: Sequence[int], bar: tqdm) -> KalmanStudy:
    """Train networks of both sizes, one per seed, to their minimum rms error."""
    groups = {size: [Lane(seed, size) for seed in seeds] for size in SIZES}
    networks = {
        size: least_error(trained)
        for size, trained in train(groups, POINTS[None], TARGETS, CHECKPOINTS, bar).items()
    }
    return KalmanStudy(
        networks, {size: recall(trained, POINTS) for size, trained in networks.items()}
    )


def least_error(trained: Networks) -> Networks:
    """Every network at that one of the checkpoints, its first axis, where its rms error on the map is least."""
    best = rms(recall(trained, POINTS), TARGETS).argmin(axis=0), np.arange(len(trained.size))
    return Networks(trained.hidden[best], trained.output[best], trained.size)


def responses(view: Comparison, run: str, networks: Networks) -> tuple[Response, Response]:
    """How the networks answer a test run: all to the noise-free estimates, each to those of a noisy run of its own."""
    row = view.runs.index(run)
    count = len(networks.size)
    clean = view.clean.mean[:, row, np.zeros(count, int)]
    noisy = view.noisy.mean[:, row, np.arange(count) % view.noisy.mean.shape[2]]
    points = [
        normalise(part[..., ALPHA], part[..., BETA]).swapaxes(0, 1) for part in (clean, noisy)
    ]
    return tuple(Response(part, recall(networks, part)) for part in points)


def named_correctly(outputs: np.ndarray) -> np.ndarray:
    """Share of the map's points whose mode has the largest output, by mode, (n_networks, n_modes)."""
    right = outputs.argmax(axis=-1) == MODE
    return np.stack([right[:, k == MODE].mean(axis=1) for k in range(len(MODES_5_2))], axis=1)


def severity_error(outputs: np.ndarray) -> np.ndarray:
    """Mean absolute error of the severity over the map's faulty points, (n_networks,)."""
    return np.abs(severity(outputs) - GRADE)[:, MODE > 0].mean(axis=1)


def identified_after(response: Response, mode: str) -> np.ndarray:
    """Seconds from onset until the mode's output stays the largest up to the end, (n_networks,)."""
    wrong = response.outputs.argmax(axis=-1) != MODES_5_2.index(mode)
    # first sample of the last right interval
    last = wrong.shape[1] - np.argmax(wrong[:, ::-1], axis=1)
    return np.where(wrong.any(axis=1), last, 0) / SAMPLE_RATE - ONSET


def normal_before(response: Response) -> np.ndarray:
    """Share of the samples up to the onset that are named normal, (n_networks,)."""
    return (response.outputs[:, : round(ONSET * SAMPLE_RATE) + 1].argmax(axis=-1) == 0).mean(axis=1)
