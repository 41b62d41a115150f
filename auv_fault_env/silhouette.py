"""The vehicle's shape for its pictures: parts in body coordinates, by the component that a fault names, and views."""

import math
from collections.abc import Mapping, Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np

from auv_fault_env.canvas import (
    FAINT,
    INK,
    PALE_WARNING,
    PANEL,
    SIDE_COLOURS,
    STEEL,
    WARNING,
    WARNING_EDGE,
    Canvas,
    Colour,
    Point,
)
from auv_fault_env.channels import READINGS
from auv_fault_env.parameters import SIDES

HULL = (236, 214, 120)
FIN = (206, 176, 70)


class Part(NamedTuple):
    """A part of the vehicle: corners (n, 3) in m, forward, to starboard, down from amidships; drawn as their hull."""

    component: str
    corners: np.ndarray
    colour: Colour


class Projection(NamedTuple):
    """A projection: title and its place, middle [px], scale [px/m], body axes that run right and down the screen."""

    title: str
    label: Point
    middle: Point
    scale: float
    axes: tuple[int, int]

    def project(self, corners: np.ndarray) -> np.ndarray:
        """Screen positions (n, 2) of points (n, 3)."""
        return corners[:, self.axes] * self.scale + self.middle


PROJECTIONS = (
    Projection("from above", (100, 16), (218.0, 68.0), 160.0, (0, 1)),
    Projection("from starboard", (100, 134), (218.0, 170.0), 160.0, (0, 2)),
    Projection("from astern", (440, 16), (546.0, 112.0), 300.0, (1, 2)),
)

SHAFT_OFFSET = dict(zip(SIDES, (-0.11, 0.11), strict=True))  # m, to starboard
# m
PROPELLER_RADIUS = 0.0508
PROPELLER_PLACE = -1.18
SENSOR_PLACES = {
    "speed": (0.92, 0.0, 0.1),
    "acceleration": (0.2, 0.0, 0.0),
    **{f"{side}_voltage": (-0.56, y, 0.0) for side, y in SHAFT_OFFSET.items()},
    **{f"{side}_current": (-0.46, y, 0.0) for side, y in SHAFT_OFFSET.items()},
    **{f"{side}_rpm": (-1.03, y, 0.0) for side, y in SHAFT_OFFSET.items()},
}
AMIDSHIPS = (0.0, 0.0, 0.0)


def _box(low: Point, high: Point) -> np.ndarray:
    return np.stack(np.meshgrid(*zip(low, high, strict=True)), axis=-1).reshape(-1, 3)


def _cube(middle: Point) -> np.ndarray:
    return _box(np.subtract(middle, 0.013), np.add(middle, 0.013))


def _turned(corners: np.ndarray, axis: int, pivot: Point, angle: float) -> np.ndarray:
    """The points turned by the right-hand rule about a body axis through the pivot."""
    first = (axis + 1) % 3
    second = (axis + 2) % 3
    moved = corners - pivot
    a = moved[:, first].copy()
    b = moved[:, second].copy()
    moved[:, first] = a * math.cos(angle) - b * math.sin(angle)
    moved[:, second] = a * math.sin(angle) + b * math.cos(angle)
    return moved + pivot


def _hull() -> np.ndarray:
    """The box of the NPS AUV II, 2.2 m long: stations along the hull with half breadth and half height."""
    stations = ((-1.1, 0.2, 0.045), (-0.72, 0.21, 0.127), (0.72, 0.21, 0.127), (0.9, 0.19, 0.115))
    nose = ((1.0, 0.155, 0.095), (1.07, 0.1, 0.062), (1.1, 0.04, 0.025))
    return np.concatenate([_box((x, -y, -z), (x, y, z)) for x, y, z in stations + nose])


def _fins(rudder: float, plane: float) -> list[np.ndarray]:
    """Stern rudders and planes, and those of the bow, which the vehicle deflects by as much the other way."""
    fins = []
    for x, sign in ((-0.93, 1.0), (0.62, -1.0)):
        for end in (-1.0, 1.0):
            upright = _box((x - 0.11, -0.007, end * 0.085), (x + 0.05, 0.007, end * 0.25))
            level = _box((x - 0.11, end * 0.2, -0.007), (x + 0.05, end * 0.33, 0.007))
            fins += [
                _turned(upright, 2, (x, 0, 0), sign * rudder),
                _turned(level, 1, (x, 0, 0), sign * plane),
            ]
    return fins


def _drive(side: str, angle: float, share: float) -> list[Part]:
    """Motor, shaft with its seal, and the propeller: its swept disc and two blades as long as its share of thrust."""
    y = SHAFT_OFFSET[side]
    x = PROPELLER_PLACE
    radius = PROPELLER_RADIUS
    turns = np.arange(0.0, 2.0 * math.pi, math.pi / 12)
    disc = np.stack(
        [x + 0.005 * (-1) ** np.arange(24), y + radius * np.cos(turns), radius * np.sin(turns)],
        axis=1,
    )
    blades = _box((x - 0.006, y - 0.004, -radius * share), (x + 0.006, y + 0.004, radius * share))
    middle = _box(
        (x - 0.012, y - 0.011, -0.6 * radius * share), (x + 0.012, y + 0.011, 0.6 * radius * share)
    )
    propeller = _turned(np.concatenate([blades, middle]), 0, (x, y, 0), angle)
    return [
        Part(f"motor:{side}", _box((-0.84, y - 0.035, -0.035), (-0.62, y + 0.035, 0.035)), STEEL),
        Part(
            f"shaft:{side}", _box((x - 0.015, y - 0.008, -0.008), (-0.84, y + 0.008, 0.008)), FAINT
        ),
        Part(f"shaft:{side}", _box((-1.13, y - 0.018, -0.018), (-1.08, y + 0.018, 0.018)), FAINT),
        Part(f"propeller:{side}", disc, PANEL),
    ] + [Part(f"propeller:{side}", propeller, SIDE_COLOURS[side])] * (share > 0.02)


def vehicle_parts(
    rudder: float, plane: float, angles: Mapping[str, float], shares: Mapping[str, float]
) -> list[Part]:
    """The hull and all that is on it.

    Args:
        rudder: Deflection [rad], positive to port at the trailing edge of the stern.
        plane: Deflection [rad], positive downwards there.
        angles: Angle of each side's propeller [rad]; the two turn against each other.
        shares: Thrust of each side's propeller relative to a whole one, which is the length of its
        blades; 0 if lost.
    """
    fins = [Part("fins", fin, FIN) for fin in _fins(rudder, plane)]
    sensors = [
        Part(f"sensor:{name}", _cube(SENSOR_PLACES.get(name, AMIDSHIPS)), PANEL)
        for name in READINGS
    ]
    drives = [
        _drive(side, sign * angles[side], shares[side])
        for side, sign in zip(SIDES, (-1.0, 1.0), strict=True)
    ]
    return [Part("hull", _hull(), HULL), *fins, *sensors, *chain.from_iterable(drives)]


def _outline(points: np.ndarray) -> list[Point]:
    """Convex hull of screen points (n, 2), by Andrew's monotone chain."""
    ring: list[Point] = []
    ordered = sorted(set(map(tuple, points.tolist())))
    for run in (ordered, ordered[::-1]):
        start = len(ring)
        for x, y in run:
            while len(ring) >= start + 2:
                (ax, ay), (bx, by) = ring[-2:]
                if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0.0:
                    break
                ring.pop()
            ring.append((x, y))
        ring.pop()
    return ring


def draw_vehicle(canvas: Canvas, view: Projection, parts: Sequence[Part], faulty: set[str]):
    """The parts in one view, the hull first, those of faulty components last and in the warning colour."""
    canvas.text(view.title, view.label, FAINT)
    for part in (parts[0], *sorted(parts[1:], key=lambda part: part.component in faulty)):
        points = view.project(part.corners)
        alarm = part.component in faulty
        reach = np.ptp(points, axis=0).max() / 2
        # what lies in the hull must still stand out
        warning = WARNING if reach < 60 else PALE_WARNING
        canvas.polygon(
            _outline(points), *((warning, WARNING_EDGE) if alarm else (part.colour, INK))
        )
        if alarm and reach < 12:
            canvas.circle(points.mean(axis=0), max(1.5 * reach, 11), WARNING_EDGE, 2)


def draw_ruler(canvas: Canvas, travelled: float):
    """Metres through the water, which pass below the vehicle as it moves."""
    (middle, _) = PROJECTIONS[0].middle
    scale = PROJECTIONS[0].scale
    top = 216
    canvas.line([(16, top), (420, top)], FAINT)
    for half in range(math.ceil(2 * travelled - 2.4), math.floor(2 * travelled + 2.4) + 1):
        x = middle + (half / 2 - travelled) * scale
        canvas.line([(x, top), (x, top + 4 + 3 * (half % 2 == 0))], FAINT)
        if half % 2 == 0:
            canvas.text(f"{half // 2} m", (x, top + 14), FAINT, 0.5)
