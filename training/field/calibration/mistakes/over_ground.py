"""A speed over ground, which a current of the water changes and the load of the shaft does not."""

from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS
from training.field.calibration.mistakes.finding import Finding
from training.field.calibration.mistakes.operating_points import OperatingPoints

LEAST_POINTS = 3  # of a stretch at one speed: 15 s
LEAST_STRETCHES = 8
TURNING = 0.2  # of the largest usual shaft speed, above which the vehicle does not coast
# Spread of the speed at a given shaft speed, relative to the usual speed. A drag that differs by a
# quarter makes half of the first.
LEAST_SPREAD = 0.12
LEAST_SPREAD_WITHOUT_CURRENT = 0.2
MIDDLE = (10.0, 90.0)  # percentiles between which the spread is counted
# Share of the current that falls with the speed through the water at a given shaft speed. The
# torque of a propeller falls by 0.3 to 1 of it with the advance ratio, and is most of the current.
LEAST_FALL = 0.07
# largest spread of a current that has not changed, by that of the speed, and relative to itself
LOAD_BY_SPEED_SPREAD = 1 / 3
LOAD_SPREAD = 0.1


class Stretches(NamedTuple):
    """Medians over the second halves of stretches at one speed, (n,) each."""

    speed: np.ndarray  # m/s
    shaft_speed: np.ndarray  # rpm, mean of the sides
    current: np.ndarray  # A, mean of the sides; NaN if not read


def over_ground_findings(points: OperatingPoints) -> list[Finding]:
    """A finding if the speed by shaft speed varies and the current by shaft speed does not.

    It has to vary without any one of the logs too: that log may be one with another sensor.
    """
    logs = np.unique(points.log)
    parts = [points.without_logs([log]) for log in logs] if len(logs) > 2 else []
    if not all(evidence_of(part) for part in (points, *parts)):
        return []
    cause = "is it the speed over ground, in a current of the water, or did its sensor change?"
    remedy = (
        "name the speed through the water in [channels.speed]; else a current that the logs do "
        "not have will look like drag"
    )
    return [Finding(("speed",), evidence_of(points), cause, remedy)]


def evidence_of(points: OperatingPoints) -> str:
    """How the speed varies at a given shaft speed; empty if no more than through the water."""
    stretches = stretches_of(points)
    if stretches is None or len(stretches.speed) < LEAST_STRETCHES:
        return ""
    error = _residual(stretches.speed, stretches.shaft_speed, degree=1)
    relative = error / np.median(stretches.speed)
    spread = np.ptp(np.percentile(relative, MIDDLE))
    has_current = np.isfinite(stretches.current).all()
    if spread < (LEAST_SPREAD if has_current else LEAST_SPREAD_WITHOUT_CURRENT):
        return ""
    evidence = (
        f"at the same shaft speed it differs by {100 * spread:.0f} % between {len(error)} "
        f"stretches, {np.min(error):+.2g} to {np.max(error):+.2g} {CHANNELS['speed'].unit}"
    )
    if not has_current:
        return evidence
    current = np.median(stretches.current)
    load = _residual(stretches.current, stretches.shaft_speed, degree=2) / current
    load_spread = np.ptp(np.percentile(load, MIDDLE))
    if load_spread > min(LOAD_BY_SPEED_SPREAD * spread, LOAD_SPREAD):
        return ""
    if _fall_with_speed(stretches) > LEAST_FALL * current:
        return ""
    return f"{evidence}, and the current by {100 * load_spread:.0f} %"


def _fall_with_speed(stretches: Stretches) -> float:
    """By how much the current is lower at the median speed than at none [A], as its fit says."""
    shaft = stretches.shaft_speed / np.median(stretches.shaft_speed)
    speed = stretches.speed / np.median(stretches.speed)
    terms = np.stack([np.ones(len(shaft)), shaft, shaft**2, -shaft * speed], axis=1)
    solution, *_ = np.linalg.lstsq(terms, stretches.current, rcond=None)
    return float(solution[-1])


def stretches_of(points: OperatingPoints) -> Stretches | None:
    """The stretches of settled points; None without speed and shaft speed."""
    shafts = [name for name in points.of_motion if name.endswith("rpm")]
    currents = [name for name in points.of_motion if name.endswith("current")]
    if "speed" not in points.values or not shafts:
        return None
    speed = points.values["speed"]
    shaft_speed = np.mean([points.values[name] for name in shafts], axis=0)
    current = np.full(len(speed), np.nan)
    if currents:
        current = np.mean([points.values[name] for name in currents], axis=0)
    is_used = points.is_settled & np.isfinite(speed)
    is_used &= shaft_speed > TURNING * max(map(points.largest, shafts))
    bounds = np.flatnonzero(np.diff(is_used, prepend=False, append=False))
    medians = [
        [np.median(values[(begin + end) // 2 : end]) for values in (speed, shaft_speed, current)]
        for begin, end in zip(bounds[::2], bounds[1::2], strict=True)
        if end - begin >= LEAST_POINTS
    ]
    return Stretches(*np.reshape(medians, (-1, 3)).T)


def _residual(values: np.ndarray, by: np.ndarray, degree: int) -> np.ndarray:
    """Values minus their polynomial of another quantity, (n,)."""
    terms = np.vander(by / np.max(np.abs(by)), degree + 1)
    solution, *_ = np.linalg.lstsq(terms, values, rcond=None)
    return values - terms @ solution
