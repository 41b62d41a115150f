"""A diagnoser and the thesis' parameter filter over many vehicles, any of which may start a new episode by itself."""

from typing import Any

import numpy as np

from auv_fault_env.errors import refusal
from diagnosers import Belief, Recursive
from diagnosers.kalman import Estimate, ParameterFilter


def replaced(state: Any, lanes: np.ndarray, fresh: Any) -> Any:
    """The state, a nested tuple of arrays with the lane first, with the chosen lanes (m,) taken from a fresh one."""
    if isinstance(state, tuple):
        parts = [replaced(old, lanes, new) for old, new in zip(state, fresh, strict=True)]
        return type(state)(*parts) if hasattr(state, "_fields") else tuple(parts)
    state = state.copy()
    state[lanes] = fresh
    return state


class Watch:
    """What is believed of every lane after its last sample.

    Attributes
    ----------
    belief
        Of the diagnoser.
    estimate
        Of the parameter filter: drag and thrust relative to nominal, with their covariance.
    """

    belief: Belief
    estimate: Estimate

    def __init__(self, diagnoser: Recursive):
        if not isinstance(diagnoser, Recursive):
            allowed = "a diagnoser that is `Recursive`, so that single lanes can start anew"
            raise refusal(
                "diagnoser", type(diagnoser).__name__, allowed, "subclass diagnosers.Recursive"
            )
        self._diagnoser = diagnoser
        self._filter = ParameterFilter()
        self._known: tuple | None = None

    def begin(self, lanes: np.ndarray, observation: np.ndarray) -> None:
        """Forget the chosen lanes (m,), all at the first call, and read their first sample (n_lanes, n_channels)."""
        first = np.asarray(observation[lanes], np.float64)
        start = self._diagnoser.initial(lanes.size), self._filter.initial(lanes.size)
        fresh = self._after(start, first)
        self._set(fresh if self._known is None else replaced(self._known, lanes, fresh))

    def update(self, observation: np.ndarray) -> None:
        """Read the next sample of every lane, (n_lanes, n_channels)."""
        state, _, estimate = self._known
        self._set(self._after((state, estimate), np.asarray(observation, np.float64)))

    def _after(
        self, before: tuple[Any, Estimate], observation: np.ndarray
    ) -> tuple[Any, Belief, Estimate]:
        state, belief = self._diagnoser.step(before[0], observation)
        return state, belief, self._filter.update(before[1], observation)

    def _set(self, known: tuple[Any, Belief, Estimate]) -> None:
        self._known = known
        _, self.belief, self.estimate = known
