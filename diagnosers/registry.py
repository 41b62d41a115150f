"""The registry of diagnosers: by name the place of the class, and whether it competes."""

import importlib
import inspect
from collections.abc import KeysView
from pathlib import Path
from typing import Any, NamedTuple

from auv_fault_env.errors import known_name, refusal
from auv_fault_env.parameters import Vehicle
from diagnosers import storage
from diagnosers.diagnoser import Diagnoser


class Entry(NamedTuple):
    """The class, best as "module:Class" so that libraries load on demand, and if it competes."""

    target: str | type
    ranked: bool = True


REGISTRY: dict[str, Entry] = {
    "limits": Entry("diagnosers.limits:Limits"),
    "cusum": Entry("diagnosers.cusum:Cusum"),
    "rules": Entry("diagnosers.rules:Rules"),
    "residuals": Entry("diagnosers.residuals:Residuals"),
    "filter_bank": Entry("diagnosers.filter_bank:FilterBank"),
    "gaussian_bank": Entry("diagnosers.gaussian_bank:GaussianBank"),
    "raw_network": Entry("diagnosers.raw_network:RawNetwork"),
    "kalman_network": Entry("diagnosers.kalman_network:KalmanNetwork"),
    "parallel": Entry("diagnosers.parallel:Parallel"),
    "integrated": Entry("diagnosers.integrated:Integrated"),
    "oracle": Entry("diagnosers.oracle:Oracle", ranked=False),
    "null": Entry("diagnosers.references:Null", ranked=False),
    "random": Entry("diagnosers.references:Random", ranked=False),
}
NAMES: KeysView[str] = REGISTRY.keys()


def ranked() -> list[str]:
    """Names of the diagnosers that compete; the others are references."""
    return [name for name, entry in REGISTRY.items() if entry.ranked]


def class_of(name: str) -> type:
    """The class of a registered diagnoser; the refusal of an unknown name lists all."""
    target = REGISTRY[known_name("diagnoser", name, REGISTRY)].target
    if isinstance(target, type):
        return target
    module, _, attribute = target.partition(":")
    return getattr(importlib.import_module(module), attribute)


def make(name: str, **settings: Any) -> Diagnoser:
    """A diagnoser by name, ready for `reset`, with settings of its class."""
    diagnoser_class = class_of(name)
    signature = inspect.signature(diagnoser_class)
    try:
        signature.bind(**settings)
    except TypeError as error:
        allowed = f"those of {diagnoser_class.__name__}{signature}"
        raise refusal(f"settings of {name}", settings, allowed, str(error)) from None
    return diagnoser_class(**settings)


def load(path: str | Path) -> Diagnoser:
    """The diagnoser in a safetensors file of ``save``; any other file is refused in one line."""
    tensors, header = storage.read(path)
    if not isinstance(header, dict) or not isinstance(header.get("settings"), dict):
        allowed = "one that a diagnoser's save has written"
        raise refusal("weights file", str(path), allowed, "save it again")
    name = known_name(f"diagnoser of {path}", header.get("diagnoser"), REGISTRY)
    settings = dict(header["settings"])
    vehicle = settings.get("vehicle")
    if isinstance(vehicle, dict):
        try:
            settings["vehicle"] = Vehicle(**vehicle)
        except TypeError as error:
            allowed = "the fields of Vehicle"
            raise refusal(f"vehicle of {path}", vehicle, allowed, str(error)) from None
    return make(name, **settings, **({"weights": path} if tensors else {}))
