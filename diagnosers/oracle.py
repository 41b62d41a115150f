"""A reference, not a competitor: the Gaussian bank that is given the true vehicle and severity."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from auv_fault_env.errors import refusal
from auv_fault_env.parameters import PARAMETERS
from diagnosers.bank.kernel import BankState
from diagnosers.diagnoser import Belief, RunningState
from diagnosers.gaussian_bank import GaussianBank

CERTAIN = 1e-4  # width of the band, in healthy bands, around the true vehicle


@dataclass
class ToldState(RunningState):
    """The memory of the present episode, and what the oracle is told of it."""

    severity: np.ndarray | None = None  # (n_samples, n_lanes), None if it is not told
    n_updates: int = 0  # since the severities were told


@dataclass(frozen=True)
class Oracle(GaussianBank):
    """The Gaussian bank, given the true healthy vehicle of each lane and perhaps the severity.

    The distance of a diagnoser from it is the loss because the vehicle is unknown; what it cannot
    distinguish, the readings do not. Without the truth it is the Gaussian bank.

    When it misleads: a severity that changes tells it when the fault begins; it assumes that any
    fault would have the severity of the true one; and it is no upper bound for a diagnoser that
    uses more than the bank's model, such as the controllers' commands.
    """

    name = "oracle"

    @cached_property
    def running(self) -> ToldState:
        """The memory of the present episode."""
        return ToldState()

    def reset(self, n_lanes: int) -> None:
        """Start an episode of n_lanes vehicles, of which nothing is known."""
        super().reset(n_lanes)
        self.running.severity = None

    def set_truth(self, healthy: np.ndarray, severity: np.ndarray | None = None) -> None:
        """Set the truth of every lane after a `reset`, until the next one.

        Parameters
        ----------
        healthy
            (n_lanes, n_parameters), ordered as `PARAMETERS`, in their units.
        severity
            (n_samples, n_lanes), severity of the fault at each of the next samples, 0 to 1, or
            (n_lanes,) if it stays the same; the last row stays. None leaves the grades.
        """
        running = self.running
        running.require_reset("set_truth")
        n_lanes = len(running.observation)
        healthy = _finite("healthy parameters", healthy, (n_lanes, len(PARAMETERS)))
        prior = running.state.prior
        running.severity = None
        if severity is not None:
            severity = np.atleast_2d(np.asarray(severity, np.float64))
            severity = _finite("severities", severity, (len(severity), n_lanes))
            if severity.min() < 0.0 or severity.max() > 1.0:
                raise refusal("severities", severity, "numbers from 0 to 1", "give fractions")
            running.severity = severity
            running.n_updates = 0
            prior = _certain_prior(severity[0])
        running.state = self._state_around(healthy, prior, CERTAIN)

    def update(self, observation: np.ndarray) -> Belief:
        """The belief after the next observation (n_lanes, n_channels), in order of `CHANNELS`."""
        running = self.running
        if running.severity is not None:
            row = min(running.n_updates, len(running.severity) - 1)
            running.state = _with_severity(running.state, running.severity[row])
            running.n_updates += 1
        return super().update(observation)


def _certain_prior(severity: np.ndarray) -> np.ndarray:
    """Prior of one grade with the severity of each lane (n_lanes,), as in `BankState`."""
    certain = np.stack([severity, np.zeros(len(severity)), severity], axis=1)
    return certain[:, :, None]


def _with_severity(state: BankState, severity: np.ndarray) -> BankState:
    """The state if every faulty hypothesis has exactly the severity of its lane, (n_lanes,)."""
    of_hypotheses = np.zeros_like(state.severity)
    of_hypotheses[:, 0, 1:] = severity[:, None]
    return state._replace(severity=of_hypotheses, prior=_certain_prior(severity))


def _finite(thing: str, values: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """A float64 copy of the values if they are finite numbers of that shape, else a refusal."""
    values = np.array(values, np.float64)
    if values.shape != shape or not np.isfinite(values).all():
        allowed = f"finite numbers of shape {shape}"
        raise refusal(thing, values.shape, allowed, "give one row per lane")
    return values
