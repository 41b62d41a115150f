"""The reading of the acceleration against the change of the speed."""

import numpy as np

from training.field.calibration.mistakes.finding import Finding
from training.field.calibration.mistakes.operating_points import DURATION, OperatingPoints
from training.field.units import UNITS
from training.field.vehicle_file import VehicleFile, unit_of

LEAST_POINTS = 8
LEAST_CORRELATION = 0.8
LEAST_RATE = 0.02  # m/s^2, of a change of speed that counts
AGREEMENT = (0.5, 2.0)  # of acceleration and change of speed
NEAR = 0.2  # relative distance to the factor of a unit


def acceleration_findings(points: OperatingPoints, vehicle: VehicleFile) -> list[Finding]:
    """A finding if the acceleration is a multiple of the change of the speed, or its negative."""
    slope = _slope(points)
    if slope is None or AGREEMENT[0] <= slope <= AGREEMENT[1]:
        return []
    name = "acceleration"
    evidence = f"it is {slope:.3g} times the change of the speed"
    if slope < 0.0:
        remedy = f"turn the sign of scale in [channels.{name}]"
        return [Finding((name,), evidence, "is its sign turned?", remedy)]
    units = UNITS["m/s^2"]
    now = unit_of(vehicle.columns[name], "m/s^2")
    for unit, factor in units.items():
        if abs(slope * factor / units[now] - 1.0) < NEAR:
            remedy = f'write unit = "{unit}" in [channels.{name}]'
            return [Finding((name,), evidence, f"is it in {unit}?", remedy)]
    remedy = f"check unit and scale in [channels.{name}]"
    return [Finding((name,), evidence, "is its scale off?", remedy)]


def _slope(points: OperatingPoints) -> float | None:
    """Acceleration by change of the speed; None where they hardly agree, or too few changes."""
    if not {"speed", "acceleration"} <= set(points.values):
        return None
    speed = points.values["speed"]
    acceleration = points.values["acceleration"]
    rate = np.diff(speed) / DURATION
    mean = (acceleration[1:] + acceleration[:-1]) / 2.0
    chosen = ~points.is_first[1:] & np.isfinite(rate) & np.isfinite(mean)
    chosen &= np.abs(rate) > LEAST_RATE
    if chosen.sum() < LEAST_POINTS or np.ptp(mean[chosen]) == 0.0:
        return None
    rate = rate[chosen]
    mean = mean[chosen]
    if abs(np.corrcoef(rate, mean)[0, 1]) < LEAST_CORRELATION:
        return None
    return float(rate @ mean / (rate @ rate))
