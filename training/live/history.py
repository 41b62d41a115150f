"""The last minute of a session as arrays: readings, beliefs, and marks of faults and repairs."""

from typing import NamedTuple

import numpy as np

from auv_fault_env.faults import NORMAL, classes
from diagnosers import Belief, decide

WINDOW = 60.0  # s, length of the history


class Mark(NamedTuple):
    """What a person did to the vehicle: time [s], and `fault` or `repair`."""

    time: float
    action: str


class History(NamedTuple):
    """The last samples, oldest first: arrays with n_samples rows, and the marks of that time.

    `time` is since the start [s], `true_speed` in m/s, `alarm` whether the alarm stands.
    """

    time: np.ndarray
    observation: np.ndarray
    belief: Belief
    alarm: np.ndarray
    true_speed: np.ndarray
    marks: tuple[Mark, ...]

    @property
    def probability(self) -> np.ndarray:
        """Probability of every class, (n_samples, n_classes)."""
        return np.exp(self.belief.log_probability)

    @property
    def likeliest_fault(self) -> int:
        """Index of the class that is the likeliest fault now."""
        return 1 + int(self.belief.log_probability[-1, 1:].argmax())

    @property
    def verdict(self) -> str:
        """`normal` while no alarm stands, then the class of the fault.

        `unknown` if no class has half of the probability that is left beside `normal`.
        """
        if not self.alarm[-1]:
            return NORMAL
        now = Belief(*(values[-1:] for values in self.belief))
        return decide(now, classes(), alarm=1.0)[0]

    def severity(self, index: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Severity of a class if that is the fault: mean and 95 % interval, (n_samples,) each."""
        mean = self.belief.severity_mean[:, index]
        half_width = 1.96 * self.belief.severity_std[:, index]
        low = np.clip(mean - half_width, 0.0, 1.0)
        high = np.clip(mean + half_width, 0.0, 1.0)
        return mean, low, high

    def alarms(self) -> list[tuple[float, float]]:
        """Begin and end [s] of every alarm."""
        changes = np.diff(self.alarm.astype(int), prepend=0, append=0)
        edges = np.flatnonzero(changes).reshape(-1, 2)
        time = np.append(self.time, self.time[-1]).tolist()
        return [(time[begin], time[end]) for begin, end in edges]
