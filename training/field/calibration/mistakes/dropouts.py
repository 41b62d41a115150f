"""Readings that fall to zero while the vehicle moves."""

from collections.abc import Sequence

import numpy as np

from auv_fault_env.channels import INDEX
from auv_fault_env.parameters import SIDES
from training.field.calibration.mistakes.finding import Finding
from training.field.calibration.mistakes.operating_points import OperatingPoints
from training.field.logs.log import Log

MOVES = 0.4  # of the largest usual reading, above which the other ones say that the vehicle moves
LEAST_SHARE = 0.1  # of readings that are zero
LEAST_ROWS = 100


def dropout_findings(logs: Sequence[Log], points: OperatingPoints) -> list[Finding]:
    """Findings on logs in which a shaft speed, or the speed, is zero while the others are not."""
    findings = []
    for log in logs:
        for name, witnesses in _witnesses(points).items():
            share = zero_share(log, name, witnesses, points)
            if share > LEAST_SHARE:
                others = " and ".join(witnesses)
                evidence = (
                    f"{name} is zero in {100 * share:.0f} % of the rows where {others} are not"
                )
                cause = "does its sensor drop out, and is the log not healthy?"
                findings.append(Finding((name,), evidence, cause, "leave the log out", log.name))
    return findings


def _witnesses(points: OperatingPoints) -> dict[str, tuple[str, ...]]:
    """Channels that are counted, each with others that say that it should not be zero."""
    of_sides = {f"{side}_rpm": ("speed", f"{side}_voltage", f"{side}_current") for side in SIDES}
    shaft_speeds = tuple(name for name in of_sides if name in points.values)
    candidates = {**of_sides, "speed": shaft_speeds}
    return {
        name: witnesses
        for name, witnesses in candidates.items()
        if witnesses and {name, *witnesses} <= set(points.values)
    }


def zero_share(log: Log, name: str, witnesses: Sequence[str], points: OperatingPoints) -> float:
    """Share of the readings that are zero in the rows where the witnesses are not."""
    values = log.observation[:, INDEX[name]]
    moves = np.isfinite(values)
    for witness in witnesses:
        moves &= log.observation[:, INDEX[witness]] > MOVES * points.largest(witness)
    return float(np.mean(values[moves] == 0.0)) if moves.sum() >= LEAST_ROWS else 0.0
