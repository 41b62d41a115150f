"""Readings and commands whose sign is turned."""

import numpy as np

from auv_fault_env.channels import CHANNELS
from training.field.calibration.mistakes.finding import Finding
from training.field.calibration.mistakes.operating_points import OperatingPoints
from training.field.calibration.mistakes.rest import value_at_rest
from training.field.vehicle_file import Column, VehicleFile

NEGATIVE = 0.8  # share of points from which a sign is turned
LEAST_POINTS = 6  # half a minute under way


def sign_findings(points: OperatingPoints, vehicle: VehicleFile) -> list[Finding]:
    """Findings on readings that are negative, and below those at rest, while the vehicle moves.

    With a command the vehicle is under way where that is positive; without one, the sign of most
    readings is the right one.
    """
    if points.command and _negative_share(points.values[points.command]) > NEGATIVE:
        name = points.command
        return [_finding(name, points.values[name], vehicle.columns[name])]
    names = [name for name in points.of_motion if name != points.command]
    values = {name: points.values[name][points.is_under_way] for name in names}
    negative = [
        name
        for name in names
        if _negative_share(values[name]) > NEGATIVE
        and _negative_share(values[name] - value_at_rest(points, name)) > NEGATIVE
    ]
    if points.command is None and 2 * len(negative) >= len(names):
        return []
    return [_finding(name, values[name], vehicle.columns[name]) for name in negative]


def _negative_share(values: np.ndarray) -> float:
    """Share of negative values among those that are not zero; 0 for too few."""
    values = values[np.isfinite(values) & (values != 0.0)]
    return float(np.mean(values < 0.0)) if len(values) >= LEAST_POINTS else 0.0


def _finding(name: str, values: np.ndarray, column: Column) -> Finding:
    share = 100.0 * _negative_share(values)
    median = np.nanmedian(values[values != 0.0])
    unit = CHANNELS[name].unit
    evidence = f"negative at {share:.0f} % of the points under way, median {median:.3g} {unit}"
    remedy = f"turn the sign of scale in [channels.{name}]"
    if column.offset:
        remedy += " and check its offset"
    return Finding((name,), evidence, "is its sign turned?", remedy, is_fatal=True)
