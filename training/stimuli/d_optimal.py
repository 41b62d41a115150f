"""The periodic speed profile with most information on drag and thrust (D-optimal design).

Most information is the largest determinant of their Fisher information. Source: Goodwin & Payne,
"Dynamic System Identification: Experiment Design and Data Analysis", 1977, ch. 6.
"""

from functools import cache
from itertools import product

import numpy as np

from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS
from auv_fault_env.parameters import SAMPLE_RATE
from diagnosers.kalman import SurgeFilter
from training.stimuli.base import BUDGET, MISSION_SPEED

SHORTEST_PERIOD = 5.0  # s: the speed hardly follows a faster change
DUTIES = (0.1, 0.2, 0.3, 0.4, 0.5)  # share of the first level in a period
ON_SHARES = (
    0.25,
    0.5,
    0.75,
    1.0,
)  # of a level, before the speed returns to the mission speed
SIGNS = (-1.0, 1.0)


def candidates(duration: float) -> np.ndarray:
    """Profiles of root mean square 1 with a whole number of periods, (n_profiles, n_samples).

    A period has two levels with a mean of zero; after each the mission speed may follow.
    """
    n_samples = round(duration * SAMPLE_RATE)
    n_periods = range(1, int(duration / SHORTEST_PERIOD) + 1)
    choices = product(n_periods, DUTIES, ON_SHARES, SIGNS)
    return np.array([profile(n_samples, *choice) for choice in choices])


def profile(
    n_samples: int, n_periods: int, duty: float, on_share: float, sign: float
) -> np.ndarray:
    """One candidate (n_samples,); the first level has this sign and lasts `duty` of each period."""
    phase = (n_periods * np.arange(n_samples) / n_samples) % 1.0
    in_first = phase < duty
    phase_of_level = np.where(in_first, phase / duty, (phase - duty) / (1.0 - duty))
    level = np.where(in_first, 1.0 - duty, -duty)
    level = level * (phase_of_level < on_share)
    return sign * level / np.sqrt(np.mean(np.square(level)))


def log_information(offsets: np.ndarray) -> np.ndarray:
    """Log determinant of the information on alpha and beta, of offsets (n_profiles, n_samples).

    The nominal vehicle runs these speed offsets [m/s] around 1 ft/s without noise. The covariance
    of the surge filter is then the Cramer-Rao bound, disturbance and prior included
    (see `training.bounds.cramer_rao`).
    """
    n = len(offsets)
    surge_filter = SurgeFilter(walk_std=(0.0, 0.0, 0.0))
    fleet = Fleet(n, sensor_noise=0.0, disturbance=0.0, healthy_band=0.0, parallel=False)
    observation = fleet.reset([0] * n, schedules=[()] * n, missions=[MISSIONS["cruise"]] * n)
    estimate = surge_filter.initial(n)
    no_deflection = np.zeros((n, 2))
    for offset in offsets.T:
        estimate = surge_filter.update(estimate, observation)
        speed_command = observation[:, MISSION_SPEED] + offset
        observation = fleet.step(np.column_stack([speed_command, no_deflection]))
    drag_and_thrust = estimate.covariance[:, 1:3, 1:3]
    return -np.linalg.slogdet(drag_and_thrust).logabsdet


@cache
def d_optimal(duration: float) -> np.ndarray:
    """The best candidate over this time [s] at the amplitude of the thesis, (n_samples,)."""
    profiles = candidates(duration)
    return profiles[log_information(BUDGET * profiles).argmax()]
