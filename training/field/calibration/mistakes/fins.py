"""Deflections that no fin has."""

from collections.abc import Sequence

import numpy as np

from auv_fault_env.channels import INDEX
from training.field.calibration.mistakes.finding import Finding
from training.field.logs.log import Log
from training.field.vehicle_file import VehicleFile

STEEPEST = 1.2  # rad, 70 degrees: the largest deflection of any fin
FINS = ("rudder", "stern_plane")


def fin_findings(logs: Sequence[Log], vehicle: VehicleFile) -> list[Finding]:
    """Findings on fins that are deflected further than any fin."""
    findings = []
    for name in filter(vehicle.columns.__contains__, FINS):
        column = np.concatenate([log.observation[:, INDEX[name]] for log in logs])
        largest = np.max(np.abs(column), initial=0.0, where=np.isfinite(column))
        if largest > STEEPEST:
            evidence = f"deflected by up to {largest:.3g} rad"
            remedy = f'write unit = "deg" in [channels.{name}]'
            findings.append(Finding((name,), evidence, "is it in deg?", remedy))
    return findings
