"""Diagnosers written for the DX competitions, which take one sample and know no lanes, as diagnosers of ours."""

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np

from auv_fault_env.channels import CHANNELS
from auv_fault_env.errors import known_name, refusal, whole_number
from auv_fault_env.faults import classes
from auv_fault_env.parameters import SAMPLE_TIME
from diagnosers.diagnoser import UNKNOWN, Belief, fill_missing, same_severity
from diagnosers.networks.modes import PRIOR_SEVERITY

LEAST_PROBABILITY = (
    1e-9  # left to normal where a fault is detected for certain, and to faults where none is
)


class SampleSystem(Protocol):
    """The interface of the LiU-ICE competitions (Safeprocess 2024, DX 2025), one vehicle each.

    Optional besides `Input`: a method `Initialize()`, called once before the first sample, and
    `faults`, the names of the columns of the isolation, each one of `auv_fault_env.classes()`
    without normal or "unknown" (their f_x), in any order. Without `faults` the columns are all the
    fault classes in the order of `classes()`.
    """

    def Input(self, sample: Any) -> tuple[Any, Any]:
        """Detection (0 or 1, or the probability of a fault) and isolation, the shares of the faults, from one sample.

        The sample is a pandas data frame of one row with the column `time` [s] and those of
        `CHANNELS`, in their units.
        """
        ...


class SampleAdapter:
    """A diagnoser made of one `SampleSystem` per lane.

    The probability of normal is one minus the detection, however sure the isolation is of a fault:
    the isolation says which fault it is *if* there is one. It is scaled to a sum of one; where it
    is all zeros, as the competitions demand while nothing is detected, it counts as unknown. What
    is unknown is spread evenly over the fault classes without a column of their own, or over all of
    them if each has one. No severities are told: 0.6 ± 0.23 throughout.

    Slow: a Python call and a data frame per lane and sample, some 20 µs besides the system itself.
    Misleads: a detection of 0 or 1 leaves the alarm threshold no room, so the system stands or
    falls with its own rate of false alarms; one that gives probabilities can be set to any rate.

    Raises `InputError` where a system breaks the interface, and where pandas is not installed.
    """

    def __init__(self, system: Callable[[], SampleSystem]) -> None:
        self.system = system
        self.classes = classes()
        self._spread = _spread(self.classes, getattr(system(), "faults", self.classes[1:]))

    def reset(self, n_lanes: int) -> None:
        """Make and initialise a system for each lane."""
        self._systems = [
            _started(self.system()) for _ in range(whole_number("number of lanes", n_lanes))
        ]
        self._held = np.zeros((n_lanes, len(CHANNELS)))
        self._sample = 0

    def update(self, observation: np.ndarray) -> Belief:
        """The belief after the next observation (n_lanes, n_channels); a silent channel (NaN) keeps its reading."""
        if not hasattr(self, "_systems"):
            raise refusal(
                "update", "no reset before", "an update after a reset", "call reset(n_lanes) first"
            )
        self._held = fill_missing(observation, self._held)
        frames = _frames(self._sample * SAMPLE_TIME, self._held)
        answers = [
            self._answer(system, frame) for system, frame in zip(self._systems, frames, strict=True)
        ]
        self._sample += 1
        detection, isolation = (np.array(part) for part in zip(*answers, strict=True))
        probability = np.column_stack([1.0 - detection, detection[:, None] * isolation])
        with np.errstate(divide="ignore"):
            log_probability = np.maximum(np.log(probability), -100.0)
        return Belief(log_probability, *same_severity(probability.shape, *PRIOR_SEVERITY))

    def _answer(self, system: SampleSystem, frame: Any) -> tuple[float, np.ndarray]:
        """Probability of a fault, and of each fault class (n_faults,) if there is one."""
        detection, isolation = (
            np.asarray(part, np.float64).ravel() for part in system.Input(frame)
        )
        if detection.shape != (1,) or not 0.0 <= detection[0] <= 1.0:
            raise refusal("detection", detection, "0 to 1", "give False, True or a probability")
        n_columns = len(self._spread) - 1
        if isolation.shape != (n_columns,) or not (
            np.isfinite(isolation).all() and (isolation >= 0.0).all()
        ):
            raise refusal(
                "isolation",
                isolation,
                f"{n_columns} numbers from 0",
                "give one for each name in `faults`",
            )
        shares = np.append(isolation, float(not isolation.any()))
        return float(
            np.clip(detection[0], LEAST_PROBABILITY, 1.0 - LEAST_PROBABILITY)
        ), shares / shares.sum() @ self._spread


def _spread(names: Sequence[str], columns: Sequence[str]) -> np.ndarray:
    """Which fault classes a column stands for, (n_columns + 1, n_faults), rows sum to 1; the last is unknown."""
    faults = list(names[1:])
    columns = [known_name("name in `faults`", column, [*faults, UNKNOWN]) for column in columns]
    if len(set(columns)) < len(columns):
        raise refusal("`faults`", tuple(columns), "different names", "name each once")
    untold = np.array([fault not in columns for fault in faults], float)
    unknown = (untold if untold.any() else np.ones(len(faults))) / (untold.sum() or len(faults))
    rows = [
        unknown if column == UNKNOWN else np.eye(len(faults))[faults.index(column)]
        for column in columns
    ]
    return np.array([*rows, unknown])


def _started(system: SampleSystem) -> SampleSystem:
    if hasattr(system, "Initialize"):
        system.Initialize()
    return system


def _frames(time: float, observation: np.ndarray) -> list[Any]:
    """A data frame of one row per lane."""
    try:
        from pandas import DataFrame, Index
    except ImportError:
        raise refusal(
            "pandas", "not installed", "pandas for DX-style diagnosers", "pip install pandas"
        ) from None
    columns = Index(["time", *CHANNELS])  # made once: it takes longer than all the rest
    rows = np.column_stack([np.full(len(observation), time), observation])
    return [DataFrame(row[None].copy(), columns=columns) for row in rows]
