"""A guess of the proposal, with its reason."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from training.field.proposal.evidence import KINDS, Match, unit_by_size
from training.field.units import UNITS
from training.field.vehicle_file import Column


class Guess(NamedTuple):
    """A column of the log for a channel or for the time, and why."""

    column: Column
    why: str


def guess_of(match: Match, columns: Mapping[str, np.ndarray]) -> Guess:
    """The column in its unit: the named one, or that of the channel unless it is too large."""
    kind = KINDS[match.quantity]
    values = columns[match.label]
    unit = unit_by_size(kind, match.unit, values) or kind
    why = "by its name" if match.unit else f"by its name, which has no unit; {unit} is assumed"
    if unit != kind and not match.unit:
        why = f"by its name, which has no unit; {unit} by the size of its values"
    if match.unknown and not isinstance(match.mark, str):
        why += f"; of it {', '.join(map(repr, match.unknown))} is not known"
    if "vx" in match.label.lower():
        why += "; taken along the vehicle, not along a fixed axis"
    if isinstance(match.mark, int):
        why += f"; the side of number {match.mark} is a guess"
    if "erpm" in match.label.lower():
        why += "; electrical: divide by the pairs of poles"
    return Guess(Column(match.label, UNITS[kind][unit]), why)
