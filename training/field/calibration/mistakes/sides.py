"""Port and starboard swapped within one pair of readings."""

import numpy as np

from auv_fault_env.parameters import SIDES
from training.field.calibration.mistakes.finding import Finding
from training.field.calibration.mistakes.operating_points import MOTOR_KINDS, OperatingPoints

LEAST_POINTS = 12
WORSE = 3.0  # error by the own side's reading, in errors by the other side's
LEAST_ERROR = 0.05  # by the own side's reading, relative to the typical reading


def swap_findings(points: OperatingPoints) -> list[Finding]:
    """Findings on pairs that follow the other side, which shows where the sides differ."""
    kinds = [
        kind for kind in MOTOR_KINDS if all(f"{side}_{kind}" in points.values for side in SIDES)
    ]
    for reference in kinds[:1]:
        swapped = [kind for kind in kinds[1:] if _is_swapped(points, kind, reference)]
        if len(swapped) == len(kinds) - 1 > 1:
            return [_finding(points, reference, swapped[0])]
        return [_finding(points, kind, reference) for kind in swapped]
    return []


def _is_swapped(points: OperatingPoints, kind: str, reference: str) -> bool:
    for side, other in (SIDES, reversed(SIDES)):
        name = f"{side}_{kind}"
        own_error = error_by(points, name, f"{side}_{reference}")
        other_error = error_by(points, name, f"{other}_{reference}")
        is_worse = own_error > WORSE * other_error
        if not (is_worse and own_error > LEAST_ERROR * points.typical(name)):
            return False
    return True


def error_by(points: OperatingPoints, name: str, reference: str) -> float:
    """Median error under way of a reading by a parabola of another one; 0 with too few points."""
    by = points.values[reference]
    values = points.values[name]
    chosen = points.is_under_way & np.isfinite(by) & np.isfinite(values)
    if chosen.sum() < LEAST_POINTS:
        return 0.0
    scaled = by[chosen] / max(np.abs(by[chosen]).max(), 1e-12)
    terms = np.stack([np.ones(len(scaled)), scaled, scaled**2], axis=1)
    solution, *_ = np.linalg.lstsq(terms, values[chosen], rcond=None)
    return float(np.median(np.abs(values[chosen] - terms @ solution)))


def _finding(points: OperatingPoints, kind: str, reference: str) -> Finding:
    names = tuple(f"{side}_{kind}" for side in SIDES)
    port, starboard = SIDES
    errors = [
        100 * error_by(points, names[0], f"{side}_{reference}") / points.typical(names[0])
        for side in SIDES
    ]
    evidence = (
        f"{port}_{kind} follows {starboard}_{reference} within {errors[1]:.1f} % and "
        f"{port}_{reference} within {errors[0]:.0f} %, and {starboard}_{kind} likewise"
    )
    remedy = f"exchange the columns of [channels.{names[0]}] and [channels.{names[1]}]"
    return Finding(names, evidence, f"are {port} and {starboard} swapped?", remedy)
