"""What the active agent sees: belief, estimates with their uncertainty, mission and budget."""

import math

import numpy as np

from auv_fault_env.channels import INDEX, MAXIMUM_COMMAND
from auv_fault_env.faults import classes
from diagnosers import Belief
from diagnosers.kalman import Estimate
from training.stimuli.base import EPISODE_TIME, LARGEST_OFFSET

FLOOR = -20.0  # nats: least log probability that counts, in the reward too
HIGHEST_ODDS = math.asinh(-FLOOR)
LAST_TIME = math.log1p(600.0)
MOST_LEFT = math.log1p(EPISODE_TIME * (MAXIMUM_COMMAND / LARGEST_OFFSET) ** 2)
MISSION_SPEED, SPEED = (INDEX[name] for name in ("mission_speed", "speed"))

BOUNDS: dict[str, tuple[float, float]] = {
    **{f"log_odds:{name}": (-HIGHEST_ODDS, HIGHEST_ODDS) for name in classes()},
    "severity": (0.0, 1.0),
    "alpha": (-1.0, 3.0),
    "alpha_std": (0.0, 1.0),
    "beta": (-1.0, 3.0),
    "beta_std": (0.0, 1.0),
    "mission_speed": (0.0, 1.0),
    "speed_error": (-1.0, 1.0),
    "last_offset": (-1.0, 1.0),
    "time": (0.0, LAST_TIME),
    "left": (0.0, MOST_LEFT),
}
FEATURES: tuple[str, ...] = tuple(BOUNDS)
LOW, HIGH = np.array(list(BOUNDS.values()), np.float32).T


def compressed_log_odds(log_probability: np.ndarray) -> np.ndarray:
    """Log odds of every class (n_lanes, n_classes), bent by asinh: graded around even chances and far away as well."""
    certain = np.minimum(log_probability, -np.finfo(float).tiny)
    odds = certain - np.log(-np.expm1(certain))
    return np.arcsinh(np.clip(odds, FLOOR, -FLOOR))


def log_probability_of(bent: np.ndarray) -> np.ndarray:
    """Log probabilities from bent log odds, within their range."""
    return -np.logaddexp(0.0, -np.sinh(np.asarray(bent, np.float64)))


def compressed_allowance(left: np.ndarray) -> np.ndarray:
    """Logarithm of 1 + the time [s] for which the offset `LARGEST_OFFSET` could be held with what is left [m^2/s]."""
    return np.log1p(left / LARGEST_OFFSET**2)


def features(
    belief: Belief,
    estimate: Estimate,
    observation: np.ndarray,
    last_offset: np.ndarray,
    time: np.ndarray,
    left: np.ndarray,
) -> np.ndarray:
    """The features, (n_lanes, n_features) float32, in the order of `FEATURES`, within their bounds.

    Parameters
    ----------
    belief, estimate
        Of the diagnoser and of the parameter filter; `severity` is that of the most probable fault.
    observation
        The last readings, (n_lanes, n_channels).
    last_offset
        The last action in force, (n_lanes,), -1 to 1.
    time
        Since the episode's start [s], (n_lanes,); its feature is log(1 + time).
    left
        Of the squared offsets that a budget allows [m^2/s], (n_lanes,); its feature is
        `compressed_allowance`.
    """
    lanes = np.arange(len(observation))
    top = 1 + belief.log_probability[:, 1:].argmax(axis=1)
    columns = [
        belief.severity_mean[lanes, top],
        estimate.mean[:, 1],
        np.sqrt(estimate.covariance[:, 1, 1]),
        estimate.mean[:, 2],
        np.sqrt(estimate.covariance[:, 2, 2]),
        observation[:, MISSION_SPEED],
        observation[:, SPEED] - observation[:, MISSION_SPEED],
        last_offset,
        np.log1p(time),
        compressed_allowance(left),
    ]
    table = np.concatenate(
        [compressed_log_odds(belief.log_probability), np.stack(columns, axis=1)], axis=1
    )
    return np.clip(table.astype(np.float32), LOW, HIGH)
