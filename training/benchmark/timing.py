"""What a diagnoser costs: one vehicle's samples one by one, and many vehicles at once."""

import time
from typing import Any

import numpy as np

from training.benchmark.validation import N_SAMPLES, Contestant, Episodes, run_lanes, started

# samples
WARM_UP = 200
ONE_BY_ONE = 2000
MANY_LANES = 4096
MANY_SAMPLES = 20
DIFFERENT = 256


def cost(contestant: Contestant, first_seed: int) -> dict[str, Any]:
    """Microseconds of `update`: median and 99th percentile for one lane, and per lane among `MANY_LANES`.

    Wall-clock time: other work on the machine shows, in the 99th percentile first.
    """
    episodes = run_lanes(range(first_seed, first_seed + DIFFERENT), faulty=True, thesis=False)
    one = _lanes(episodes, 1, N_SAMPLES)
    many = _lanes(episodes, MANY_LANES, MANY_SAMPLES)
    single = durations(contestant, one, WARM_UP + ONE_BY_ONE)[WARM_UP:]
    together = durations(contestant, many, MANY_SAMPLES)
    p50, p99 = np.percentile(single, [50, 99])
    return {
        "p50_us": float(p50),
        "p99_us": float(p99),
        "many_lanes_us": float(np.median(together) / MANY_LANES),
    }


def durations(contestant: Contestant, episodes: Episodes, n_samples: int) -> np.ndarray:
    """Duration of each of n updates [us], going round the episodes' samples."""
    rollout = episodes.rollout
    diagnoser = started(contestant, rollout.healthy, episodes.full_severity)
    observations = rollout.observations
    stamps = np.empty((n_samples, 2), np.int64)
    for k in range(n_samples):
        observation = observations[k % len(observations)]
        stamps[k, 0] = time.perf_counter_ns()
        diagnoser.update(observation)
        stamps[k, 1] = time.perf_counter_ns()
    return (stamps[:, 1] - stamps[:, 0]) / 1e3


def _lanes(episodes: Episodes, n_lanes: int, n_samples: int) -> Episodes:
    """So many lanes and samples of the episodes, lanes repeated where there are fewer."""
    chosen = np.arange(n_lanes) % DIFFERENT
    rollout = episodes.rollout._replace(
        observations=episodes.rollout.observations[:n_samples][:, chosen],
        healthy=episodes.rollout.healthy[chosen],
    )
    return episodes._replace(rollout=rollout, full_severity=episodes.full_severity[chosen])
