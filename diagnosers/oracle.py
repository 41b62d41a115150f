"""A reference, not a competitor: the filter bank told what no diagnoser can know."""

from dataclasses import dataclass

import numpy as np

from auv_fault_env.errors import refusal
from auv_fault_env.parameters import PARAMETERS
from diagnosers.filter_bank import FilterBank

CERTAIN = 1e-4  # of the healthy band: what is left of it when the vehicle is known


@dataclass(frozen=True)
class Oracle(FilterBank):
    """The filter bank told the true healthy vehicle of each lane and, if wanted, how severe its fault will be.

    How near a diagnoser comes to it says how much is lost for want of knowing the vehicle; what it
    cannot tell apart is alike in the readings. Untold it is the filter bank.

    When it misleads: it knows the full severity, so while a fault still grows it is surer of it
    than right; and it is no upper bound for a diagnoser that reads what the bank's model leaves
    out, such as the controllers' commands.
    """

    name = "oracle"

    def set_truth(self, healthy: np.ndarray, severity: np.ndarray | None = None) -> None:
        """Tell the truth of every lane after a `reset`, whose state it replaces; the next reset forgets it.

        Parameters
        ----------
        healthy
            (n_lanes, n_parameters), ordered as `PARAMETERS`, in their units.
        severity
            (n_lanes,), the full severity of the fault to come, 0 to 1; None keeps the grades.
        """
        running = self.running
        running.require_reset("set_truth")
        n_lanes = len(running.observation)
        healthy = _checked("healthy parameters", healthy, (n_lanes, len(PARAMETERS)))
        prior = running.state.prior
        if severity is not None:
            severity = _checked("severities", severity, (n_lanes,))
            if severity.min() < 0.0 or severity.max() > 1.0:
                raise refusal("severities", severity, "numbers from 0 to 1", "give fractions")
            prior = np.stack([severity, np.zeros(n_lanes), severity], axis=1)[:, :, None]
        running.state = self._begun(healthy, prior, CERTAIN)


def _checked(thing: str, values: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """The values as float64 of their own if they are finite numbers of that shape, else a refusal."""
    values = np.array(values, np.float64)
    if values.shape != shape or not np.isfinite(values).all():
        raise refusal(
            thing, values.shape, f"finite numbers of shape {shape}", "give one row per lane"
        )
    return values
