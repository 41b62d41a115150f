"""A diagnoser and the parameter filter over many lanes, each of which may start a new episode."""

from typing import Any, NamedTuple

import numpy as np

from auv_fault_env.errors import refusal
from diagnosers import Belief, Recursive
from diagnosers.kalman import Estimate, ParameterFilter


class MonitorState(NamedTuple):
    """State and belief of the diagnoser, and estimate of the parameter filter; lanes first."""

    diagnoser: Any
    belief: Belief
    estimate: Estimate


class LaneMonitor:
    """What is believed and estimated of every lane after its last sample."""

    def __init__(self, diagnoser: Recursive):
        if not isinstance(diagnoser, Recursive):
            allowed = "a diagnoser that is `Recursive`, so that single lanes can start anew"
            remedy = "subclass diagnosers.Recursive"
            raise refusal("diagnoser", type(diagnoser).__name__, allowed, remedy)
        self._diagnoser = diagnoser
        self._filter = ParameterFilter()
        self._state: MonitorState | None = None

    @property
    def belief(self) -> Belief:
        """Of the diagnoser."""
        return self._state.belief

    @property
    def estimate(self) -> Estimate:
        """Of the parameter filter: drag and thrust relative to nominal, with their covariance."""
        return self._state.estimate

    def reset(self, lanes: np.ndarray, observation: np.ndarray) -> None:
        """Start the chosen lanes (n_chosen,) anew, all at the first call, with their first sample.

        ``observation`` is that of all lanes, (n_lanes, n_channels).
        """
        state = self._diagnoser.initial(lanes.size)
        fresh = self._after(state, self._filter.initial(lanes.size), observation[lanes])
        is_first = self._state is None
        self._state = fresh if is_first else with_fresh_lanes(self._state, lanes, fresh)

    def update(self, observation: np.ndarray) -> None:
        """Take the next sample of every lane, (n_lanes, n_channels)."""
        self._state = self._after(self._state.diagnoser, self._state.estimate, observation)

    def _after(self, state: Any, estimate: Estimate, observation: np.ndarray) -> MonitorState:
        observation = np.asarray(observation, np.float64)
        state, belief = self._diagnoser.step(state, observation)
        return MonitorState(state, belief, self._filter.update(estimate, observation))


def with_fresh_lanes(state: Any, lanes: np.ndarray, fresh: Any) -> Any:
    """The state with the chosen lanes (n_chosen,) taken from a fresh one.

    Both are nested tuples of arrays with the lane first.
    """
    if isinstance(state, tuple):
        pairs = zip(state, fresh, strict=True)
        parts = [with_fresh_lanes(old, lanes, new) for old, new in pairs]
        return type(state)(*parts) if hasattr(state, "_fields") else tuple(parts)
    state = state.copy()
    state[lanes] = fresh
    return state
