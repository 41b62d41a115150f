"""The beliefs of many lanes, each of which may start a new episode at any sample."""

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from auv_fault_env.errors import refusal
from auv_fault_env.faults import classes
from diagnosers import Belief, Diagnoser, Recursive
from training.metrics import class_order
from training.metrics.records import belief_error


class Beliefs(Protocol):
    """What is believed of every lane after its last sample."""

    belief: Belief  # classes in the order of `auv_fault_env.classes()`

    def reset(self, lanes: np.ndarray, observation: np.ndarray) -> None:
        """Start the chosen lanes (n_chosen,) anew, all at the first call, with their first sample.

        ``observation`` is that of all lanes, float64 (n_lanes, n_channels).
        """

    def update(self, observation: np.ndarray) -> None:
        """Take the next sample of every lane, float64 (n_lanes, n_channels)."""


def beliefs_of(diagnosers: Sequence[Diagnoser]) -> Beliefs:
    """Of one diagnoser for all lanes, which is `Recursive`, or of one for each lane."""
    first = diagnosers[0]
    return Batch(first) if isinstance(first, Recursive) else OneForEach(diagnosers)


class _Order:
    """Checks the beliefs of a diagnoser, and brings them into the order of `classes()`."""

    def __init__(self, diagnoser: Diagnoser):
        self._name = type(diagnoser).__name__
        columns = class_order(diagnoser.classes, classes())
        self._n_classes = columns.size
        is_same = np.array_equal(columns, np.arange(columns.size))
        self._columns = None if is_same else columns

    def __call__(self, belief: Any, n_lanes: int) -> Belief:
        error = belief_error(belief, (n_lanes, self._n_classes))
        if error:
            allowed = f"a finite Belief of shape ({n_lanes}, {self._n_classes}) that sums to 1"
            remedy = "find the mistake with diagnosers.check_diagnoser"
            raise refusal(f"belief of {self._name}", error.rstrip(","), allowed, remedy)
        if self._columns is None:
            return Belief(*belief)
        return Belief(*(np.asarray(values)[:, self._columns] for values in belief))


class _BatchState(NamedTuple):
    """Lanes first."""

    recursion: Any
    belief: Belief


class Batch:
    """The beliefs of one recursion over all lanes, a state of which lanes are replaced."""

    def __init__(self, diagnoser: Recursive):
        self._diagnoser = diagnoser
        self._ordered = _Order(diagnoser)
        self._state: _BatchState | None = None

    @property
    def belief(self) -> Belief:
        """After the last sample."""
        return self._state.belief

    def reset(self, lanes: np.ndarray, observation: np.ndarray) -> None:
        """As `Beliefs`."""
        fresh = self._after(self._diagnoser.initial(lanes.size), observation[lanes])
        is_first = self._state is None
        self._state = fresh if is_first else with_fresh_lanes(self._state, lanes, fresh)

    def update(self, observation: np.ndarray) -> None:
        """As `Beliefs`."""
        self._state = self._after(self._state.recursion, observation)

    def _after(self, state: Any, observation: np.ndarray) -> _BatchState:
        state, belief = self._diagnoser.step(state, observation)
        return _BatchState(state, self._ordered(belief, len(observation)))


class OneForEach:
    """The beliefs of one diagnoser for each lane, which is reset with it."""

    def __init__(self, diagnosers: Sequence[Diagnoser]):
        self._diagnosers = diagnosers
        self._ordered = _Order(diagnosers[0])
        shape = len(diagnosers), len(classes())
        self.belief = Belief(*(np.zeros(shape) for _ in Belief._fields))

    def reset(self, lanes: np.ndarray, observation: np.ndarray) -> None:
        """As `Beliefs`."""
        for lane in lanes.tolist():
            self._diagnosers[lane].reset(1)
        self._take(lanes, observation)

    def update(self, observation: np.ndarray) -> None:
        """As `Beliefs`."""
        self._take(np.arange(len(self._diagnosers)), observation)

    def _take(self, lanes: np.ndarray, observation: np.ndarray) -> None:
        belief = Belief(*(values.copy() for values in self.belief))
        for lane in lanes.tolist():
            # a copy, so that a diagnoser cannot change what others read
            update = self._diagnosers[lane].update(observation[[lane]])
            for values, row in zip(belief, self._ordered(update, 1), strict=True):
                values[lane] = row[0]
        self.belief = belief


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
