"""Rewards of the active environment: what a decision led to, and functions of it."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from auv_fault_env.errors import refusal
from auv_fault_env.importable import found
from diagnosers import Belief
from training.stimuli.policy_inputs import FLOOR

# log p(normal) at which a fault counts as detected
DETECTED = math.log(0.02)


class Decision(NamedTuple):
    """An action and what the second after it led to, of every lane.

    Classes are indices in ``env.classes``. Without a fault the true class is 0, `normal`; an
    intermittent fault is true between its bursts as well.
    """

    action: np.ndarray  # (n_lanes,), -1 to 1
    time: np.ndarray  # (n_lanes,) at the end of the second, since the start of the episode [s]
    belief_before: Belief  # (n_lanes, n_classes), before the second
    belief: Belief  # at its end
    true_class_before: np.ndarray  # (n_lanes,)
    true_class: np.ndarray
    declared_class: np.ndarray  # (n_lanes,), 0 for none
    cost: np.ndarray  # (n_lanes,) mean squared offset of the commands [m^2/s^2]
    deviation: np.ndarray  # (n_lanes,) mean squared deviation of the true speed [m^2/s^2]
    energy: np.ndarray  # (n_lanes,) [J]
    shift: np.ndarray  # (n_lanes,) of thrust to port, 0 without such an action


Reward = Callable[[Decision], np.ndarray]


def log_probability_gain(decision: Decision) -> np.ndarray:
    """By how much the log probability of what is true has grown, (n_lanes,).

    It is the log probability, at least `FLOOR`, of the true class at the end of the second minus
    that at its start. Over an episode it sums to that of the end minus that of the start. The
    second in which the truth changes gives about -9, whatever the agent does.
    """
    after = _score(decision.belief, decision.true_class)
    return after - _score(decision.belief_before, decision.true_class_before)


def delay_penalty(decision: Decision) -> np.ndarray:
    """Minus the time for which a fault is not diagnosed, (n_lanes,), -1 to 0 [s].

    Without a fault it is 0. With one it is -1 for a belief in `normal`, and rises to 0 with the
    probability of the true class and, where that is most probable, with the evidence against
    `normal`: until its log probability is `DETECTED`, about where an alarm is raised. So the
    rewards of an episode sum to about minus the isolation time.
    """
    log_probability = decision.belief.log_probability
    lanes = np.arange(len(log_probability))
    detected = np.clip(log_probability[:, 0] / DETECTED, 0.0, 1.0)
    isolated = np.exp(log_probability[lanes, decision.true_class])
    return np.where(decision.true_class > 0, detected * isolated - 1.0, 0.0)


def _score(belief: Belief, true_class: np.ndarray) -> np.ndarray:
    lanes = np.arange(len(true_class))
    return np.maximum(belief.log_probability[lanes, true_class], FLOOR)


def known_reward(reward: Any) -> Reward | None:
    """The function itself, or that at ``module:name``; None for the usual reward."""
    if isinstance(reward, str):
        reward = found("reward", reward)
    if reward is None or callable(reward):
        return reward
    allowed = "a function of a training.active_env.Decision, or its 'module:name'"
    raise refusal("reward", reward, allowed, "give one, or leave it out for the usual reward")


def checked_reward(values: Any, n_lanes: int) -> np.ndarray:
    """A float64 copy of a reward's result (n_lanes,), if these are finite numbers."""
    allowed = f"finite numbers of shape ({n_lanes},)"
    remedy = "return one for each lane"
    try:
        numbers = np.array(values, np.float64)
    except (OverflowError, TypeError, ValueError):
        raise refusal("result of the reward", values, allowed, remedy) from None
    if numbers.shape != (n_lanes,):
        raise refusal("shape of the reward", numbers.shape, allowed, remedy)
    if not np.isfinite(numbers).all():
        raise refusal("result of the reward", numbers.tolist(), allowed, remedy)
    return numbers
