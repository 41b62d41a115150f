"""Quantities that have about the same value on every vehicle under water.

A broken one says that a unit or a scale is off.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS
from auv_fault_env.parameters import SIDES
from auv_fault_env.physics import RPM
from training.field.calibration.mistakes.operating_points import MOTOR_KINDS, OperatingPoints

LEAST_POINTS = 6
FAST = 0.5  # of the largest usual reading, above which a point counts

Range = tuple[float, float]
# Largest usual readings of any vehicle, from one carried by hand to one of many tonnes.
MAGNITUDES: dict[str, Range] = {
    "speed": (0.05, 10.0),
    "voltage": (1.0, 600.0),
    "current": (0.01, 500.0),
    "rpm": (20.0, 20e3),
}
# speed per turn and diameter of a propeller that drives a vehicle: a stalled one, and one of great
# pitch
ADVANCE: Range = (0.1, 1.5)
# V s/rad at the shaft: a fast motor of a model boat, and a slow one behind a gear
BACK_EMF: Range = (0.003, 3.0)
# Electric power / (2 pi density n^3 diameter^5): K_Q of a propeller, 0.005 to 0.1, with the losses
# of the motor, and a diameter that is a fifth off.
POWER: Range = (0.002, 1.0)
# W s^3/m^3, electric power / speed^3: half the density times a drag area of 1 cm^2 to 5 m^2, by the
# efficiency
RESISTANCE: Range = (0.1, 1e4)
SIDE_RATIO: Range = (1 / 3, 3.0)  # port by starboard
# speed by command; beyond, one of them is perhaps in another unit
COMMAND_RATIO: Range = (0.6, 1.6)
SAME_RATIO = 0.05  # largest change of that ratio between speeds, relative


class Propeller(NamedTuple):
    """What laws need to know of the vehicle."""

    diameter: float  # m
    density: float  # of the water [kg/m^3]


class Law(NamedTuple):
    """A quantity with the range that is possible."""

    channels: tuple[str, ...]
    name: str
    value: float
    unit: str
    low: float
    high: float

    @property
    def is_broken(self) -> bool:
        """Whether the value is out of its range."""
        return not self.low <= self.value <= self.high

    def __str__(self) -> str:
        value = f"{self.value:.3g} {self.unit}".rstrip()
        return f"{self.name} is {value}, possible is {self.low:.2g} to {self.high:.2g}"


def laws_of(points: OperatingPoints, propeller: Propeller) -> list[Law]:
    """All laws whose readings the points have."""
    laws = list(_magnitudes(points))
    for side in SIDES:
        laws += filter(None, _laws_of_side(points, side, propeller))
    laws += filter(None, (_resistance(points), *_side_ratios(points)))
    return laws


def command_ratio(points: OperatingPoints) -> Law | None:
    """Speed by command; None without them, or where it changes with the speed."""
    names = (points.command or "", "speed")
    readings = _fast(points, names)
    if readings is None:
        return None
    command, speed = readings
    is_high = command > np.median(command)
    ratio = speed / command
    if is_high.any():
        of_speeds = np.median(ratio[is_high]) / np.median(ratio[~is_high])
        if abs(math.log(of_speeds)) > SAME_RATIO:
            return None
    name = f"speed by {points.command}"
    return Law(names, name, float(np.median(ratio)), "", *COMMAND_RATIO)


def advance_length(points: OperatingPoints) -> float | None:
    """Speed per turn [m]; None without speed and shaft speed."""
    for side in SIDES:
        readings = _fast(points, ("speed", f"{side}_rpm"))
        if readings is not None:
            speed, shaft = readings
            return float(np.median(speed / (shaft / 60.0)))
    return None


def _magnitudes(points: OperatingPoints) -> Iterator[Law]:
    for name in points.of_motion:
        kind = "speed" if name == points.command else name.rpartition("_")[2]
        value = points.largest(name)
        if value > 0.0:
            unit = CHANNELS[name].unit
            yield Law((name,), f"the largest usual {name}", value, unit, *MAGNITUDES[kind])


def _laws_of_side(points: OperatingPoints, side: str, propeller: Propeller) -> list[Law | None]:
    rpm, voltage, current = (f"{side}_{kind}" for kind in MOTOR_KINDS)
    size = 2.0 * math.pi * propeller.density * propeller.diameter**5

    def advance(speed: np.ndarray, shaft: np.ndarray) -> np.ndarray:
        return speed / (shaft / 60.0 * propeller.diameter)

    def back_emf(volts: np.ndarray, shaft: np.ndarray) -> np.ndarray:
        return volts / shaft * RPM

    def power(volts: np.ndarray, amperes: np.ndarray, shaft: np.ndarray) -> np.ndarray:
        return volts * amperes / (size * (shaft / 60.0) ** 3)

    advance_name = f"the advance ratio speed / ({rpm} diameter)"
    emf_name = f"{voltage} / {rpm}"
    power_name = f"the torque coefficient {voltage} {current} / (density {rpm}^3 diameter^5)"
    return [
        _law(points, ("speed", rpm), advance_name, "", ADVANCE, advance),
        _law(points, (voltage, rpm), emf_name, "V s/rad", BACK_EMF, back_emf),
        _law(points, (voltage, current, rpm), power_name, "", POWER, power),
    ]


def _resistance(points: OperatingPoints) -> Law | None:
    motors = [f"{side}_{kind}" for side in points.sides for kind in ("voltage", "current")]

    def power(speed: np.ndarray, *motor: np.ndarray) -> np.ndarray:
        pairs = zip(motor[::2], motor[1::2], strict=True)
        return sum(volts * amperes for volts, amperes in pairs) / speed**3

    if not motors:
        return None
    name = "electric power / speed^3"
    return _law(points, ("speed", *motors), name, "W s^3/m^3", RESISTANCE, power)


def _side_ratios(points: OperatingPoints) -> Iterator[Law | None]:
    for kind in MOTOR_KINDS:
        port, starboard = (f"{side}_{kind}" for side in SIDES)
        yield _law(points, (port, starboard), f"{port} / {starboard}", "", SIDE_RATIO, np.divide)


def _law(
    points: OperatingPoints,
    channels: Sequence[str],
    name: str,
    unit: str,
    possible: Range,
    quantity: Callable[..., np.ndarray],
) -> Law | None:
    """The law on the median of a quantity of these channels; None with too few points."""
    readings = _fast(points, channels)
    if readings is None:
        return None
    return Law(tuple(channels), name, float(np.median(quantity(*readings))), unit, *possible)


def _fast(points: OperatingPoints, names: Sequence[str]) -> list[np.ndarray] | None:
    """The readings where all are above half of their largest, (n,) each; None if too few."""
    if not set(names) <= set(points.values):
        return None
    chosen = points.is_settled.copy()
    for name in names:
        chosen &= points.values[name] > FAST * points.largest(name)
    if chosen.sum() < LEAST_POINTS:
        return None
    return [points.values[name][chosen] for name in names]
