"""Columns that serve two channels, and readings that are copies of others."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from auv_fault_env.channels import INDEX
from auv_fault_env.parameters import SIDES
from training.field.calibration.mistakes.finding import Finding
from training.field.calibration.mistakes.operating_points import COMMAND_NAMES
from training.field.logs.log import Log
from training.field.vehicle_file import VehicleFile

EQUAL = 0.99  # share of equal values from which two channels are one


def column_findings(logs: Sequence[Log], vehicle: VehicleFile) -> list[Finding]:
    """Findings on channels that are the same column, or have the same values."""
    rows = np.concatenate([log.observation for log in logs])
    findings = []
    for one, other in combinations(sorted(vehicle.columns, key=INDEX.get), 2):
        if _may_share(one, other):
            continue
        names = vehicle.columns[one].names
        if names == vehicle.columns[other].names:
            findings.append(_finding(one, other, f"both are the column {names[0]!r}"))
        elif not _is_voltage_pair(one, other):
            share = equal_share(rows[:, INDEX[one]], rows[:, INDEX[other]])
            if share > EQUAL:
                evidence = f"their values are equal in {100 * share:.0f} % of the rows"
                findings.append(_finding(one, other, evidence))
    return findings + _absent_side(vehicle)


def equal_share(one: np.ndarray, other: np.ndarray) -> float:
    """Share of equal values (n,) where both are read and not both zero; 0 for constant ones."""
    is_known = np.isfinite(one) & np.isfinite(other) & ((one != 0.0) | (other != 0.0))
    if not is_known.any() or np.ptp(one[is_known]) == 0.0:
        return 0.0
    return float(np.mean(one[is_known] == other[is_known]))


def _may_share(one: str, other: str) -> bool:
    """Whether one column may serve both: two commands, or a motor command as voltage and rpm."""
    if {one, other} <= set(COMMAND_NAMES):
        return True
    return any({one, other} == {f"{side}_voltage", f"{side}_rpm"} for side in SIDES)


def _is_voltage_pair(one: str, other: str) -> bool:
    """Whether equal values are usual: one command may drive both shafts."""
    return {one, other} == {f"{side}_voltage" for side in SIDES}


def _finding(first: str, second: str, evidence: str) -> Finding:
    remedy = f"correct column in [channels.{second}], or leave the channel out"
    if {first, second} & set(COMMAND_NAMES):
        cause = f"is {second} the command and no measurement?"
        return Finding((first, second), evidence, cause, remedy, is_fatal=second == "speed")
    if _is_voltage_pair(first, second):
        cause = "does one command drive both shafts? Else a column is named twice"
    elif {first, second} == {f"{side}_current" for side in SIDES}:
        cause = "is it the current of both motors? Then a fault cannot be assigned to a side"
    else:
        cause = "is a column named twice?"
    return Finding((first, second), evidence, cause, remedy)


def _absent_side(vehicle: VehicleFile) -> list[Finding]:
    sides = {name.partition("_")[0] for name in vehicle.columns} & set(SIDES)
    if vehicle.shafts == len(SIDES) and sides == {SIDES[0]}:
        evidence = "shafts = 2, and no channel of the starboard side"
        cause = "has the vehicle one shaft?"
        return [Finding(("shafts",), evidence, cause, "write shafts = 1 in [vehicle]")]
    return []
