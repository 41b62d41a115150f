"""Readings that are not zero while the vehicle stands still."""

from collections.abc import Sequence

import numpy as np

from auv_fault_env.channels import CHANNELS
from training.field.calibration.mistakes.finding import Finding
from training.field.calibration.mistakes.following import SUPPLY_REMEDY
from training.field.calibration.mistakes.operating_points import OperatingPoints
from training.field.vehicle_file import VehicleFile

# of the typical reading under way, below which another reading says that the vehicle stands
AT_REST = {"command": 0.01, "rpm": 0.03, "voltage": 0.01, "current": 0.1}
# Of the typical reading under way, above which the reading of a vehicle that stands is not zero.
# A motor that its controller holds may stand with some voltage and current: by Ohm's law the share
# of its current is a few times that of its voltage.
LEAST_OFFSET = {"voltage": 0.15, "current": 0.1, "rpm": 0.1, "speed": 0.1}
LEAST_CURRENT_WITHOUT_VOLTAGE = 0.5
COASTING = ("rpm", "speed")  # not zero for minutes after a motor stops, but before it starts
STEADY = 0.5  # largest spread of an offset, relative to it
LEAST_POINTS = 4  # 20 s
SUPPLY_RISE = 0.02  # from rest to under way, relative; the supply of a motor sags


def rest_findings(points: OperatingPoints, vehicle: VehicleFile) -> list[Finding]:
    """Findings on voltages, then on the other readings at rest."""
    findings = []
    for kind in LEAST_OFFSET:
        for name in _of_kind(points, kind):
            finding = _finding(name, kind, points, vehicle)
            if finding:
                findings.append(finding)
                points = points.without([name])
    return findings


def _of_kind(points: OperatingPoints, kind: str) -> list[str]:
    return [name for name in points.values if name == kind or name.endswith(f"_{kind}")]


def is_at_rest(points: OperatingPoints, name: str) -> np.ndarray:
    """Where the readings other than `name` say that its side, or the vehicle, stands, (n,).

    Nowhere if neither a command nor a shaft speed says so.
    """
    side = name.partition("_")[0]
    sides = (side,) if side in points.sides else points.sides
    witnesses = {f"{side}_{kind}": kind for side in sides for kind in ("rpm", "voltage", "current")}
    if points.command:
        witnesses[points.command] = "command"
    witnesses = {one: kind for one, kind in witnesses.items() if one in points.values}
    witnesses.pop(name, None)
    if not {"command", "rpm"} & set(witnesses.values()):
        return np.zeros(len(points.log), bool)
    is_at_rest = np.ones(len(points.log), bool)
    for witness, kind in witnesses.items():
        limit = AT_REST[kind] * points.typical(witness)
        is_at_rest &= np.abs(points.values[witness]) <= limit
    return is_at_rest & np.append(False, is_at_rest[:-1])


def value_at_rest(points: OperatingPoints, name: str) -> float:
    """Median of a reading at rest; 0 where that is not known."""
    chosen = is_at_rest(points, name) & np.isfinite(points.values[name])
    return float(np.median(points.values[name][chosen])) if chosen.sum() >= LEAST_POINTS else 0.0


def _finding(name: str, kind: str, points: OperatingPoints, vehicle: VehicleFile) -> Finding | None:
    chosen = is_at_rest(points, name) & np.isfinite(points.values[name])
    if kind in COASTING:
        chosen &= _is_before_start(points)
    typical = points.typical(name)
    if chosen.sum() < LEAST_POINTS or not typical > 0.0:
        return None
    values = points.values[name][chosen]
    median = float(np.median(values))
    low, high = np.percentile(values, [10, 90])
    if high - low > STEADY * abs(median):
        return None
    least = LEAST_OFFSET[kind]
    if kind == "current" and name.replace("current", "voltage") not in points.values:
        least = LEAST_CURRENT_WITHOUT_VOLTAGE
    if abs(median) <= least * typical:
        return None
    unit = CHANNELS[name].unit
    evidence = (
        f"{median:.3g} {unit} at rest ({low:.3g} to {high:.3g} {unit} in {chosen.sum()} points of "
        f"5 s), {100 * abs(median) / typical:.0f} % of the {typical:.3g} {unit} under way"
    )
    column = vehicle.columns[name]
    remedy = f"write offset = {column.offset - median:.3g} in [channels.{name}]"
    if column.times is not None:
        remedy = f"correct offset in [channels.{name}]"
    return Finding((name,), evidence, *_cause(name, kind, median, points, remedy))


def _is_before_start(points: OperatingPoints) -> np.ndarray:
    """Where a log has not been under way yet, (n,)."""
    is_before = np.ones(len(points.log), bool)
    for k in np.unique(points.log):
        is_log = points.log == k
        is_before[is_log] = ~np.maximum.accumulate(points.is_under_way[is_log])
    return is_before


def _cause(
    name: str, kind: str, median: float, points: OperatingPoints, remedy: str
) -> Sequence[str]:
    if kind == "voltage":
        values = points.values[name][points.is_under_way]
        if median > 0.0 and np.nanmedian(values) < (1.0 + SUPPLY_RISE) * median:
            return "is it the supply (battery, bus) and not the motor?", SUPPLY_REMEDY.format(name)
        return "is its offset wrong?", remedy
    if kind == "current" and median > 0.0:
        cause = "is it the current of the battery, with the hotel load?"
        return cause, f"{remedy}, or name the current of the motor"
    if kind == "speed":
        return "is its zero off, or is it the speed over ground in a current?", remedy
    return "is its zero off?", remedy
