"""Diagnosers of propulsion faults, and the filters that feed them.

`make` builds one by name; `NAMES` are the names, `ranked` gives those that compete (the others are
references). Another joins by ``REGISTRY["mine"] = Entry("my_package.my_module:MyDiagnoser")``;
`diagnosers.third_party` lists ways that need no such line.
"""

from diagnosers.checks import check_diagnoser
from diagnosers.diagnoser import UNKNOWN, Belief, Diagnoser, Recursive, decide
from diagnosers.registry import NAMES, REGISTRY, Entry, load, make, ranked

__all__ = [
    "NAMES",
    "REGISTRY",
    "UNKNOWN",
    "Belief",
    "Diagnoser",
    "Entry",
    "Recursive",
    "check_diagnoser",
    "decide",
    "load",
    "make",
    "ranked",
]
