"""Episodes for the integrated network: simulated ahead, as features, in batches and mirrored."""

from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cache
from itertools import islice
from typing import NamedTuple

import numpy as np
import torch

from auv_fault_env.faults import classes
from auv_fault_env.schedules import ScheduleSampler
from diagnosers.diagnoser import fill_missing
from diagnosers.integrated import Integrated
from diagnosers.networks.features import Features, feature_names
from training.learning.episodes import training_episodes
from training.logged_vehicle import THESIS, LoggedVehicle, other_side

SCHEDULES = ScheduleSampler(compound=0.05, intermittent=0.05)
LANES = 512  # episodes of a set
UNKNOWN_SHARE = 0.16  # of the faulty lanes: 13 % of all
SIMULATORS = 2  # threads; the filter bank among the features takes more time than all else
SIMULATED_AHEAD = 4  # sets
BATCH = 32  # episodes
REPLAY_STRIDE = 6


class EpisodeSet(NamedTuple):
    """Features (n_samples, n_lanes, n_features), true class and severity (n_samples, n_lanes)."""

    features: torch.Tensor
    label: torch.Tensor
    severity: torch.Tensor


def simulated_sets(
    purpose: str, firsts: Iterable[int], vehicle: LoggedVehicle = THESIS
) -> Iterator[EpisodeSet]:
    """The sets that begin at these seeds of a purpose, a few simulated ahead of their use."""
    pool = ThreadPoolExecutor(SIMULATORS)
    remaining = iter(firsts)
    submitted: deque[Future[EpisodeSet]] = deque()

    def submit(n_sets: int) -> None:
        for first in islice(remaining, n_sets):
            submitted.append(pool.submit(simulate_set, purpose, first, vehicle))

    try:
        submit(SIMULATED_AHEAD)
        while submitted:
            episodes = submitted.popleft().result()
            submit(1)
            yield episodes
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def simulate_set(purpose: str, first: int, vehicle: LoggedVehicle = THESIS) -> EpisodeSet:
    """`LANES` episodes from the first-th seed of a purpose on."""
    rollouts = training_episodes(purpose, LANES, first, SCHEDULES, UNKNOWN_SHARE, vehicle)
    parts = [(rollout.observations, rollout.label, rollout.severity) for rollout in rollouts]
    observations, *truth = (np.concatenate(part, axis=1) for part in zip(*parts, strict=True))
    return EpisodeSet(*map(torch.from_numpy, (features_of(observations, vehicle), *truth)))


def features_of(observations: np.ndarray, vehicle: LoggedVehicle = THESIS) -> np.ndarray:
    """Features (n_samples, n_lanes, n_features) float32 of (n_samples, n_lanes, n_channels)."""
    return np.stack(list(features_over_time(observations, vehicle)))


def features_over_time(
    observations: np.ndarray, vehicle: LoggedVehicle = THESIS
) -> Iterator[np.ndarray]:
    """Features (n_lanes, n_features) float32 of each sample of (n_samples, n_lanes, n_channels)."""
    extractor = Features(vehicle.vehicle, classes(), vehicle.bank)
    state = extractor.initial(observations.shape[1])
    last = np.zeros(observations.shape[1:])
    for observation in observations:
        last = fill_missing(observation, last, Integrated.filled_channels)
        state, features, _ = extractor.step(state, last)
        yield features


def batches(
    episodes: EpisodeSet, random: np.random.Generator | None = None
) -> Iterator[EpisodeSet]:
    """Batches of `BATCH` episodes, each with missions of all kinds, in a random order if asked."""
    n_batches = episodes.label.shape[1] // BATCH
    order = range(n_batches) if random is None else random.permutation(n_batches).tolist()
    for k in order:
        yield EpisodeSet(*(part[:, k::n_batches].contiguous() for part in episodes))


def replay_samples(episodes: EpisodeSet, number: int) -> EpisodeSet:
    """Samples of a set, others for each set of an epoch: (n,), with features in half precision."""
    chosen = slice(number % REPLAY_STRIDE, None, REPLAY_STRIDE)
    features, label, severity = (part[chosen].flatten(0, 1) for part in episodes)
    return EpisodeSet(features.half(), label.clone(), severity.clone())


def mirrored(episodes: EpisodeSet) -> EpisodeSet:
    """The same episodes on a vehicle with port and starboard exchanged."""
    names = classes()
    features = episodes.features[..., mirror_order(feature_names(names))]
    label = mirror_order(names)[episodes.label]
    return EpisodeSet(features, label, episodes.severity)


@cache
def mirror_order(names: tuple[str, ...]) -> torch.Tensor:
    """For each name the index of the name with port and starboard exchanged."""
    return torch.tensor([names.index(other_side(name)) for name in names])
