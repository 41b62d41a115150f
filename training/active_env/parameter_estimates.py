"""The parameter filter over many lanes, each of which may start a new episode at any sample."""

import numpy as np

from auv_fault_env.channels import INDEX
from auv_fault_env.parameters import Vehicle
from diagnosers.kalman import Estimate, ParameterFilter
from training.active_env.beliefs import with_fresh_lanes

PORT_RPM = INDEX["port_rpm"]
STARBOARD_RPM = INDEX["starboard_rpm"]


class ParameterEstimates:
    """Drag and thrust of every lane relative to nominal, with their covariance.

    Observations are float64 (n_lanes, n_channels).
    """

    def __init__(self, vehicle: Vehicle):
        self._filter = ParameterFilter(vehicle)
        self._has_one_shaft = vehicle.shafts == 1
        self.estimate: Estimate | None = None

    def reset(self, lanes: np.ndarray, observation: np.ndarray) -> None:
        """Start the chosen lanes (n_chosen,) anew, all at the first call, with their first sample.

        ``observation`` is that of all lanes.
        """
        fresh = self._after(self._filter.initial(lanes.size), observation[lanes])
        is_first = self.estimate is None
        self.estimate = fresh if is_first else with_fresh_lanes(self.estimate, lanes, fresh)

    def update(self, observation: np.ndarray) -> None:
        """Take the next sample of every lane."""
        self.estimate = self._after(self.estimate, observation)

    def _after(self, estimate: Estimate, observation: np.ndarray) -> Estimate:
        if self._has_one_shaft:  # the filter takes the mean over two shafts
            observation = observation.copy()
            observation[:, STARBOARD_RPM] = observation[:, PORT_RPM]
        return self._filter.update(estimate, observation)
