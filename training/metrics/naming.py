"""Which names are right for faults that no class of the catalogue describes, and for two at once.

A fault outside the catalogue is named rightly by `unknown` and by the classes of its component.
Of two faults, the classes of both components are right, and `unknown`, for no single one explains
the readings.
"""

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np

from auv_fault_env.faults import CATALOGUE, UNKNOWN, classes

SURE = 0.9  # probability above which a wrong name misleads


class Naming(NamedTuple):
    """What a diagnoser names the faults of the lanes that have an alarm, (n_lanes,) bool each."""

    alarmed: np.ndarray
    right: np.ndarray  # the most probable fault is `unknown` or belongs to the right component
    unknown: np.ndarray  # it is `unknown`
    surely_wrong: np.ndarray  # it belongs to another component, and has more than `SURE`


def unknown_class() -> int:
    """Index of the class `unknown`."""
    return classes().index(UNKNOWN)


def right_classes(
    fault: np.ndarray, components: Sequence[Collection[str]], explained: np.ndarray
) -> np.ndarray:
    """Whether each class is a right name for the faults of each lane, (n_lanes, n_classes).

    Parameters
    ----------
    fault
        (n_lanes,) class of the worst fault: the only right one of an explained lane.
    components
        Those that fail, one collection per lane.
    explained
        (n_lanes,) whether the lane has no more than one fault, of the catalogue.
    """
    names = classes()
    component_of = {one.diagnosis: one.component for one in CATALOGUE.values()}
    of_lanes = []
    for failing in components:
        parts = [component_of.get(name, "") for name in names]
        of_lanes.append([any(_is_part(part, whole) for whole in failing) for part in parts])
    is_right = np.array(of_lanes)
    is_right[:, unknown_class()] = True
    is_right[explained] = fault[explained, None] == np.arange(len(names))
    return is_right


def _is_part(part: str, whole: str) -> bool:
    """Whether a component is another one or that of one side: `propeller:port` of `propeller`."""
    return part == whole or part.startswith(f"{whole}:")


def name_of(
    alarm: np.ndarray,
    fault: np.ndarray,
    log_fault: np.ndarray,
    is_right_class: np.ndarray,
    unknown: int,
) -> Naming:
    """What is named at one instant.

    Parameters
    ----------
    alarm, fault, log_fault
        Whether the lane has an alarm; its most probable fault and the log probability of that,
        (n_lanes,).
    is_right_class
        (n_lanes, n_classes).
    unknown
        Index of the class `unknown`.

    Misleads: to call everything `unknown` is never wrong; read it beside the isolation of known
    faults. Lanes without an alarm do not count: read it beside the share detected.
    """
    is_right = is_right_class[np.arange(len(fault)), fault]
    is_sure = log_fault > np.log(SURE)
    return Naming(alarm, alarm & is_right, alarm & (fault == unknown), alarm & ~is_right & is_sure)


def share_of_alarmed(naming: Naming, what: np.ndarray) -> float:
    """Share of the lanes with an alarm; NaN if there are none."""
    n_alarmed = naming.alarmed.sum()
    return float(what.sum() / n_alarmed) if n_alarmed else float("nan")
