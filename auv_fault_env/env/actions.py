"""The two kinds of action: commands in physical units, and residuals around the mission."""

import gymnasium as gym
import numpy as np

from auv_fault_env import layout
from auv_fault_env.actions import ACTIONS, actions_of
from auv_fault_env.env.interface import box
from auv_fault_env.fleet import Fleet
from auv_fault_env.parameters import Vehicle
from auv_fault_env.thrust_shift import LARGEST_SHIFT

KINDS = ("command", "residual")
RESIDUAL = 0.25  # of the largest speed, the change of the mission speed by a residual of 1


def action_space(kind: str, vehicle: Vehicle, thrust_shift: bool = False) -> gym.spaces.Box:
    """The space of the actions of one vehicle, the last of them `thrust_shift` if it has that."""
    names = actions_of(vehicle, thrust_shift)
    if kind == "residual":
        return gym.spaces.Box(-1.0, 1.0, (len(names),), np.float32)
    commanded = box(ACTIONS, vehicle)
    of_shift = [LARGEST_SHIFT] * (len(names) - len(ACTIONS))
    low = np.append(commanded.low, np.negative(of_shift))
    high = np.append(commanded.high, of_shift)
    return gym.spaces.Box(low.astype(np.float32), high.astype(np.float32), dtype=np.float32)


def commands(kind: str, fleet: Fleet, actions: np.ndarray) -> np.ndarray:
    """The commands (n_lanes, n_actions) of checked actions; the fleet clips them to its limits.

    A residual of 0 follows the mission with the fins amidships and equal thrust.
    """
    if kind == "command":
        return actions
    largest = fleet.limits[layout.SPEED_COMMAND : layout.STERN_PLANE + 1, 1]
    factors = np.append(largest * [RESIDUAL, 1.0, 1.0], LARGEST_SHIFT)
    moved = np.clip(actions, -1.0, 1.0) * factors[: actions.shape[1]]
    moved[:, 0] += fleet.row(layout.MISSION_SPEED)
    return moved
