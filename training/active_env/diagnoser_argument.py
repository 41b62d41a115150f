"""The argument `diagnoser` of the active environment, and its form in JSON."""

import copy
import inspect
from collections.abc import Callable, Mapping
from typing import Any

from auv_fault_env.env.interface import vehicle_of_argument
from auv_fault_env.errors import refusal
from auv_fault_env.importable import found, place_of
from auv_fault_env.parameters import PRESETS, Vehicle
from diagnosers import REGISTRY, Diagnoser, Recursive, make
from diagnosers.registry import class_of
from diagnosers.third_party import ThirdParty

USUAL_VEHICLE = PRESETS["thesis1992"]
ALLOWED = (
    "a name of diagnosers.NAMES, a mapping of it as `name` and of settings, 'module:Class' or "
    "'file.py:Class', a Diagnoser, or a function that makes one"
)


def lane_diagnosers(argument: Any, vehicle: Vehicle, n_lanes: int) -> list[Diagnoser]:
    """One diagnoser for all lanes if it is `Recursive`, else one for each lane.

    An object that is not `Recursive` is copied for each lane, so that lanes can start anew by
    themselves.
    """
    maker = _maker_of(argument, vehicle)
    first = _made(maker)
    if isinstance(first, Recursive):
        return [first]
    made = [first, *(_made(maker) for _ in range(n_lanes - 1))]
    if len(set(map(id, made))) < n_lanes:
        allowed = "a function that makes a new one at each call"
        raise refusal("diagnoser", "the same object for two lanes", allowed, "make a new one")
    return made


def _made(maker: Callable[[], Any]) -> Diagnoser:
    made = maker()
    if isinstance(made, type) or not isinstance(made, Diagnoser):
        allowed = "an object with classes, reset and update"
        remedy = "see diagnosers.Diagnoser; diagnosers.sample_adapter takes objects with Input"
        raise refusal("diagnoser", made, allowed, remedy)
    return made


def _maker_of(argument: Any, vehicle: Vehicle) -> Callable[[], Any]:
    """A function that makes the diagnoser of the argument at each call."""
    if isinstance(argument, str) and ":" in argument:
        is_file = argument.rpartition(":")[0].endswith(".py")
        named = None if is_file else found("diagnoser", argument)
        argument = ThirdParty(argument) if is_file or isinstance(named, type) else named
    if isinstance(argument, str):
        argument = {"name": argument}
    if isinstance(argument, Mapping):
        settings = dict(argument)
        name = settings.pop("name", None)
        settings = _for_vehicle(name, settings, vehicle)
        return lambda: make(name, **settings)
    if isinstance(argument, Diagnoser) and not isinstance(argument, type):
        return lambda: argument if isinstance(argument, Recursive) else _copy(argument)
    if callable(argument):
        return argument
    raise refusal("diagnoser", argument, ALLOWED, "give one of these")


def _for_vehicle(name: Any, settings: dict[str, Any], vehicle: Vehicle) -> dict[str, Any]:
    """The settings of a registered diagnoser, with the vehicle where it takes one."""
    takes_vehicle = "vehicle" in inspect.signature(class_of(name)).parameters
    if takes_vehicle:
        return settings | {"vehicle": vehicle_of_argument(settings.get("vehicle", vehicle))}
    if vehicle != USUAL_VEHICLE and REGISTRY[name].ranked:
        allowed = f"one that takes a vehicle, for {vehicle.name}"
        raise refusal("diagnoser", name, allowed, "take filter_bank")
    return settings


def _copy(diagnoser: Diagnoser) -> Diagnoser:
    try:
        return copy.deepcopy(diagnoser)
    except Exception as error:  # foreign code
        allowed = "one that can be copied for each lane"
        raise refusal("diagnoser", diagnoser, allowed, "give a function that makes one") from error


def plain_diagnoser(argument: Any) -> Any:
    """The argument as JSON has it; what JSON cannot have stays as it is."""
    name = getattr(argument, "name", None)
    is_registered = isinstance(name, str) and name in REGISTRY and type(argument) is class_of(name)
    if is_registered and not argument.tensors():
        return {"name": name} | argument.settings()
    return place_of(argument)
