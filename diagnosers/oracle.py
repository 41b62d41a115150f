"""A reference, not a competitor: the filter bank that is given the true vehicle and severity."""

from dataclasses import dataclass

import numpy as np

from auv_fault_env.errors import refusal
from auv_fault_env.parameters import PARAMETERS
from diagnosers.filter_bank import FilterBank

CERTAIN = 1e-4  # width of the band, in healthy bands, around the true vehicle


@dataclass(frozen=True)
class Oracle(FilterBank):
    """The filter bank, given the true healthy vehicle of each lane and perhaps the severity.

    The distance of a diagnoser from it is the loss because the vehicle is unknown; what it cannot
    distinguish, the readings do not. Without the truth it is the filter bank.

    When it misleads: it has the full severity, so it is too certain while a fault still grows; and
    it is no upper bound for a diagnoser that uses more than the bank's model, such as the
    controllers' commands.
    """

    name = "oracle"

    def set_truth(self, healthy: np.ndarray, severity: np.ndarray | None = None) -> None:
        """Set the truth of every lane after a `reset`, until the next one.

        Parameters
        ----------
        healthy
            (n_lanes, n_parameters), ordered as `PARAMETERS`, in their units.
        severity
            (n_lanes,), the full severity of the fault to come, 0 to 1; None leaves the grades.
        """
        running = self.running
        running.require_reset("set_truth")
        n_lanes = len(running.observation)
        healthy = _finite("healthy parameters", healthy, (n_lanes, len(PARAMETERS)))
        prior = running.state.prior
        if severity is not None:
            severity = _finite("severities", severity, (n_lanes,))
            if severity.min() < 0.0 or severity.max() > 1.0:
                raise refusal("severities", severity, "numbers from 0 to 1", "give fractions")
            certain = np.stack([severity, np.zeros(n_lanes), severity], axis=1)
            prior = certain[:, :, None]
        running.state = self._state_around(healthy, prior, CERTAIN)


def _finite(thing: str, values: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """A float64 copy of the values if they are finite numbers of that shape, else a refusal."""
    values = np.array(values, np.float64)
    if values.shape != shape or not np.isfinite(values).all():
        allowed = f"finite numbers of shape {shape}"
        raise refusal(thing, values.shape, allowed, "give one row per lane")
    return values
