"""The columns of a log by quantity and side: the best of each, and why the others are left out."""

from collections.abc import Mapping
from typing import NamedTuple

from training.field.logs.table import Table
from training.field.proposal.evidence import OF_NO_SIDE, SIDED, Match, Refused, match_of
from training.field.proposal.header import Name, name_of
from training.field.proposal.sides import side_marks, side_of
from training.field.proposal.symbols import context_of

FURTHER = "a further thruster: a vehicle file has two"
ALONE = "a further thruster, of which the first ones are not in the log"


class Found(NamedTuple):
    """What the columns of a log are."""

    matches: dict[str, Match]  # by label
    best: dict[str, Match]  # by quantity, of shafts with its side before it: port_rpm
    left_out: dict[str, str]  # the reason, by label; more is added where motors are described
    unknown: tuple[str, ...]
    unread_times: tuple[str, ...]  # columns of a time by name, without numbers that can be one

    @property
    def has_further_thrusters(self) -> bool:
        """Whether thrusters are left out for which a vehicle file has no place."""
        return not {FURTHER, ALONE, OF_NO_SIDE}.isdisjoint(self.left_out.values())


def found_columns(table: Table) -> Found:
    """Match every column of a log with the quantity that it is most certainly."""
    names = {label: name_of(label, table.units.get(label, "")) for label in table.columns}
    marks = side_marks(names)
    context = context_of(names)
    outcomes = [
        match_of(label, names[label], marks[label], values, context, label in table.stamps)
        for label, values in table.columns.items()
    ]
    refused = [one for one in outcomes if isinstance(one, Refused)]
    matches = {one.label: one for one in outcomes if isinstance(one, Match)}
    left_out = {one.label: one.why for one in refused if one.why}
    unknown = tuple(one.label for one in refused if not one.why)
    _leave_out_unknown_sides(matches, names, left_out)
    best = _best(matches, left_out)
    unread_times = tuple(one.label for one in refused if one.quantity == "time")
    return Found(matches, best, left_out, unknown, unread_times)


def _leave_out_unknown_sides(
    matches: dict[str, Match], names: Mapping[str, Name], left_out: dict[str, str]
) -> None:
    """Leave out columns of shafts that differ only in a word without a known meaning: rpm_er."""
    others: dict[tuple, list[tuple[str, str]]] = {}
    for match in matches.values():
        if match.quantity not in SIDED or match.mark is not None:
            continue
        stem = names[match.label].stem
        for place, word in enumerate(stem):
            if word in match.unknown:
                key = (match.quantity, stem[:place], stem[place + 1 :])
                others.setdefault(key, []).append((match.label, word))
    for alike in others.values():
        words = " or ".join(repr(word) for _, word in alike)
        for label, _ in alike if len(alike) > 1 else ():
            left_out[label] = f"it is of one side, and which of {words} is port is not known"
            matches.pop(label, None)


def _best(matches: Mapping[str, Match], left_out: dict[str, str]) -> dict[str, Match]:
    """The match with most points for each quantity and side; of equal ones, the first."""
    best: dict[str, Match] = {}
    numbers = _numbers_of_shafts(matches)
    first = min(1, *(number for known in numbers.values() for number in known), 1)
    for match in sorted(matches.values(), key=lambda one: -one.score):
        channel = match.quantity
        if channel in SIDED:
            side = side_of(match.mark, numbers[channel], first)
            if side is None:
                left_out[match.label] = FURTHER if len(numbers[channel]) > 1 else ALONE
                continue
            channel = f"{side}_{channel}"
        if channel in best and channel != "time":
            left_out[match.label] = f"{channel.replace('_', ' ')} is {best[channel].label!r}"
        else:
            best.setdefault(channel, match)
    return best


def _numbers_of_shafts(matches: Mapping[str, Match]) -> dict[str, list[int]]:
    """The numbers of the shafts by quantity, in order.

    A shaft has one number in all quantities, unless some count two shafts from 0, others from 1.
    """
    own = {
        quantity: {
            match.mark
            for match in matches.values()
            if match.quantity == quantity and isinstance(match.mark, int)
        }
        for quantity in SIDED
    }
    together = set().union(*own.values())
    counts_differ = {0, 1} in own.values() and {1, 2} in own.values() and together == {0, 1, 2}
    return {quantity: sorted(own[quantity] if counts_differ else together) for quantity in SIDED}
