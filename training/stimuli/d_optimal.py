"""The periodic speed profile that tells most of drag and thrust: the largest determinant of their Fisher information.

Source: Goodwin & Payne, "Dynamic System Identification: Experiment Design and Data Analysis", 1977,
ch. 6.
"""

from functools import cache
from itertools import product

import numpy as np

from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS
from auv_fault_env.parameters import SAMPLE_RATE
from diagnosers.kalman import SurgeFilter
from training.stimuli.base import BUDGET, MISSION_SPEED

SHORTEST_PERIOD = 5.0  # s: the speed hardly follows anything quicker
DUTIES = (0.1, 0.2, 0.3, 0.4, 0.5)  # share of the first level
# share of each level's time that is not spent at the mission's speed
ON_SHARES = (0.25, 0.5, 0.75, 1.0)
SIGNS = (-1.0, 1.0)


def candidates(duration: float) -> np.ndarray:
    """Profiles of root mean square 1 with a whole number of periods, (n_profiles, n_samples).

    A period has two levels of opposite sign, even or uneven, with a mean of zero; each of them may
    be cut short and followed by the mission's speed, a third level.
    """
    n_samples = round(duration * SAMPLE_RATE)
    cycles = range(1, int(duration / SHORTEST_PERIOD) + 1)
    profiles = [profile(n_samples, *choice) for choice in product(cycles, DUTIES, ON_SHARES, SIGNS)]
    return np.array(profiles)


def profile(n_samples: int, cycles: int, duty: float, on_share: float, sign: float) -> np.ndarray:
    """One profile (n_samples,): `cycles` periods, the first level `sign` for `duty` of each, then the other one."""
    phase = (cycles * np.arange(n_samples) / n_samples) % 1.0
    first = phase < duty
    within = np.where(first, phase / duty, (phase - duty) / (1.0 - duty))
    level = np.where(first, 1.0 - duty, -duty) * (within < on_share)
    return sign * level / np.sqrt(np.mean(np.square(level)))


def log_information(offsets: np.ndarray) -> np.ndarray:
    """Log determinant of what speed offsets (n_profiles, n_samples) [m/s] tell of alpha and beta, (n_profiles,).

    The nominal vehicle runs the profiles around 1 ft/s without noise; the covariance of the filter
    of the surge model along these runs is then the Cramér-Rao bound, disturbance and prior included
    (see `training.bounds.cramer_rao`).
    """
    n = len(offsets)
    kalman = SurgeFilter(walk_std=(0.0, 0.0, 0.0))
    fleet = Fleet(n, sensor_noise=0.0, disturbance=0.0, healthy_band=0.0, parallel=False)
    observation = fleet.reset([0] * n, schedules=[()] * n, missions=[MISSIONS["cruise"]] * n)
    estimate = kalman.initial(n)
    for offset in offsets.T:
        estimate = kalman.update(estimate, observation)
        observation = fleet.step(
            np.column_stack([observation[:, MISSION_SPEED] + offset, np.zeros((n, 2))])
        )
    return -np.linalg.slogdet(estimate.covariance[:, 1:3, 1:3]).logabsdet


@cache
def d_optimal(duration: float) -> np.ndarray:
    """The best of the candidates over this time [s] at the thesis' amplitude, root mean square 1, (n_samples,)."""
    found = candidates(duration)
    return found[log_information(BUDGET * found).argmax()]
