"""The interface of diagnosers, and the base classes of those of this package."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import asdict, dataclass, is_dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Protocol, runtime_checkable

import numpy as np

from auv_fault_env.channels import CHANNELS
from auv_fault_env.errors import refusal, whole_number
from auv_fault_env.faults import UNKNOWN, classes
from auv_fault_env.parameters import Vehicle, vehicle_of
from diagnosers import storage

# full scales beyond which no vehicle's sensor or command goes: such a value is no reading
ABSURD = 10.0
LARGEST_READING = np.array([ABSURD * max(-spec.low, spec.high) for spec in CHANNELS.values()])
IMPOSSIBLE = -1e30  # log probability of a class that cannot be: finite, also as float32


class Belief(NamedTuple):
    """The belief of a diagnoser after a sample, (n_lanes, n_classes) each.

    Class 0 is `normal`, the last one `unknown`: that no other class explains the readings.

    log_probability: natural logarithm, each row's probabilities sum to 1. severity_mean and
    severity_std: severity 0 to 1 *if* that class is the fault, and its standard deviation; both 0
    for `normal` and `unknown`. Multiply by the probability for the severity to expect.
    """

    log_probability: np.ndarray
    severity_mean: np.ndarray
    severity_std: np.ndarray


@runtime_checkable
class Diagnoser(Protocol):
    """From observations, one sample at a time, to beliefs; the same code on board and in a batch.

    A belief depends on the observations so far alone, never on the truth. An alarm is a threshold
    on the probability of `normal`, so its author should calibrate it.
    """

    classes: tuple[str, ...]

    def reset(self, n_lanes: int) -> None:
        """Start an episode of n_lanes vehicles; nothing remains of the last one."""

    def update(self, observation: np.ndarray) -> Belief:
        """The belief after the next observation (n_lanes, n_channels), in order of `CHANNELS`."""


@dataclass
class RunningState:
    """What a diagnoser remembers between two updates: everything about it that changes."""

    state: Any = None  # of the recursion, after the last sample
    # (n_lanes, n_channels), the last readings, missing ones filled; None before a `reset`
    observation: np.ndarray | None = None

    def require_reset(self, operation: str) -> None:
        """Refuse the operation before the first `reset`."""
        if self.observation is None:
            allowed = f"{operation} after a reset"
            raise refusal(operation, "no reset before", allowed, "call reset(n_lanes) first")


class Recursive(ABC):
    """A diagnoser as a pure recursion: `initial` is the first state, `step` leads to the next.

    A subclass defines these two, and is a frozen dataclass if it has settings: only `running`
    changes. NaN in a channel means that no reading arrived, and so does a value beyond
    `LARGEST_READING`, as infinity is; the last one takes its place (zero before the first), but not
    in channels outside `filled_channels`, whose gaps the diagnoser handles itself. The zeros of a
    disconnected sensor pass as they are.
    """

    name: str
    filled_channels: ClassVar[slice] = slice(None)

    @cached_property
    def running(self) -> RunningState:
        """The memory of the present episode."""
        return RunningState()

    @cached_property
    def classes(self) -> tuple[str, ...]:
        """The classes of its beliefs, `auv_fault_env.classes()` as they are at the first use."""
        return classes()

    @property
    def known_classes(self) -> tuple[str, ...]:
        """The classes of its beliefs but `unknown`, which is the last one."""
        return self.classes[:-1]

    @cached_property
    def labels(self) -> Mapping[str, str | None]:
        """The label of every class; classes with one label, or with None, it cannot separate."""
        return {name: name for name in self.classes}

    @abstractmethod
    def initial(self, n_lanes: int) -> Any:
        """The state before any observation: a (nested) tuple of arrays, lane first."""

    @abstractmethod
    def step(self, state: Any, observation: np.ndarray) -> tuple[Any, Belief]:
        """The next state and the belief, from a finite float64 observation (n_lanes, n_channels).

        It changes neither state nor observation.
        """

    def reset(self, n_lanes: int) -> None:
        """Start an episode of n_lanes vehicles; nothing remains of the last one."""
        n_lanes = whole_number("number of lanes", n_lanes)
        self.running.state = self.initial(n_lanes)
        self.running.observation = np.zeros((n_lanes, len(CHANNELS)))

    def update(self, observation: np.ndarray) -> Belief:
        """The belief after the next observation (n_lanes, n_channels), in order of `CHANNELS`.

        Raises `ValueError` for another shape, and before the first `reset`.
        """
        running = self.running
        running.require_reset("update")
        observation = fill_missing(observation, running.observation, self.filled_channels)
        running.state, belief = self.step(running.state, observation)
        running.observation = observation
        return belief

    def tensors(self) -> dict[str, np.ndarray]:
        """The weights by name; empty if there are none."""
        return {}

    def settings(self) -> dict[str, Any]:
        """The arguments that make an equal one, as plain data."""
        return asdict(self) if is_dataclass(self) else {}

    def save(self, path: str | Path) -> None:
        """Write weights and settings, not the running state, to a file for `diagnosers.load`."""
        storage.write(
            path,
            self.tensors(),
            {"diagnoser": self.name, "settings": self.settings()},
        )


class Memoryless(Recursive):
    """A diagnoser whose belief depends on the last observation alone."""

    def initial(self, n_lanes: int) -> tuple[()]:
        """No state."""
        return ()


@dataclass(frozen=True)
class ModelBased(Recursive):
    """A recursion with the equations of a nominal vehicle of two shafts, a name or a `Vehicle`."""

    vehicle: str | Vehicle = "thesis1992"

    def __post_init__(self):
        two_shaft_vehicle(self.vehicle)

    @cached_property
    def _nominal(self) -> Vehicle:
        return vehicle_of(self.vehicle)


def two_shaft_vehicle(preset: str | Vehicle) -> Vehicle:
    """The vehicle of that preset, or the `Vehicle`; one with a single shaft is refused.

    For diagnosers that compare the shafts, or were trained on two.
    """
    vehicle = vehicle_of(preset)
    if vehicle.shafts == 1:
        remedy = "take filter_bank or gaussian_bank"
        raise refusal("shafts", vehicle.shafts, "2 for this diagnoser", remedy)
    return vehicle


def same_severity(shape: tuple[int, int], mean: float, std: float) -> tuple[np.ndarray, np.ndarray]:
    """Means and standard deviations (n_lanes, n_classes), the same for every fault."""
    severities = np.full(shape, mean), np.full(shape, std)
    for values in severities:
        values[:, 0] = 0.0
    return severities


def join_odds(log_odds: np.ndarray, scores: np.ndarray) -> np.ndarray:
    """Log probabilities (n_lanes, n_classes) from log odds of a fault (n_lanes, 1) and scores.

    The faults share their probability by exp(scores), (n_lanes, n_faults), of which the largest of
    each lane is 0.
    """
    total = np.exp(scores).sum(axis=1, keepdims=True)
    faults = scores - (np.log(total) + np.logaddexp(0.0, -log_odds))
    return np.hstack([-np.logaddexp(0.0, log_odds), faults])


def with_impossible_unknown(belief: Belief) -> Belief:
    """A belief over the known classes, with `unknown` of probability 0 as the last class.

    For diagnosers that cannot know whether their classes explain the readings.
    """
    ends = (IMPOSSIBLE, 0.0, 0.0)
    columns = [np.full((len(values), 1), end) for values, end in zip(belief, ends, strict=True)]
    return Belief(*map(np.hstack, zip(belief, columns, strict=True)))


def fill_missing(
    observation: np.ndarray, previous: np.ndarray, channels: slice = slice(None)
) -> np.ndarray:
    """A float64 copy of the observation, with the last readings where these channels have none.

    None is NaN, and what is beyond `LARGEST_READING`: it becomes NaN in the other channels.
    """
    try:
        observation = np.array(observation, np.float64, order="C")
    except (TypeError, ValueError):
        allowed = f"numbers of shape {previous.shape}"
        raise refusal("observation", observation, allowed, "give one row per lane") from None
    if observation.shape != previous.shape:
        remedy = "give one row per lane of the reset"
        raise refusal("observation's shape", observation.shape, f"{previous.shape}", remedy)
    observation[np.abs(observation) > LARGEST_READING] = np.nan
    missing = np.isnan(observation[:, channels])
    np.copyto(observation[:, channels], previous[:, channels], where=missing)
    return observation


def last_values(rows: np.ndarray) -> np.ndarray:
    """Each gap of (n_rows, n_columns) replaced by the last value above it, where there is one."""
    index = np.where(np.isfinite(rows), np.arange(len(rows))[:, None], 0)
    return np.take_along_axis(rows, np.maximum.accumulate(index, axis=0), axis=0)


def decide(
    belief: Belief, classes: tuple[str, ...], alarm: float = 0.5, name: float = 0.5
) -> list[str]:
    """The decision on every lane: `normal`, a class, or `unknown`.

    There is a fault where the probability of `normal` is below `alarm`; it is that of a class with
    at least the share `name` of the probability of all faults. It is unknown if that class is
    `unknown`, or if no class has that share: the fault is not isolated.
    """
    probability = np.exp(belief.log_probability)
    faults = probability[:, 1:]
    total = np.maximum(faults.sum(axis=1), np.finfo(float).tiny)
    is_isolated = faults.max(axis=1) / total >= name
    is_normal = probability[:, 0] >= alarm
    best = np.array(classes[1:], dtype=object)[faults.argmax(axis=1)]
    return np.where(is_normal, classes[0], np.where(is_isolated, best, UNKNOWN)).tolist()
