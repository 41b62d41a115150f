"""What a diagnoser is: readings in, one sample at a time; a belief over the fault classes and their severities out.

`Diagnoser` is the protocol that everything downstream relies on. `Recursive` carries what the
diagnosers of this package share: they are written as pure functions of a state, and the state is
arrays with the lane first.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Protocol, runtime_checkable

import numpy as np

from auv_fault_env.channels import CHANNELS
from auv_fault_env.errors import refusal, whole_number
from auv_fault_env.faults import classes
from diagnosers import storage

UNKNOWN = "unknown"


class Belief(NamedTuple):
    """What a diagnoser believes after a sample; class 0 is `normal`.

    log_probability (n_lanes, n_classes): natural logarithm, each row's probabilities sum to 1.
    severity_mean and severity_std (n_lanes, n_classes): severity 0 to 1 *if* that class is the
    fault, and its standard deviation; both 0 for `normal`. Multiply by the probability for the
    severity to expect.
    """

    log_probability: np.ndarray
    severity_mean: np.ndarray
    severity_std: np.ndarray


@runtime_checkable
class Diagnoser(Protocol):
    """Reads observations one sample at a time and says what it believes; the same code onboard and in a batch.

    It is causal: a belief depends on the observations so far and on nothing else, never on the
    truth. Calibration is its author's duty: a threshold on the probability of `normal` is all that
    an alarm looks at.
    """

    classes: tuple[str, ...]

    def reset(self, n_lanes: int) -> None:
        """Forget everything and get ready for n_lanes vehicles at the start of an episode."""
        ...

    def update(self, observation: np.ndarray) -> Belief:
        """The belief after the next observation (n_lanes, n_channels), 0.1 s later, channels as in `CHANNELS`."""
        ...


class Recursive(ABC):
    """A diagnoser as a pure recursion: `initial` makes a state, `step` takes state and observation to the next.

    A subclass gives these two, and is a frozen dataclass if it has settings. A channel may be
    silent: NaN means no reading, and the last one is held (zero before the first), but for channels
    that are not in `held`: these silences are the diagnoser's to understand. The values of a
    disconnected sensor (zeros) pass as they are.
    """

    name: str
    held: ClassVar[slice] = slice(None)  # of the channels

    @property
    def classes(self) -> tuple[str, ...]:
        """The diagnosis classes of its beliefs, `normal` first."""
        return classes()

    @property
    def labels(self) -> Mapping[str, str | None]:
        """For every class what the diagnoser can tell of it: classes of one label look alike to it, None is unknown."""
        return {name: name for name in self.classes}

    @abstractmethod
    def initial(self, n_lanes: int) -> Any:
        """The state before any observation: a (nested) tuple of arrays, lane first."""

    @abstractmethod
    def step(self, state: Any, observation: np.ndarray) -> tuple[Any, Belief]:
        """The next state and the belief; observation is (n_lanes, n_channels) float64, finite. Changes neither."""

    def reset(self, n_lanes: int) -> None:
        """Forget everything and get ready for n_lanes vehicles at the start of an episode."""
        n_lanes = whole_number("number of lanes", n_lanes)
        self.__dict__["_state"] = self.initial(n_lanes), np.zeros((n_lanes, len(CHANNELS)))

    def update(self, observation: np.ndarray) -> Belief:
        """The belief after the next observation (n_lanes, n_channels), 0.1 s later, channels as in `CHANNELS`.

        Raises `ValueError` for another shape, for infinite readings, and before the first `reset`.
        """
        if "_state" not in self.__dict__:
            raise refusal(
                "update", "no reset before", "an update after a reset", "call reset(n_lanes) first"
            )
        state, held = self.__dict__["_state"]
        observation = fill_missing(observation, held, self.held)
        state, belief = self.step(state, observation)
        self.__dict__["_state"] = state, observation
        return belief

    def tensors(self) -> dict[str, np.ndarray]:
        """What it has learnt, by name; empty if it learns nothing."""
        return {}

    def settings(self) -> dict[str, Any]:
        """The arguments that make an equal one, as plain data."""
        return asdict(self) if is_dataclass(self) else {}

    def save(self, path: str | Path) -> None:
        """Write what `diagnosers.load` needs to make an equal one, not its running state, to a safetensors file."""
        storage.write(path, self.tensors(), {"diagnoser": self.name, "settings": self.settings()})


def same_severity(shape: tuple[int, int], mean: float, std: float) -> tuple[np.ndarray, np.ndarray]:
    """Severities of a belief (n_lanes, n_classes), means and standard deviations: the same for every fault."""
    severities = np.full(shape, mean), np.full(shape, std)
    for values in severities:
        values[:, 0] = 0.0
    return severities


def fill_missing(
    observation: np.ndarray, held: np.ndarray, channels: slice = slice(None)
) -> np.ndarray:
    """The observation as a float64 copy of its own, with held values where these channels have no reading."""
    try:
        observation = np.array(observation, np.float64, order="C")
    except (TypeError, ValueError):
        raise refusal(
            "observation", observation, f"numbers of shape {held.shape}", "give one row per lane"
        ) from None
    if observation.shape != held.shape:
        raise refusal(
            "observation's shape",
            observation.shape,
            f"{held.shape}",
            "give one row per lane of the reset",
        )
    silent = np.isnan(observation[:, channels])
    np.copyto(observation[:, channels], held[:, channels], where=silent)
    if np.isinf(observation).any():
        raise refusal(
            "observation", "infinity", "finite readings, NaN for none", "mend the reading"
        )
    return observation


def decide(
    belief: Belief, classes: tuple[str, ...], alarm: float = 0.5, name: float = 0.5
) -> list[str]:
    """One word per lane: `normal`, a class, or `unknown`, a fault that looks like none of the classes, or like several.

    Parameters
    ----------
    belief
        The belief.
    classes
        Its classes.
    alarm
        A fault is declared where the probability of `normal` is below this.
    name
        The fault is named where its class has at least this share of the probability of all faults.
    """
    probability = np.exp(belief.log_probability)
    faults = probability[:, 1:]
    best = faults.argmax(axis=1)
    total = np.maximum(faults.sum(axis=1), np.finfo(float).tiny)
    named = faults.max(axis=1) / total >= name
    quiet = probability[:, 0] >= alarm
    words = np.where(named, np.array(classes[1:], dtype=object)[best], UNKNOWN)
    return np.where(quiet, classes[0], words).tolist()
