"""What is remembered of a session, as arrays: a minute of readings and beliefs, and what was done to the vehicle."""

from typing import NamedTuple

import numpy as np

from auv_fault_env.faults import NORMAL, classes
from diagnosers import Belief, decide

WINDOW = 60.0  # s that are remembered


class Mark(NamedTuple):
    """Something that a person did to the vehicle: when [s], and what."""

    time: float
    what: str


class History(NamedTuple):
    """The last samples, oldest first.

    Attributes
    ----------
    time
        Since the vehicle has set out [s], (n_samples,).
    observation
        (n_samples, n_channels), channels as in `CHANNELS`.
    belief
        Of the diagnoser, (n_samples, n_classes) each.
    alarm
        Whether the alarm stands, (n_samples,).
    true_speed
        (n_samples,) [m/s].
    marks
        What was done in that time.
    """

    time: np.ndarray
    observation: np.ndarray
    belief: Belief
    alarm: np.ndarray
    true_speed: np.ndarray
    marks: tuple[Mark, ...]

    @property
    def probability(self) -> np.ndarray:
        """Of every class, (n_samples, n_classes)."""
        return np.exp(self.belief.log_probability)

    @property
    def suspect(self) -> int:
        """Index of the class that is the likeliest fault now."""
        return 1 + int(self.belief.log_probability[-1, 1:].argmax())

    @property
    def verdict(self) -> str:
        """`normal` while no alarm stands, then the fault's class, or `unknown` if none has half of the suspicion."""
        if not self.alarm[-1]:
            return NORMAL
        return decide(Belief(*(part[-1:] for part in self.belief)), classes(), alarm=1.0)[0]

    def severity(self, index: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Mean of a class's severity if that is the fault, and its 95 % interval within 0 to 1, (n_samples,) each."""
        mean = self.belief.severity_mean[:, index]
        spread = 1.96 * self.belief.severity_std[:, index]
        return mean, np.clip(mean - spread, 0.0, 1.0), np.clip(mean + spread, 0.0, 1.0)

    def alarms(self) -> list[tuple[float, float]]:
        """Begin and end [s] of every alarm."""
        edges = np.flatnonzero(np.diff(self.alarm.astype(int), prepend=0, append=0))
        last = len(self.time) - 1
        return [
            (float(self.time[a]), float(self.time[min(b, last)])) for a, b in edges.reshape(-1, 2)
        ]
