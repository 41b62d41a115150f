"""Adapter for diagnosers of the DX competitions, which take one sample of one vehicle."""

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np

from auv_fault_env.channels import CHANNELS
from auv_fault_env.errors import known_name, refusal, whole_number
from auv_fault_env.faults import classes
from auv_fault_env.parameters import SAMPLE_TIME
from diagnosers.diagnoser import UNKNOWN, Belief, fill_missing, same_severity
from diagnosers.networks.modes import PRIOR_SEVERITY

LEAST_PROBABILITY = 1e-9  # of normal and of all faults, where the system is certain


class SampleSystem(Protocol):
    """The interface of the LiU-ICE competitions (Safeprocess 2024, DX 2025), one vehicle each.

    Optional: a method `Initialize()`, called before the first sample, and `faults`, the columns of
    the isolation in any order, fault classes or "unknown" (their f_x); else all in their order.
    """

    def Input(self, sample: Any) -> tuple[Any, Any]:
        """Detection, 0 or 1 or the probability of a fault, and isolation, the shares of the faults.

        The sample is a pandas data frame of one row with the column `time` [s] and those of
        `CHANNELS`, in their units.
        """


class SampleAdapter:
    """A diagnoser made of one `SampleSystem` per lane.

    The probability of normal is one minus the detection; the isolation is the probability of each
    fault *if* there is one, scaled to a sum of one. Where it is all zeros, as the competitions
    require while nothing is detected, the fault is `unknown`. The severity is 0.6 ± 0.23
    throughout.

    Misleads: no threshold changes the false alarm rate of a system whose detection is 0 or 1.
    Raises `InputError` where a system breaks the interface, and where pandas is not installed.
    """

    def __init__(self, system: Callable[[], SampleSystem]) -> None:
        self.system = system
        self.classes = classes()
        columns = getattr(system(), "faults", self.classes[1:-1])
        self._shares_of_columns = _fault_shares(self.classes[1:], columns)

    def reset(self, n_lanes: int) -> None:
        """Make and initialise a system for each lane."""
        n_lanes = whole_number("number of lanes", n_lanes)
        self._systems = [self.system() for _ in range(n_lanes)]
        for system in self._systems:
            if hasattr(system, "Initialize"):
                system.Initialize()
        self._readings = np.zeros((n_lanes, len(CHANNELS)))
        self._sample = 0

    def update(self, observation: np.ndarray) -> Belief:
        """The belief after the next observation (n_lanes, n_channels), NaN where one is missing."""
        if not hasattr(self, "_systems"):
            allowed = "an update after a reset"
            raise refusal("update", "no reset before", allowed, "call reset(n_lanes) first")
        self._readings = fill_missing(observation, self._readings)
        frames = _frames(self._sample * SAMPLE_TIME, self._readings)
        answers = map(self._answer, self._systems, frames)
        detection, isolation = map(np.array, zip(*answers, strict=True))
        self._sample += 1
        probability = np.column_stack([1.0 - detection, detection[:, None] * isolation])
        with np.errstate(divide="ignore"):
            log_probability = np.maximum(np.log(probability), -100.0)
        severity = same_severity(probability.shape, *PRIOR_SEVERITY)
        for values in severity:
            values[:, -1] = 0.0
        return Belief(log_probability, *severity)

    def _answer(self, system: SampleSystem, frame: Any) -> tuple[float, np.ndarray]:
        """Probability of a fault, and of each class (n_classes - 1,) if there is one."""
        answer = system.Input(frame)
        detection, isolation = (np.asarray(part, np.float64).ravel() for part in answer)
        if detection.shape != (1,) or not 0.0 <= detection[0] <= 1.0:
            raise refusal("detection", detection, "0 to 1", "give False, True or a probability")
        n_columns = len(self._shares_of_columns) - 1
        is_valid = (np.isfinite(isolation) & (isolation >= 0.0)).all()
        if isolation.shape != (n_columns,) or not is_valid:
            allowed = f"{n_columns} numbers from 0"
            raise refusal("isolation", isolation, allowed, "give one for each name in `faults`")
        shares = np.append(isolation, float(not isolation.any()))
        probability = np.clip(detection[0], LEAST_PROBABILITY, 1.0 - LEAST_PROBABILITY)
        return float(probability), shares / shares.sum() @ self._shares_of_columns


def _fault_shares(names: Sequence[str], columns: Sequence[str]) -> np.ndarray:
    """The share of each class but normal in every column and in unknown, (n_columns + 1, n)."""
    columns = [known_name("name in `faults`", column, names) for column in columns]
    if len(set(columns)) < len(columns):
        raise refusal("`faults`", tuple(columns), "different names", "name each once")
    shares = dict(zip(names, np.eye(len(names)), strict=True))
    return np.array([shares[column] for column in (*columns, UNKNOWN)])


def _frames(time: float, observation: np.ndarray) -> list[Any]:
    """A data frame of one row per lane."""
    try:
        from pandas import DataFrame, Index
    except ImportError:
        allowed = "pandas for DX-style diagnosers"
        raise refusal("pandas", "not installed", allowed, "pip install pandas") from None
    columns = Index(["time", *CHANNELS])  # made once: it takes longer than all the rest
    rows = np.column_stack([np.full(len(observation), time), observation])
    return [DataFrame(row[None].copy(), columns=columns) for row in rows]
