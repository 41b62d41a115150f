"""Units that are off: readings that break a law, and the units that would keep all of them."""

import math
from collections.abc import Iterator, Sequence
from itertools import chain
from typing import NamedTuple

from auv_fault_env.channels import CHANNELS
from auv_fault_env.parameters import PRESETS
from training.field.calibration.mistakes.finding import Finding
from training.field.calibration.mistakes.laws import (
    COMMAND_RATIO,
    Law,
    Propeller,
    advance_length,
    command_ratio,
    laws_of,
)
from training.field.calibration.mistakes.operating_points import MOTOR_KINDS, OperatingPoints
from training.field.units import UNITS
from training.field.vehicle_file import Column, VehicleFile, unit_of

# speed by command in the right units, where the controller has an integral part
TRACKED = (0.92, 1.09)
DUTY = 1.05  # largest voltage that may be a duty
USUAL_ADVANCE = 0.6
MOST_LAWS = 3  # in the evidence of a finding


class UnitChange(NamedTuple):
    """A change of unit that may be right."""

    channels: tuple[str, ...]
    unit: str
    factor: float  # on the readings


def unit_findings(points: OperatingPoints, vehicle: VehicleFile) -> list[Finding]:
    """At most one finding: the broken laws, and what would keep all of them."""
    propeller = Propeller(vehicle.vehicle.diameter, vehicle.vehicle.density)
    broken = [law for law in laws_of(points, propeller) if law.is_broken]
    ratio = command_ratio(points)
    is_ratio_off = ratio is not None and ratio.is_broken
    if not broken and not is_ratio_off:
        return []
    limits = TRACKED if is_ratio_off else COMMAND_RATIO
    changed = {
        change: points.scaled(change.channels, change.factor)
        for change in unit_changes(points, vehicle)
    }
    fitting = [change for change, new in changed.items() if _keeps_laws(new, propeller, limits)]
    fitting.sort(key=lambda change: _ratio_error(changed[change]))
    if fitting:
        evidence = [*broken[:MOST_LAWS], *([ratio] if is_ratio_off else [])]
        return [_unit_finding(fitting, evidence, vehicle)]
    # a command that the speed does not reach breaks no law
    return [_other_finding(points, broken, propeller)] if broken else []


def unit_changes(points: OperatingPoints, vehicle: VehicleFile) -> Iterator[UnitChange]:
    """Every other unit of a reading, for both sides together and for one alone."""
    of_both = [
        tuple(f"{side}_{kind}" for side in points.sides if f"{side}_{kind}" in points.values)
        for kind in MOTOR_KINDS
    ]
    of_one = [(name,) for name in points.of_motion]
    for channels in dict.fromkeys(filter(None, chain(of_both, of_one))):
        kind = CHANNELS[channels[0]].unit
        declared = {unit_of(vehicle.columns[name], kind) for name in channels}
        if len(declared) > 1:
            continue
        (now,) = declared
        for unit, factor in UNITS[kind].items():
            if unit != now:
                yield UnitChange(channels, unit, factor / UNITS[kind][now])


def _keeps_laws(points: OperatingPoints, propeller: Propeller, limits: tuple[float, float]) -> bool:
    """Whether all laws hold, and speed by command is within limits."""
    ratio = command_ratio(points)
    low, high = limits
    if ratio is not None and not low <= ratio.value <= high:
        return False
    return not any(law.is_broken for law in laws_of(points, propeller))


def _ratio_error(points: OperatingPoints) -> float:
    ratio = command_ratio(points)
    return abs(math.log(ratio.value)) if ratio else 0.0


def _unit_finding(
    fitting: Sequence[UnitChange], evidence: Sequence[Law], vehicle: VehicleFile
) -> Finding:
    channels = tuple(dict.fromkeys(name for change in fitting for name in change.channels))
    causes = [f"{' and '.join(change.channels)} in {change.unit}" for change in fitting]
    remedies = [_unit_remedy(change, vehicle.columns[change.channels[0]]) for change in fitting]
    verb = "is" if len(fitting[0].channels) == 1 else "are"
    cause = f"{verb} {' or '.join(causes)}?"
    return Finding(channels, "; ".join(map(str, evidence)), cause, " or ".join(remedies))


def _unit_remedy(change: UnitChange, column: Column) -> str:
    tables = " and ".join(f"[channels.{name}]" for name in change.channels)
    if abs(column.scale) in UNITS[CHANNELS[change.channels[0]].unit].values():
        return f'write unit = "{change.unit}" in {tables}'
    return f"multiply scale by {change.factor:.4g} in {tables}"


def _other_finding(points: OperatingPoints, broken: Sequence[Law], propeller: Propeller) -> Finding:
    """A finding on laws that no unit would keep: a duty, a wrong diameter, or another scale."""
    duty = _duty_finding(broken)
    if duty:
        return duty
    evidence = "; ".join(map(str, broken[:MOST_LAWS]))
    diameter = _fitting_diameter(points, propeller)
    if diameter:
        is_preset = propeller.diameter in {preset.diameter for preset in PRESETS.values()}
        source = "the preset's" if is_preset else "in [parameters]"
        cause = f"is the diameter of the propeller, {propeller.diameter:.3g} m ({source}), wrong"
        is_fast = diameter < propeller.diameter
        cause += ", or the shaft speed that of the motor before its gear?" if is_fast else "?"
        remedy = f"write diameter in [parameters]; {diameter:.2g} m would fit"
        return Finding(("diameter",), evidence, cause, remedy)
    channels = tuple(dict.fromkeys(name for law in broken for name in law.channels))
    cause = "is a unit or a scale off, or the shaft speed that of a motor before its gear?"
    remedy = "check unit and scale of these channels, and diameter in [parameters]"
    return Finding(channels, evidence, cause, remedy)


def _duty_finding(broken: Sequence[Law]) -> Finding | None:
    for law in broken:
        name, *others = law.channels
        if not others and name.endswith("voltage") and law.value <= DUTY:
            remedy = f"write times = the column of the supply's voltage in [channels.{name}]"
            return Finding((name,), str(law), "is it a duty from 0 to 1?", remedy)
    return None


def _fitting_diameter(points: OperatingPoints, propeller: Propeller) -> float | None:
    """The diameter of a usual advance ratio, if it keeps all laws."""
    length = advance_length(points)
    if length is None:
        return None
    fitting = propeller._replace(diameter=length / USUAL_ADVANCE)
    is_broken = any(law.is_broken for law in laws_of(points, fitting))
    return None if is_broken else fitting.diameter
