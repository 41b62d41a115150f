"""The inputs of a policy: belief, estimates with their uncertainty, mission and budget."""

import math
from collections.abc import Sequence
from functools import cache

import numpy as np

from auv_fault_env.channels import INDEX, MAXIMUM_COMMAND
from auv_fault_env.faults import UNKNOWN
from diagnosers import Belief
from diagnosers.kalman import Estimate
from diagnosers.networks.class_list import SHIPPED_CLASSES
from training.stimuli.base import BUDGET, EPISODE_TIME, LARGEST_OFFSET, MISSION_SPEED

# nats: log odds count within +-20, and log probabilities from -20 on, in the reward too
FLOOR = -20.0
HIGHEST_ODDS = math.asinh(-FLOOR)
LAST_TIME = math.log1p(600.0)
HIGHEST_ALLOWANCE = math.log1p(EPISODE_TIME * (MAXIMUM_COMMAND / LARGEST_OFFSET) ** 2)
# m/s, least and largest budget that a policy learns; beyond them it acts as at the nearer one
BUDGETS = (0.02, 0.4)
SPEED = INDEX["speed"]


LOG_ODDS = "log_odds:"
LOG_ODDS_BOUNDS = (-HIGHEST_ODDS, HIGHEST_ODDS)
OTHER_BOUNDS: dict[str, tuple[float, float]] = {
    "severity": (0.0, 1.0),
    "alpha": (-1.0, 3.0),
    "alpha_std": (0.0, 1.0),
    "beta": (-1.0, 3.0),
    "beta_std": (0.0, 1.0),
    "mission_speed": (0.0, 1.0),
    "speed_error": (-1.0, 1.0),
    "last_offset": (-1.0, 1.0),
    "time": (0.0, LAST_TIME),
    "left": (0.0, HIGHEST_ALLOWANCE),
    "budget": (math.log(BUDGETS[0] / BUDGET), math.log(BUDGETS[1] / BUDGET)),
}


def feature_names(classes: Sequence[str]) -> tuple[str, ...]:
    """The features of an agent that sees the log odds of these classes, in their order."""
    return (*(f"{LOG_ODDS}{name}" for name in classes), *OTHER_BOUNDS)


def classes_of(features: Sequence[str]) -> tuple[str, ...]:
    """The classes whose log odds are among these features."""
    return tuple(name.removeprefix(LOG_ODDS) for name in features if name.startswith(LOG_ODDS))


@cache
def feature_bounds(n_classes: int) -> tuple[np.ndarray, np.ndarray]:
    """Least and largest features of an agent with so many classes, each (n_features,) float32."""
    bounds = [LOG_ODDS_BOUNDS] * n_classes + list(OTHER_BOUNDS.values())
    low, high = np.array(bounds, np.float32).T
    return low, high


# of the active environment, and of the policies that come with the package
CLASSES = (*SHIPPED_CLASSES, UNKNOWN)
BOUNDS = {name: OTHER_BOUNDS.get(name, LOG_ODDS_BOUNDS) for name in feature_names(CLASSES)}
FEATURES = tuple(BOUNDS)


def compressed_log_odds(log_probability: np.ndarray) -> np.ndarray:
    """The asinh of the log odds of every class, (n_lanes, n_classes): finest around even odds."""
    below_one = np.minimum(log_probability, -np.finfo(float).tiny)
    log_odds = below_one - np.log(-np.expm1(below_one))
    return np.arcsinh(np.clip(log_odds, FLOOR, -FLOOR))


def log_probability_of(compressed: np.ndarray) -> np.ndarray:
    """The log probabilities behind compressed log odds."""
    log_odds = np.sinh(np.asarray(compressed, np.float64))
    return -np.logaddexp(0.0, -log_odds)


def compressed_allowance(allowance: np.ndarray) -> np.ndarray:
    """The log of 1 + the time [s] for which the allowance [m^2/s] covers `LARGEST_OFFSET`."""
    return np.log1p(allowance / LARGEST_OFFSET**2)


def compressed_budget(budget: np.ndarray | float) -> np.ndarray:
    """The log of a budget [m/s] in units of `BUDGET`, at least that of the least of `BUDGETS`."""
    return np.log(np.maximum(budget, BUDGETS[0]) / BUDGET)


def policy_features(
    belief: Belief,
    estimate: Estimate,
    observation: np.ndarray,
    last_action: np.ndarray,
    time: np.ndarray,
    allowance: np.ndarray,
    budget: np.ndarray | float,
    seen_classes: Sequence[int] | slice = slice(None),
) -> np.ndarray:
    """The features in the order of `feature_names`, clipped to their bounds.

    Parameters
    ----------
    belief, estimate, observation
        Of the diagnoser, of the parameter filter, and the last one (n_lanes, n_channels).
    last_action
        (n_lanes,), -1 to 1.
    time
        Since the start of the episode, (n_lanes,) [s].
    allowance
        Squared offsets that the budget has left, (n_lanes,) [m^2/s].
    budget
        Root mean square of the offsets over `EPISODE_TIME`, (n_lanes,) or of all lanes [m/s].
    seen_classes
        Columns of the classes that the agent sees in the belief, (n_seen,). A class that it does
        not see only lowers the odds of `normal`, as any fault does.

    Returns
    -------
    (n_lanes, n_features) float32.
    """
    lanes = np.arange(len(observation))
    top_fault = 1 + belief.log_probability[:, 1:-1].argmax(axis=1)
    columns = [
        belief.severity_mean[lanes, top_fault],
        estimate.mean[:, 1],
        np.sqrt(estimate.covariance[:, 1, 1]),
        estimate.mean[:, 2],
        np.sqrt(estimate.covariance[:, 2, 2]),
        observation[:, MISSION_SPEED],
        observation[:, SPEED] - observation[:, MISSION_SPEED],
        last_action,
        np.log1p(time),
        compressed_allowance(allowance),
        np.broadcast_to(compressed_budget(budget), lanes.shape),
    ]
    log_odds = compressed_log_odds(belief.log_probability[:, seen_classes])
    features = np.concatenate([log_odds, np.stack(columns, axis=1)], axis=1)
    return np.clip(features.astype(np.float32), *feature_bounds(log_odds.shape[1]))
