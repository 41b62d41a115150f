"""The duty of a motor command: where it rests, and what is full."""

from typing import NamedTuple

import numpy as np

from training.field.proposal.evidence import are_pulses

FEWEST_ROWS = 5  # at which the vehicle stands
NEAR = 0.1  # of the span, from a usual rest value to that of the log
ASTERN = 0.2  # share of rows below the middle from which the middle cannot be rest


class Levels(NamedTuple):
    """Of a motor command: duty = (command - rest) / span."""

    rest: float
    span: float  # from rest to full
    why: str


def levels_of(
    command: np.ndarray, unit: str | None, is_standing: np.ndarray, goes_ahead: bool
) -> Levels | None:
    """Rest and span of a motor command (n_rows,); None if the log does not show them.

    Parameters
    ----------
    command
        (n_rows,), in pulses, counts of 8 bits, percent, thousandths or as a fraction.
    unit
        Of its name, or None.
    is_standing
        (n_rows,) whether the vehicle stands with its motors off; all False if not known.
    goes_ahead
        Whether the vehicle goes ahead or stands all the time.
    """
    known = command[np.isfinite(command)]
    standing = command[is_standing & np.isfinite(command)]
    usual, about = _usual(known, unit)
    if standing.size >= FEWEST_ROWS:
        level = float(np.median(standing))
        rest, span = min(usual, key=lambda one: abs(one[0] - level))
        if abs(rest - level) <= NEAR * span:
            return Levels(rest, span, f"{about} that rest at {rest:g}, as while it stands")
        span = float(abs(known - level).max())
        return Levels(level, span, f"rests at {level:g}, as while it stands; its largest is full")
    rest, span = usual[0]
    is_below = np.mean(known < rest)
    if len(usual) == 1:
        return Levels(rest, span, f"{about} that rest at {rest:g}")
    if is_below > ASTERN and goes_ahead:
        rest, span = min(usual[1:], key=lambda one: abs(one[0] - known.min()))
        return Levels(rest, span, f"{about} that rest at {rest:g}, for the vehicle goes ahead")
    if are_pulses(known) or is_below > 0:
        return Levels(rest, span, f"{about} that rest at {rest:g}, as is usual; not in the log")
    return None


def _usual(known: np.ndarray, unit: str | None) -> tuple[list[tuple[float, float]], str]:
    """Usual pairs of rest and span for commands of this size, the first the most usual."""
    least = known.min()
    most = known.max()
    if unit in ("%", "pct", "percent") and max(-least, most) > 1.0:
        return [(0.0, 100.0)], "percent"
    if are_pulses(known):
        half = 400.0 if least >= 1100 and most <= 1900 else 500.0
        return [(1500.0, half), (1100.0, 2 * half), (1000.0, 2 * half)], "pulses in us"
    is_whole = bool((known == np.round(known)).all())
    if is_whole and least >= 0 and 100 < most <= 255:
        return [(128.0, 127.0), (127.0, 127.0), (0.0, 255.0)], "counts of 8 bits"
    for full, about in ((1.0, "fractions"), (100.0, "percent"), (1000.0, "thousandths")):
        if max(-least, most) <= full:
            return [(0.0, full)], about
    full = float(abs(known).max())
    return [(0.0, full)], f"numbers of which the largest, {full:g}, is full"
