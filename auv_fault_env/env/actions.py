"""The two kinds of action: commands in physical units, and residuals around the mission."""

import gymnasium as gym
import numpy as np

from auv_fault_env import layout
from auv_fault_env.env.interface import box
from auv_fault_env.fleet import ACTIONS, Fleet
from auv_fault_env.parameters import Vehicle

KINDS = ("command", "residual")
RESIDUAL = 0.25  # of the largest speed, the change of the mission speed by a residual of 1


def action_space(kind: str, vehicle: Vehicle) -> gym.spaces.Box:
    """The space of the actions of one vehicle."""
    if kind == "residual":
        return gym.spaces.Box(-1.0, 1.0, (len(ACTIONS),), np.float32)
    return box(ACTIONS, vehicle)


def commands(kind: str, fleet: Fleet, actions: np.ndarray) -> np.ndarray:
    """The commands (n_lanes, 3) of checked actions; the fleet clips them to its limits.

    A residual of 0 follows the mission with the fins amidships.
    """
    if kind == "command":
        return actions
    largest = fleet.limits[layout.SPEED_COMMAND : layout.STERN_PLANE + 1, 1]
    moved = np.clip(actions, -1.0, 1.0) * largest * [RESIDUAL, 1.0, 1.0]
    moved[:, 0] += fleet.row(layout.MISSION_SPEED)
    return moved
