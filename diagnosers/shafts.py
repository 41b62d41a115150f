"""A vehicle with one shaft, for filters that have two: both sides turn and read alike."""

from dataclasses import replace

import numpy as np

from auv_fault_env.channels import INDEX
from auv_fault_env.parameters import SIDES, Vehicle

PORT, STARBOARD = (
    [INDEX[f"{side}_{reading}"] for reading in ("voltage", "current", "rpm")] for side in SIDES
)


def with_equal_shafts(vehicle: Vehicle) -> Vehicle:
    """The vehicle, a single shaft replaced by two that share its thrust."""
    return replace(vehicle, shafts=len(SIDES))


def with_equal_readings(observation: np.ndarray, vehicle: Vehicle) -> np.ndarray:
    """The observation (n_lanes, n_channels), of a single shaft with its readings on both sides."""
    if vehicle.shafts == len(SIDES):
        return observation
    observation = observation.copy()
    observation[:, STARBOARD] = observation[:, PORT]
    return observation
