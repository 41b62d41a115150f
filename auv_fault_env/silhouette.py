"""The shape of the vehicle in pictures: parts in body coordinates, and projections."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from auv_fault_env import palette
from auv_fault_env.canvas import Canvas, Point
from auv_fault_env.parameters import SIDES


class Part(NamedTuple):
    """A part of the vehicle, drawn as the convex hull of its corners."""

    component: str  # as in `Fault`
    corners: np.ndarray  # (n, 3) [m]: forward, to starboard, down from amidships
    colour: palette.Colour


class Projection(NamedTuple):
    """A projection: body axes that run right and down the screen, centre [px], scale [px/m]."""

    title: str
    label: Point
    centre: Point
    scale: float
    axes: tuple[int, int]

    def project(self, corners: np.ndarray) -> np.ndarray:
        """Screen positions (n, 2) of points (n, 3)."""
        return corners[:, self.axes] * self.scale + self.centre


PROJECTIONS = (
    Projection("from above", (100, 16), (218.0, 68.0), 160.0, (0, 1)),
    Projection("from starboard", (100, 134), (218.0, 170.0), 160.0, (0, 2)),
    Projection("from astern", (440, 16), (546.0, 112.0), 300.0, (1, 2)),
)

SHAFT_OFFSET = dict(zip(SIDES, (-0.11, 0.11), strict=True))  # m, to starboard; 0 if alone
# m
PROPELLER_RADIUS = 0.0508
PROPELLER_PLACE = -1.18


def _sensor_places(shaft_offsets: Mapping[str, float]) -> dict[str, Point]:
    """Places of the sensors by reading [m], from the offset of each side's shaft."""
    places: dict[str, Point] = {"speed": (0.92, 0.0, 0.1), "acceleration": (0.2, 0.0, 0.0)}
    for side, y in shaft_offsets.items():
        places[f"{side}_voltage"] = (-0.56, y, 0.0)
        places[f"{side}_current"] = (-0.46, y, 0.0)
        places[f"{side}_rpm"] = (-1.03, y, 0.0)
    return places


def _box(low: Point, high: Point) -> np.ndarray:
    """Corners (8, 3) of a box."""
    coordinates = np.meshgrid(*zip(low, high, strict=True))
    return np.stack(coordinates, axis=-1).reshape(-1, 3)


def _turned(corners: np.ndarray, axis: int, pivot: Point, angle: float) -> np.ndarray:
    """The points turned by the right-hand rule about a body axis through the pivot."""
    first = (axis + 1) % 3
    second = (axis + 2) % 3
    turned = corners - pivot
    a = turned[:, first].copy()
    b = turned[:, second].copy()
    cosine = math.cos(angle)
    sine = math.sin(angle)
    turned[:, first] = a * cosine - b * sine
    turned[:, second] = a * sine + b * cosine
    return turned + pivot


def _hull() -> np.ndarray:
    """The hull of the NPS AUV II, 2.2 m long, from half breadth and half height of its stations."""
    stations = (
        (-1.1, 0.2, 0.045),
        (-0.72, 0.21, 0.127),
        (0.72, 0.21, 0.127),
        (0.9, 0.19, 0.115),
        (1.0, 0.155, 0.095),
        (1.07, 0.1, 0.062),
        (1.1, 0.04, 0.025),
    )
    sections = []
    for x, y, z in stations:
        section = _box((x, -y, -z), (x, y, z))
        sections.append(section)
    return np.concatenate(sections)


def _fins(rudder: float, plane: float) -> list[np.ndarray]:
    """Rudders and planes of the stern, and those of the bow, which deflect the other way."""
    fins = []
    for x, sign in ((-0.93, 1.0), (0.62, -1.0)):
        for end in (-1.0, 1.0):
            astern = x - 0.11
            ahead = x + 0.05
            upright = _box((astern, -0.007, end * 0.085), (ahead, 0.007, end * 0.25))
            level = _box((astern, end * 0.2, -0.007), (ahead, end * 0.33, 0.007))
            fins.append(_turned(upright, 2, (x, 0, 0), sign * rudder))
            fins.append(_turned(level, 1, (x, 0, 0), sign * plane))
    return fins


def _disc(x: float, y: float, radius: float) -> np.ndarray:
    """Points (24, 3) around a thin disc across the shaft at (x, y)."""
    turns = np.arange(0.0, 2.0 * math.pi, math.pi / 12)
    along = x + 0.005 * (-1) ** np.arange(24)
    across = y + radius * np.cos(turns)
    down = radius * np.sin(turns)
    return np.stack([along, across, down], axis=1)


def _blades(x: float, y: float, radius: float) -> np.ndarray:
    """Corners of two upright blades of that radius, which are widest in the middle."""
    tips = _box((x - 0.006, y - 0.004, -radius), (x + 0.006, y + 0.004, radius))
    inner = 0.6 * radius
    middle = _box((x - 0.012, y - 0.011, -inner), (x + 0.012, y + 0.011, inner))
    return np.concatenate([tips, middle])


def _drive(side: str, y: float, angle: float, thrust: float) -> list[Part]:
    """Motor, shaft with its seal, swept disc and blades, whose length shows the relative thrust."""
    x = PROPELLER_PLACE
    motor = _box((-0.84, y - 0.035, -0.035), (-0.62, y + 0.035, 0.035))
    shaft = _box((x - 0.015, y - 0.008, -0.008), (-0.84, y + 0.008, 0.008))
    seal = _box((-1.13, y - 0.018, -0.018), (-1.08, y + 0.018, 0.018))
    parts = [
        Part(f"motor:{side}", motor, palette.STEEL),
        Part(f"shaft:{side}", shaft, palette.FAINT),
        Part(f"shaft:{side}", seal, palette.FAINT),
        Part(f"propeller:{side}", _disc(x, y, PROPELLER_RADIUS), palette.PANEL),
    ]
    if thrust > 0.02:
        blades = _blades(x, y, PROPELLER_RADIUS * thrust)
        blades = _turned(blades, 0, (x, y, 0), angle)
        parts.append(Part(f"propeller:{side}", blades, palette.SIDES[side]))
    return parts


def vehicle_parts(
    rudder: float,
    plane: float,
    angles: Mapping[str, float],
    shares: Mapping[str, float],
) -> list[Part]:
    """The hull and all parts on it.

    Parameters
    ----------
    rudder
        Deflection of the stern rudders [rad], positive to port at the trailing edge.
    plane
        Deflection of the stern planes [rad], positive downwards at the trailing edge.
    angles
        Angle of the propeller of each side that has one [rad]; two turn against each other.
    shares
        Thrust of each side relative to a whole propeller, 0 if lost.
    """
    hull = Part("hull", _hull(), palette.HULL)
    fins = [Part("fins", fin, palette.FIN) for fin in _fins(rudder, plane)]
    sensors = []
    offsets = SHAFT_OFFSET if len(angles) > 1 else dict.fromkeys(angles, 0.0)
    for name, place in _sensor_places(offsets).items():
        centre = np.array(place)
        cube = _box(centre - 0.013, centre + 0.013)
        sensors.append(Part(f"sensor:{name}", cube, palette.PANEL))
    drives = []
    for side, y in offsets.items():
        sense = -1.0 if side == "port" else 1.0
        drives += _drive(side, y, sense * angles[side], shares[side])
    return [hull, *fins, *sensors, *drives]


def _turns_right(first: Point, second: Point, third: Point) -> bool:
    """Whether the way along three points turns right on the screen."""
    ax, ay = first
    bx, by = second
    cx, cy = third
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) > 0.0


def _outline(points: np.ndarray) -> list[Point]:
    """Convex hull of screen points (n, 2), by Andrew's monotone chain."""
    ring: list[Point] = []
    ordered = sorted(set(map(tuple, points.tolist())))
    for run in (ordered, ordered[::-1]):
        start = len(ring)
        for x, y in run:
            while len(ring) >= start + 2 and not _turns_right(ring[-2], ring[-1], (x, y)):
                ring.pop()
            ring.append((x, y))
        ring.pop()
    return ring


def draw_vehicle(canvas: Canvas, projection: Projection, parts: Sequence[Part], faulty: set[str]):
    """Draw the hull first, the parts of faulty components last and in the colour of a warning."""
    canvas.text(projection.title, projection.label, palette.FAINT)
    hull, *others = parts
    for part in (hull, *sorted(others, key=lambda part: part.component in faulty)):
        points = projection.project(part.corners)
        outline = _outline(points)
        if part.component not in faulty:
            canvas.polygon(outline, part.colour, palette.INK)
            continue
        reach = np.ptp(points, axis=0).max() / 2
        # parts within a faulty hull must still stand out
        canvas.polygon(
            outline,
            palette.WARNING if reach < 60 else palette.PALE_WARNING,
            palette.WARNING_EDGE,
        )
        if reach < 12:
            radius = max(1.5 * reach, 11)
            canvas.circle(points.mean(axis=0), radius, palette.WARNING_EDGE, 2)


def draw_ruler(canvas: Canvas, travelled: float):
    """Draw metres through the water, which pass below the vehicle as it moves."""
    from_above = PROJECTIONS[0]
    top = 216
    canvas.line([(16, top), (420, top)], palette.FAINT)
    first = math.ceil(2 * travelled - 2.4)
    last = math.floor(2 * travelled + 2.4)
    for half_metre in range(first, last + 1):
        is_metre = half_metre % 2 == 0
        x = from_above.centre[0] + (half_metre / 2 - travelled) * from_above.scale
        canvas.line([(x, top), (x, top + 4 + 3 * is_metre)], palette.FAINT)
        if is_metre:
            canvas.text(f"{half_metre // 2} m", (x, top + 14), palette.FAINT, 0.5)
