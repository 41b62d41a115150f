"""All checks, in an order in which one mistake is found once."""

from collections.abc import Collection, Sequence

from diagnosers.relations.windows import BALANCE, PUSH
from training.field.calibration.mistakes.acceleration import acceleration_findings
from training.field.calibration.mistakes.columns import column_findings
from training.field.calibration.mistakes.differences import difference_findings
from training.field.calibration.mistakes.dropouts import dropout_findings
from training.field.calibration.mistakes.finding import Finding
from training.field.calibration.mistakes.fins import fin_findings
from training.field.calibration.mistakes.following import following_findings
from training.field.calibration.mistakes.operating_points import operating_points
from training.field.calibration.mistakes.over_ground import over_ground_findings
from training.field.calibration.mistakes.recordings import recording_findings
from training.field.calibration.mistakes.rest import rest_findings
from training.field.calibration.mistakes.sampling import sampling_findings
from training.field.calibration.mistakes.sides import swap_findings
from training.field.calibration.mistakes.signs import sign_findings
from training.field.calibration.mistakes.stuck import stuck_findings
from training.field.calibration.mistakes.units import unit_findings
from training.field.logs.log import Log
from training.field.vehicle_file import VehicleFile


def find_mistakes(logs: Sequence[Log], vehicle: VehicleFile) -> list[Finding]:
    """Likely mistakes in the vehicle file, and healthy logs that are perhaps none.

    A channel or a log with a finding is left out of the later checks, so that one mistake is found
    once.
    """
    points = operating_points(logs, vehicle)
    names = [log.name for log in logs]
    checks = (
        lambda _: column_findings(logs, vehicle),
        lambda _: sampling_findings(logs, vehicle),
        lambda _: fin_findings(logs, vehicle),
        lambda _: recording_findings(logs),
        lambda points: dropout_findings(logs, points),
        lambda points: sign_findings(points, vehicle),
        lambda points: rest_findings(points, vehicle),
        following_findings,
        lambda points: stuck_findings(points, names),
        swap_findings,
    )
    findings = []
    for check in checks:
        found = check(points)
        points = points.without(name for one in found if not one.log for name in one.channels)
        points = points.without_logs(names.index(one.log) for one in found if one.log)
        findings += found
    of_units = unit_findings(points, vehicle)
    in_right_units = points.without(name for one in of_units for name in one.channels)
    findings += [
        *of_units,
        *acceleration_findings(in_right_units, vehicle),
        *over_ground_findings(points),
    ]
    in_doubt = set(vehicle.columns) - set(points.values)
    return findings + _difference_findings(logs, vehicle, findings, in_doubt)


def _difference_findings(
    logs: Sequence[Log],
    vehicle: VehicleFile,
    findings: Sequence[Finding],
    in_doubt: Collection[str],
) -> list[Finding]:
    """Findings on logs without one, by relations without the channels in doubt."""
    kinds = {name.rpartition("_")[2] for name in in_doubt}
    if kinds & {"speed", "rpm", "current", "command"}:
        return []
    left_out = {"voltage", BALANCE} if "voltage" in kinds else set()
    if any("speed" in one.channels for one in findings):
        left_out.add(PUSH)
    named = {one.log for one in findings}
    return difference_findings([log for log in logs if log.name not in named], vehicle, left_out)
