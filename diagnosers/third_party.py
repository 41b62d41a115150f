"""Diagnosers of other people in a benchmark: three ways to join without a change of this package.

A class in an importable module or in a file, named on the command line; naming it runs its code::

    auv-fault benchmark --diagnoser my_package.my_module:MyDiagnoser
    auv-fault benchmark --diagnoser path/to/my_file.py:MyDiagnoser

An installed package that declares an entry point in its pyproject.toml; it then always takes part::

    [project.entry-points."auv_fault.diagnosers"]
    mine = "my_package.my_module:MyDiagnoser"

A file that imports its neighbours needs their folder in PYTHONPATH. A benchmark that runs again
reuses the trials of an unchanged file: choose another --output after a change in what it imports.
The class takes no arguments. One with a method `set_truth` receives the truth as the oracle does,
and is not ranked. It is a `Diagnoser`, or has the interface of the DX competitions::

    class MyDiagnoser(Recursive):
        name = "mine"

        def initial(self, n_lanes):
            return ()

        def step(self, state, observation):
            return state, Belief(log_probability, severity_mean, severity_std)


    class MySystem:
        faults = ("increased_drag", "propeller_loss:port", "unknown")

        def Initialize(self): ...

        def Input(self, sample):
            return sample["port_current"].iloc[0] > 9.0, [0.2, 0.7, 0.1]
"""

import hashlib
import importlib.util
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType

from auv_fault_env.errors import refusal
from diagnosers.diagnoser import Diagnoser
from diagnosers.registry import NAMES
from diagnosers.sample_adapter import SampleAdapter

ENTRY_POINT_GROUP = "auv_fault.diagnosers"
LONGEST_NAME = 60  # characters, for the name becomes part of file names
TARGET_FORM = "module:Class or path/to/file.py:Class"


@dataclass(frozen=True)
class ThirdParty:
    """The place of a diagnoser's class, as `TARGET_FORM`; called, it makes one."""

    target: str

    def __call__(self) -> Diagnoser:
        """A diagnoser ready for `reset`; one of the DX competitions in a `SampleAdapter`."""
        diagnoser_class = self.diagnoser_class
        thing = f"diagnoser {self.target}"
        try:
            made = diagnoser_class()
        except Exception as error:  # foreign code again
            allowed = "a class to call without arguments"
            raise refusal(thing, error, allowed, "correct it") from error
        if isinstance(made, Diagnoser):
            return made
        if callable(getattr(made, "Input", None)):
            return SampleAdapter(diagnoser_class)
        allowed = "an object with classes, reset and update, or with Input"
        raise refusal(thing, made, allowed, "see diagnosers.third_party")

    @property
    def diagnoser_class(self) -> type:
        """The class; its module is imported, which runs it."""
        place, _, name = self.target.rpartition(":")
        thing = f"diagnoser {self.target}"
        try:
            diagnoser_class = getattr(_module(place), name, None)
        except (Exception, SystemExit) as error:  # importing runs foreign code
            allowed = f"what can be imported, {TARGET_FORM}"
            raise refusal(thing, error, allowed, "correct it") from error
        if not isinstance(diagnoser_class, type):
            allowed = f"a class, {TARGET_FORM}"
            raise refusal(thing, diagnoser_class, allowed, "check the name of the class")
        return diagnoser_class

    @property
    def source(self) -> Path:
        """The file with the class, without what it imports."""
        return Path(sys.modules[self.diagnoser_class.__module__].__file__)


def load_third_parties(targets: Sequence[str]) -> dict[str, ThirdParty]:
    """Third parties by name: those at the targets, and those that installed packages declare.

    The name is the attribute `name` of the class, else that of the class itself; of a package, that
    of the entry point, which is not imported here. Raises `InputError` where a target is no class,
    and for a name that is taken or too long.
    """
    parties = [ThirdParty(_absolute(target)) for target in targets]
    named = [(_name_of(party.diagnoser_class), party) for party in parties]
    points = entry_points(group=ENTRY_POINT_GROUP)
    named += [(point.name, ThirdParty(point.value)) for point in points]
    by_name: dict[str, ThirdParty] = {}
    for name, party in named:
        thing = f"name of {party.target}"
        if len(name) > LONGEST_NAME:
            raise refusal(thing, name, f"up to {LONGEST_NAME} characters", "shorten it")
        if name in NAMES or by_name.setdefault(name, party) != party:
            raise refusal(thing, name, "one that no other diagnoser has", "rename it")
    return by_name


def _name_of(diagnoser_class: type) -> str:
    name = getattr(diagnoser_class, "name", None)
    return name if isinstance(name, str) and name else diagnoser_class.__name__


def _absolute(target: str) -> str:
    """The target with the absolute path of its file, which is the same in another process."""
    place, _, name = target.rpartition(":")
    return f"{Path(place).resolve()}:{name}" if place.endswith(".py") else target


def _module(place: str) -> ModuleType:
    """The module of a name, or that of a file, under a name that no other file has."""
    if not place.endswith(".py"):
        return importlib.import_module(place)
    name = f"third_party_{hashlib.sha256(place.encode()).hexdigest()[:12]}"
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, place)
        sys.modules[name] = importlib.util.module_from_spec(spec)
        try:
            spec.loader.exec_module(sys.modules[name])
        except BaseException:
            del sys.modules[name]
            raise
    return sys.modules[name]
