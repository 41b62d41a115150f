"""Readings that do not follow the others, such as the voltage of the supply."""

from typing import NamedTuple

import numpy as np

from training.field.calibration.mistakes.finding import Finding
from training.field.calibration.mistakes.operating_points import OperatingPoints

LEAST_POINTS = 12  # a minute at settled speeds
LEAST_CHANGE = 0.2  # of a reading, relative, that others have to follow
LEAST_CHANGE_OF_CURRENT = 0.5  # the same of a current, which goes with the cube
# Of the relative change of another reading. Voltage, shaft speed and speed of a vehicle are about
# proportional to each other, the current of a motor grows faster.
LEAST_SHARE = 0.25
SUPPLY_REMEDY = (
    "name the voltage of the motor in [channels.{0}], or its duty with times = this column, or "
    "leave the channel out"
)
CAUSES = {
    "voltage": ("is it the supply (battery, bus) and not the motor?", SUPPLY_REMEDY),
    "current": (
        "is it not the current of the motor, or is its sensor broken?",
        "name the current of the motor in [channels.{0}], or leave the channel out",
    ),
    "rpm": (
        "is it not the shaft speed, or is its counter broken?",
        "name the shaft speed in [channels.{0}], or leave the channel out",
    ),
    "speed": (
        "is it not the surge speed, or is its sensor broken?",
        "name the surge speed in [channels.{0}], or leave the channel out",
    ),
    "command": (
        "is it not the command of the surge speed?",
        "name the commanded surge speed in [channels.{0}], or leave the channel out",
    ),
}


class Change(NamedTuple):
    """How a reading changes where another one changes."""

    reference: str  # channel of the other one
    of_reference: float  # between its lowest and its highest quarter, relative
    of_reading: float  # between the same points, relative
    correlation: float

    @property
    def is_followed(self) -> bool:
        """Whether the reading changes enough."""
        return self.of_reading >= LEAST_SHARE * self.of_reference


def following_findings(points: OperatingPoints) -> list[Finding]:
    """Findings on readings that change with fewer than half of the others."""
    findings = []
    for name in points.of_motion:
        if not follows(points, name):
            change = next(one for one in changes(points, name) if not one.is_followed)
            findings.append(_finding(name, change, points.command))
    return findings


def follows(points: OperatingPoints, name: str) -> bool:
    """Whether a reading follows at least half of those of the vehicle and of its own side.

    One that changes alone need not be followed: a current of the water changes a speed over ground.
    A command that never changes need not be followed by anything, and keeps the speed the same.
    """
    if "speed" in name and points.command and _own_change(points, points.command) < LEAST_CHANGE:
        return True
    found = changes(points, name)
    if len(found) < min(2, len(points.others(name))):
        return True
    return 2 * sum(change.is_followed for change in found) >= len(found)


def changes(points: OperatingPoints, name: str) -> list[Change]:
    """Changes with every other reading of the vehicle and its side that changes itself."""
    others = sorted(points.others(name), key=lambda other: not other.endswith("rpm"))
    found = [_change(points, name, other) for other in others]
    return [one for one in found if one and one.of_reference >= _least_change(one.reference)]


def _least_change(reference: str) -> float:
    return LEAST_CHANGE_OF_CURRENT if reference.endswith("current") else LEAST_CHANGE


def _change(points: OperatingPoints, name: str, reference: str) -> Change | None:
    by = points.values[reference]
    values = points.values[name]
    chosen = points.is_settled & np.isfinite(by) & np.isfinite(values)
    if chosen.sum() < LEAST_POINTS:
        return None
    by = by[chosen]
    values = values[chosen]
    order = np.argsort(by, kind="stable")
    quarter = len(order) // 4
    is_constant = np.ptp(by) == 0.0 or np.ptp(values) == 0.0
    return Change(
        reference,
        relative_change(by[order], quarter),
        relative_change(values[order], quarter),
        0.0 if is_constant else float(np.corrcoef(by, values)[0, 1]),
    )


def relative_change(values: np.ndarray, quarter: int) -> float:
    """Difference of the medians of the first and the last so many values, relative."""
    ends = np.array([np.median(values[:quarter]), np.median(values[-quarter:])])
    return float(np.ptp(ends) / max(np.abs(ends).max(), 1e-12))


def _own_change(points: OperatingPoints, name: str) -> float:
    values = np.sort(points.values[name][points.is_settled])
    values = values[np.isfinite(values)]
    return relative_change(values, len(values) // 4) if len(values) >= LEAST_POINTS else 0.0


def _finding(name: str, change: Change, command: str | None) -> Finding:
    evidence = (
        f"it hardly follows {change.reference} (correlation {change.correlation:.1f}): it changes "
        f"by {100 * change.of_reading:.0f} % while {change.reference} changes by "
        f"{100 * change.of_reference:.0f} %"
    )
    kind = "command" if name == command else name.rpartition("_")[2]
    cause, remedy = CAUSES[kind]
    return Finding((name,), evidence, cause, remedy.format(name))
