"""Diagnosers of other people in a benchmark: three ways to join without a change of this package.

A class in an importable module or in a file, named on the command line; naming it runs its code::

    auv-fault benchmark --diagnoser my_package.my_module:MyDiagnoser
    auv-fault benchmark --diagnoser path/to/my_file.py:MyDiagnoser

An installed package that declares an entry point in its pyproject.toml; it then always takes part::

    [project.entry-points."auv_fault.diagnosers"]
    mine = "my_package.my_module:MyDiagnoser"

A file that imports its neighbours needs their folder in PYTHONPATH. A benchmark that runs again
reuses the trials of an unchanged file: choose another --output after a change in what it imports.
It runs them in processes of their own (`training.benchmark.third_parties`).
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
import os
import re
import sys
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from auv_fault_env.errors import InputError, known_name, refusal
from diagnosers.diagnoser import Diagnoser
from diagnosers.sample_adapter import SampleAdapter

ENTRY_POINT_GROUP = "auv_fault.diagnosers"
TARGET_FORM = "module:Class or path/to/file.py:Class"


NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9 _.+-]{0,59}")
NAME_FORM = "up to 60 letters (A to Z), digits, spaces, and characters of _.+-, no such first"


class ForeignCodeError(InputError):
    """What the code of a third party does instead of giving a diagnoser."""


@dataclass(frozen=True)
class ThirdParty:
    """The place of a diagnoser's class, as `TARGET_FORM`; called, it makes one.

    The path of a file is taken as absolute, so that it is the same in another process. Raises
    `InputError` where there is no class at the target, and `ForeignCodeError` where its code fails.
    """

    target: str

    def __post_init__(self):
        place, _, name = self.target.rpartition(":")
        if place.endswith(".py"):
            object.__setattr__(self, "target", f"{os.path.abspath(place)}:{name}")

    def __call__(self) -> Diagnoser:
        """A diagnoser ready for `reset`; one of the DX competitions in a `SampleAdapter`."""
        diagnoser_class = self.diagnoser_class
        try:
            made = diagnoser_class()
        except Exception as error:  # foreign code again
            raise self._failure(error, "a class to call without arguments") from error
        if isinstance(made, Diagnoser):
            return made
        if callable(getattr(made, "Input", None)):
            return SampleAdapter(diagnoser_class)
        raise self._failure(made, "an object with classes, reset and update, or with Input")

    @property
    def diagnoser_class(self) -> type:
        """The class; its module is imported, which runs it."""
        place, _, name = self.target.rpartition(":")
        thing = f"diagnoser {self.target}"
        self._check_place(place)
        try:
            module = _module(place)
        except (Exception, SystemExit) as error:  # importing runs foreign code
            absent = error.name if isinstance(error, ModuleNotFoundError) else None
            if absent is not None and f"{place}.".startswith(f"{absent}."):
                allowed = f"what can be imported, {TARGET_FORM}"
                raise refusal(thing, error, allowed, "check the name of the module") from error
            raise self._failure(error, f"what can be imported, {TARGET_FORM}") from error
        if not hasattr(module, name):
            found = [one for one, value in vars(module).items() if _is_own_class(value, module)]
            if not found:
                remedy = "define it there, or name another file or module"
                raise refusal(f"class of {place}", name, "a class, and it has none", remedy)
            known_name(f"class of {place}", name, found)
        diagnoser_class = getattr(module, name)
        if not isinstance(diagnoser_class, type):
            allowed = f"a class, {TARGET_FORM}"
            raise refusal(thing, diagnoser_class, allowed, "check the name of the class")
        return diagnoser_class

    @property
    def name(self) -> str:
        """The attribute `name` of the class, else the name of the class."""
        diagnoser_class = self.diagnoser_class
        name = getattr(diagnoser_class, "name", None)
        name = name if isinstance(name, str) and name else diagnoser_class.__name__
        return self.checked_name(name)

    def checked_name(self, name: str) -> str:
        """The name, if files, figures and terminals can hold it."""
        if not NAME.fullmatch(name):
            thing = f"name of {self.target}"
            remedy = "set the attribute `name` of the class"
            raise ForeignCodeError(str(refusal(thing, name, NAME_FORM, remedy)))
        return name

    @property
    def source(self) -> Path:
        """The file with the class, without what it imports."""
        return Path(sys.modules[self.diagnoser_class.__module__].__file__)

    def _check_place(self, place: str) -> None:
        """Refuse a target that names neither a module nor a file that exists."""
        check_names_a_class("diagnoser", self.target, TARGET_FORM)
        is_there = _is_file(Path(place)) if place.endswith(".py") else place[:1] != "."
        if not is_there:
            allowed = f"what can be imported, {TARGET_FORM}"
            raise refusal("diagnoser", self.target, allowed, "check the path")

    def _failure(self, got: Any, allowed: str) -> ForeignCodeError:
        remedy = "correct it, see diagnosers.third_party"
        return ForeignCodeError(str(refusal(f"diagnoser {self.target}", got, allowed, remedy)))


def check_names_a_class(thing: str, target: str, forms: str) -> None:
    """Refuse a target without the name of a class behind its place.

    >>> check_names_a_class("diagnoser", "mine.py", TARGET_FORM)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    auv_fault_env.errors.InputError: diagnoser: got 'mine.py'; ...; name its class: mine.py:Class
    """
    place, _, name = target.rpartition(":")
    if not place or not name:
        remedy = f"name its class: {target.partition(':')[0] or 'module'}:Class"
        raise refusal(thing, target, f"what can be imported, {forms}", remedy)


def installed_third_parties() -> list[tuple[str, ThirdParty]]:
    """Names and places of the diagnosers that installed packages declare; nothing is imported."""
    points = entry_points(group=ENTRY_POINT_GROUP)
    return [(point.name, ThirdParty(point.value)) for point in points]


def _is_own_class(value: Any, module: ModuleType) -> bool:
    return isinstance(value, type) and value.__module__ == module.__name__


def _is_file(path: Path) -> bool:
    """Whether there is a regular file, also for a path that no file can have."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


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
