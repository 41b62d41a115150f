"""Frames of `PropulsionEnv`: the vehicle in three views with its faulty parts, and strip charts of the last minute.

Everything follows from the channels, the catalogue and the truth: a new fault shows on the part that its `component`
names, and in the caption, without an edit here. Nothing is drawn of a fault before it strikes.
"""

import math
import os
import warnings
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

from auv_fault_env.channels import CHANNELS, MAXIMUM_COMMAND, READINGS
from auv_fault_env.faults import CATALOGUE
from auv_fault_env.parameters import SAMPLE_RATE, SIDES

Colour = tuple[int, int, int]
Point = Sequence[float]

SIZE = (960, 640)  # px
WINDOW = 60.0  # s, length of the strip charts
SLOW_MOTION = 20.0  # propellers turn on the screen this much slower, or ten frames a second would show them stand still

PAPER, PANEL, INK, FAINT, GRID = (250, 251, 252), (255, 255, 255), (33, 41, 52), (112, 121, 133), (226, 231, 236)
HULL, STEEL, FIN = (236, 214, 120), (150, 160, 172), (206, 176, 70)
PORT, STARBOARD = (200, 32, 48), (0, 132, 72)  # the nautical side lights
BLUE, VIOLET = (30, 104, 196), (142, 68, 190)
WARNING, WARNING_EDGE = (255, 152, 20), (196, 84, 0)
SIDE_COLOURS = dict(zip(SIDES, (PORT, STARBOARD), strict=True))


class Trace(NamedTuple):
    """One line of a strip chart."""

    channel: str
    name: str
    colour: Colour
    width: int = 1


class Chart(NamedTuple):
    """One strip chart: traces in one unit."""

    title: str
    unit: str
    traces: tuple[Trace, ...]


def _pair(title: str, quantity: str) -> Chart:
    traces = tuple(Trace(f"{side}_{quantity}", side, SIDE_COLOURS[side]) for side in SIDES)
    return Chart(title, CHANNELS[traces[0].channel].unit, traces)


TRUE_SPEED = "true_speed"
COLUMNS = {name: column for column, name in enumerate(("time", *CHANNELS, TRUE_SPEED))}
CHARTS = (
    Chart(
        "speed",
        "m/s",
        (
            Trace("speed", "measured", INK),
            Trace("mission_speed", "mission", STEEL, 2),
            Trace("speed_command", "command", BLUE, 2),
            Trace(TRUE_SPEED, "true", VIOLET),
        ),
    ),
    _pair("shaft speed", "rpm"),
    Chart("acceleration", "m/s²", (Trace("acceleration", "measured", INK),)),
    _pair("motor voltage", "voltage"),
    Chart("deflection", "rad", (Trace("rudder", "rudder", BLUE, 2), Trace("stern_plane", "stern plane", VIOLET, 2))),
    _pair("motor current", "current"),
)


class Part(NamedTuple):
    """A part of the vehicle: corners (n, 3) in m, forward, to starboard and down from amidships; drawn as their hull."""

    component: str
    corners: np.ndarray
    colour: Colour


class View(NamedTuple):
    """A projection: title, middle [px], scale [px/m], and the body axes that run to the right and down the screen."""

    title: str
    middle: Point
    scale: float
    axes: tuple[int, int]

    def project(self, corners: np.ndarray) -> np.ndarray:
        """Screen positions (n, 2) of points (n, 3)."""
        return corners[:, self.axes] * self.scale + self.middle


ABOVE = View("from above", (212.0, 66.0), 162.0, (0, 1))
BESIDE = View("from starboard", (212.0, 167.0), 162.0, (0, 2))
ASTERN = View("from astern", (542.0, 104.0), 300.0, (1, 2))

SHAFT_OFFSET = dict(zip(SIDES, (-0.11, 0.11), strict=True))  # m, to starboard
PROPELLER_RADIUS, PROPELLER_PLACE = 0.0508, -1.18  # m
SENSOR_PLACES = {
    "speed": (0.92, 0.0, 0.1),
    "acceleration": (0.2, 0.0, 0.0),
    **{f"{side}_voltage": (-0.56, y, 0.0) for side, y in SHAFT_OFFSET.items()},
    **{f"{side}_current": (-0.46, y, 0.0) for side, y in SHAFT_OFFSET.items()},
    **{f"{side}_rpm": (-0.95, y, 0.0) for side, y in SHAFT_OFFSET.items()},
}
AMIDSHIPS = (0.0, 0.0, 0.0)


def _box(low: Point, high: Point) -> np.ndarray:
    return np.stack(np.meshgrid(*zip(low, high, strict=True)), axis=-1).reshape(-1, 3)


def _turned(corners: np.ndarray, axis: int, pivot: Point, angle: float) -> np.ndarray:
    """The points turned by the right-hand rule about a body axis through the pivot."""
    first, second = (axis + 1) % 3, (axis + 2) % 3
    moved = corners - pivot
    a, b = moved[:, first].copy(), moved[:, second].copy()
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
            fins += [_turned(upright, 2, (x, 0, 0), sign * rudder), _turned(level, 1, (x, 0, 0), sign * plane)]
    return fins


def _drive(side: str, angle: float, share: float) -> list[Part]:
    """Motor, shaft with its seal, and the propeller: its swept disc and two blades as long as its share of thrust."""
    y, x, radius = SHAFT_OFFSET[side], PROPELLER_PLACE, PROPELLER_RADIUS
    turns = np.arange(0.0, 2.0 * math.pi, math.pi / 12)
    disc = np.stack([np.full(turns.size, x), y + radius * np.cos(turns), radius * np.sin(turns)], axis=1)
    blades = _box((x - 0.006, y - 0.004, -radius * share), (x + 0.006, y + 0.004, radius * share))
    middle = _box((x - 0.012, y - 0.011, -0.6 * radius * share), (x + 0.012, y + 0.011, 0.6 * radius * share))
    propeller = _turned(np.concatenate([blades, middle]), 0, (x, y, 0), angle)
    parts = [
        Part(f"motor:{side}", _box((-0.84, y - 0.035, -0.035), (-0.62, y + 0.035, 0.035)), STEEL),
        Part(f"shaft:{side}", _box((x - 0.015, y - 0.008, -0.008), (-0.84, y + 0.008, 0.008)), FAINT),
        Part(f"shaft:{side}", _box((-1.13, y - 0.018, -0.018), (-1.08, y + 0.018, 0.018)), FAINT),
        Part(f"propeller:{side}", disc, PANEL),
    ]
    return parts + [Part(f"propeller:{side}", propeller, SIDE_COLOURS[side])] * (share > 0.02)


def _outline(points: np.ndarray) -> list[Point]:
    """Convex hull of screen points (n, 2), by Andrew's monotone chain."""
    chain: list[Point] = []
    ordered = sorted(set(map(tuple, points.tolist())))
    for run in (ordered, ordered[::-1]):
        start = len(chain)
        for x, y in run:
            while len(chain) >= start + 2:
                (ax, ay), (bx, by) = chain[-2:]
                if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0.0:
                    break
                chain.pop()
            chain.append((x, y))
        chain.pop()
    return chain


def ticks(low: float, high: float, intervals: int = 4) -> np.ndarray:
    """Multiples of 1, 2 or 5 times a power of ten that enclose the range in at most `intervals` + 1 steps.

    >>> ticks(0.12, 0.87)
    array([0. , 0.2, 0.4, 0.6, 0.8, 1. ])
    """
    wanted = (high - low) / intervals
    power = 10.0 ** math.floor(math.log10(wanted))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= 0.999 * wanted)
    return np.arange(math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9) + 1) * step


def _pygame():
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # pygame looks for pkg_resources, which warns
            import pygame
    except ImportError as error:
        remedy = 'pip install "auv-fault[render]"'
        raise gym.error.DependencyNotInstalled(f"pygame: got no such package; rendering needs it; {remedy}") from error
    return pygame


class Canvas:
    """A surface off screen with the few strokes that a frame needs. It opens no display."""

    def __init__(self, size: tuple[int, int]):
        self._pygame = _pygame()
        self.surface = self._pygame.Surface(size, depth=32)
        self._fonts: dict[int, Any] = {}
        self._texts: dict[tuple, Any] = {}

    def polygon(self, points: Sequence[Point], fill: Colour, edge: Colour):
        """A filled polygon with a smooth edge."""
        self._pygame.draw.polygon(self.surface, fill, points)
        self._pygame.draw.aalines(self.surface, edge, True, points)

    def line(self, points: Sequence[Point], colour: Colour, width: int = 1):
        """A line through at least two points, smooth if it is thin."""
        if width == 1:
            self._pygame.draw.aalines(self.surface, colour, False, points)
        else:
            self._pygame.draw.lines(self.surface, colour, False, points, width)

    def circle(self, middle: Point, radius: float, colour: Colour, width: int = 0):
        """A disc, or a ring of that width."""
        self._pygame.draw.circle(self.surface, colour, middle, radius, width)

    def box(self, left: float, top: float, width: float, height: float, fill: Colour, radius: int = 0):
        """A filled rectangle with rounded corners."""
        self._pygame.draw.rect(self.surface, fill, (left, top, width, height), border_radius=radius)

    def text(self, words: str, place: Point, colour: Colour = INK, align: float = 0.0, size: int = 17) -> float:
        """Words whose middle height is at `place`, left (0), centred (0.5) or right (1) of it; their right edge."""
        if (words, colour, size) not in self._texts:
            if len(self._texts) > 1000:
                self._texts.clear()
            self._texts[words, colour, size] = self._drawn(words, colour, size)
        text = self._texts[words, colour, size]
        left = place[0] - align * text.get_width()
        self.surface.blit(text, (round(left), round(place[1] - text.get_height() / 2)))
        return left + text.get_width()

    def _drawn(self, words: str, colour: Colour, size: int):
        try:
            return self._fonts[size].render(words, True, colour)
        except (KeyError, self._pygame.error):  # a new size, or another user of pygame has quit its fonts
            self._pygame.font.init()
            self._fonts[size] = self._pygame.font.Font(None, size)
            return self._fonts[size].render(words, True, colour)

    def pixels(self) -> np.ndarray:
        """A copy of the surface, (height, width, 3) uint8."""
        pixels = self._pygame.image.tobytes(self.surface, "RGB")
        return np.frombuffer(bytearray(pixels), np.uint8).reshape(*self.surface.get_size()[::-1], 3)
