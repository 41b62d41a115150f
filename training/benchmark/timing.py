"""What a diagnoser costs: samples of one vehicle one by one, and many vehicles at once."""

import time
from typing import Any

import numpy as np

from auv_fault_env.fleet import Fleet
from diagnosers import Diagnoser
from training.benchmark.suites import ONE_FAULT
from training.rollouts import Rollout, manoeuvres, roll_out

# samples
WARM_UP = 200
ONE_BY_ONE = 2000
MANY_LANES = 4096
MANY_SAMPLES = 20
DIFFERENT = 256  # lanes that are simulated; more are copies
N_SAMPLES = 650


def compute_cost(diagnoser: Diagnoser, first_seed: int) -> dict[str, Any]:
    """Microseconds of `update`: median and 99th percentile for one lane, and per lane of many.

    Wall-clock time: other work on the machine shows, in the 99th percentile first.
    """
    seeds = range(first_seed, first_seed + DIFFERENT)
    fleet = Fleet(DIFFERENT, schedules=ONE_FAULT)
    rollout = roll_out(fleet, seeds, N_SAMPLES, manoeuvres(first_seed, N_SAMPLES, DIFFERENT))
    one_lane = _repeated(rollout, 1, N_SAMPLES)
    many_lanes = _repeated(rollout, MANY_LANES, MANY_SAMPLES)
    single = update_durations(diagnoser, one_lane, WARM_UP + ONE_BY_ONE)[WARM_UP:]
    together = update_durations(diagnoser, many_lanes, MANY_SAMPLES)
    p50, p99 = np.percentile(single, [50, 99])
    per_lane = np.median(together) / MANY_LANES
    return {
        "p50_us": float(p50),
        "p99_us": float(p99),
        "many_lanes_us": float(per_lane),
    }


def update_durations(diagnoser: Diagnoser, rollout: Rollout, n_updates: int) -> np.ndarray:
    """Duration of each update [us]; after the last sample of the rollout comes the first."""
    observations = rollout.observations
    diagnoser.reset(observations.shape[1])
    if hasattr(diagnoser, "set_truth"):
        diagnoser.set_truth(rollout.healthy, rollout.severity.max(axis=0))
    stamps = np.empty((n_updates, 2), np.int64)
    for k in range(n_updates):
        observation = observations[k % len(observations)]
        stamps[k, 0] = time.perf_counter_ns()
        diagnoser.update(observation)
        stamps[k, 1] = time.perf_counter_ns()
    return (stamps[:, 1] - stamps[:, 0]) / 1e3


def _repeated(rollout: Rollout, n_lanes: int, n_samples: int) -> Rollout:
    """So many lanes and samples of the rollout, lanes repeated where there are fewer."""
    lanes = np.arange(n_lanes) % DIFFERENT
    return rollout._replace(
        observations=rollout.observations[:n_samples][:, lanes],
        severity=rollout.severity[:, lanes],
        healthy=rollout.healthy[lanes],
    )
