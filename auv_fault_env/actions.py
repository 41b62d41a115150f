"""The actions of a step: their names, and what is refused."""

import math
from collections.abc import Sequence

import numpy as np

from auv_fault_env.channels import COMMANDS
from auv_fault_env.errors import refusal
from auv_fault_env.parameters import SIDES, Vehicle
from auv_fault_env.thrust_shift import THRUST_SHIFT

ACTIONS = COMMANDS[1:]
WITH_SHIFT = (*ACTIONS, THRUST_SHIFT)


def actions_of(vehicle: Vehicle, thrust_shift: bool) -> tuple[str, ...]:
    """Names of the actions; those of a vehicle with one shaft have no shift of thrust."""
    if thrust_shift and vehicle.sides != SIDES:
        allowed = f"the actions {', '.join(ACTIONS)}, as {vehicle.name} has one shaft"
        raise refusal("action", THRUST_SHIFT, allowed, "leave it out")
    return WITH_SHIFT if thrust_shift else ACTIONS


def checked_actions(actions, shape: tuple[int, ...], names: Sequence[str] = ACTIONS) -> np.ndarray:
    """The actions as a new array of float64 if they are finite and of that shape, else a refusal.

    `names` are those of the elements along the last axis.
    """
    # NumPy would drop the imaginary part, and count the seconds of a date
    if getattr(getattr(actions, "dtype", None), "kind", "") in ("c", "m", "M"):
        raise refusal("action", actions, f"real numbers of shape {shape}", _give(names))
    try:
        actions = np.array(actions, np.float64, order="C")
    except OverflowError:
        allowed = f"finite numbers of shape {shape}"
        raise refusal("action", "a number beyond 1.8e308", allowed, "check the policy") from None
    # whatever an object raises that is to be numbers
    except Exception as error:
        got = actions if isinstance(error, TypeError | ValueError) else error
        raise refusal("action", got, f"numbers of shape {shape}", _give(names)) from None
    if actions.shape != shape:
        raise refusal("shape of the action", actions.shape, f"{shape}", _give(names))
    if actions.ndim == 1:
        are_finite = all(map(math.isfinite, actions.tolist()))  # faster for one vehicle
    else:
        are_finite = np.isfinite(actions).all()
    if not are_finite:
        place = tuple(np.argwhere(~np.isfinite(actions))[0])
        thing = f"action, {names[place[-1]]}"
        raise refusal(thing, float(actions[place]), "a finite number", "check the policy")
    return actions


def _give(names: Sequence[str]) -> str:
    return f"give {', '.join(names)}"
