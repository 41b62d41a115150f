"""Frames of `PropulsionEnv`: the vehicle in three views with its faulty parts, and strip charts of the last minute.

Everything follows from the channels, the catalogue and the truth: a new fault shows on the part that its `component`
names, and in the caption, without an edit here. Nothing is drawn of a fault before it strikes.
"""

import math
import os
import warnings
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

from auv_fault_env.channels import CHANNELS, MAXIMUM_COMMAND
from auv_fault_env.faults import CATALOGUE
from auv_fault_env.parameters import SAMPLE_RATE, SIDES
from auv_fault_env.silhouette import (
    BLUE,
    FAINT,
    GRID,
    INK,
    PANEL,
    PAPER,
    SIDE_COLOURS,
    STEEL,
    VIEWS,
    VIOLET,
    WARNING,
    Colour,
    Point,
    draw_ruler,
    draw_vehicle,
    vehicle_parts,
)

SIZE = (960, 640)  # px
SMALL, MEDIUM, LARGE = 16, 18, 24  # sizes of the text
WINDOW = 60.0  # s, length of the strip charts
SLOW_MOTION = 20.0  # propellers turn on the screen this much slower, or ten frames a second would show them stand still


class Trace(NamedTuple):
    """One line of a strip chart."""

    channel: str
    name: str
    colour: Colour
    width: int = 1


def _pair(quantity: str) -> tuple[Trace, ...]:
    return tuple(Trace(f"{side}_{quantity}", side, SIDE_COLOURS[side]) for side in SIDES)


TRUE_SPEED = "true_speed"
COLUMNS = {name: column for column, name in enumerate(("time", *CHANNELS, TRUE_SPEED))}
SPEEDS = (
    Trace("speed", "measured", INK),
    Trace("mission_speed", "mission", STEEL, 4),
    Trace("speed_command", "command", BLUE, 2),
    Trace(TRUE_SPEED, "true", VIOLET),
)
DEFLECTIONS = (Trace("rudder", "rudder", BLUE, 4), Trace("stern_plane", "stern plane", VIOLET, 2))
CHARTS = {
    "speed": SPEEDS,
    "shaft speed": _pair("rpm"),
    "acceleration": (Trace("acceleration", "measured", INK),),
    "motor voltage": _pair("voltage"),
    "deflection": DEFLECTIONS,
    "motor current": _pair("current"),
}


def ticks(low: float, high: float, intervals: int = 4) -> np.ndarray:
    """Multiples of 1, 2 or 5 times a power of ten that enclose the range, but for 2 % of a step.

    >>> ticks(0.12, 0.87)
    array([0. , 0.2, 0.4, 0.6, 0.8, 1. ])
    """
    wanted = (high - low) / intervals
    power = 10.0 ** math.floor(math.log10(wanted))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= 0.999 * wanted)
    return np.arange(math.floor(low / step + 0.02), math.ceil(high / step - 0.02) + 1) * step


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

    def __init__(self):
        self.pygame = _pygame()
        self.surface = self.pygame.Surface(SIZE, depth=32)
        self._fonts: dict[int, Any] = {}
        self._texts: dict[tuple, Any] = {}

    @contextmanager
    def fresh(self):
        """A new sheet. Fonts live no longer than it: an older one crashes after another user's `pygame.quit()`."""
        self.pygame.font.init()
        self._fonts = {size: self.pygame.font.Font(None, size) for size in (SMALL, MEDIUM, LARGE)}
        self.surface.fill(PAPER)
        try:
            yield
        finally:
            self._fonts.clear()

    def polygon(self, points: Sequence[Point], fill: Colour, edge: Colour):
        """A filled polygon with a smooth edge."""
        self.pygame.draw.polygon(self.surface, fill, points)
        self.pygame.draw.aalines(self.surface, edge, True, points)

    def line(self, points: Sequence[Point], colour: Colour, width: int = 1):
        """A line through two points or more, smooth if thin."""
        if width == 1:
            self.pygame.draw.aalines(self.surface, colour, False, points)
        else:
            self.pygame.draw.lines(self.surface, colour, False, points, width)

    def circle(self, middle: Point, radius: float, colour: Colour, width: int = 0):
        """A disc, or a ring of that width."""
        self.pygame.draw.circle(self.surface, colour, middle, radius, width)

    def box(self, left: float, top: float, width: float, height: float, fill: Colour, radius: int = 0):
        """A filled rectangle with rounded corners."""
        self.pygame.draw.rect(self.surface, fill, (left, top, width, height), border_radius=radius)

    def width(self, words: str) -> int:
        """Width of words of medium size [px]."""
        return self._text(words, INK, MEDIUM).get_width()

    def text(self, words: str, place: Point, colour: Colour = INK, align: float = 0.0, size: int = MEDIUM):
        """Words whose middle height is at `place`, to the right of it (align 0), centred (0.5) or to the left (1)."""
        text = self._text(words, colour, size)
        self.surface.blit(text, (round(place[0] - align * text.get_width()), round(place[1] - text.get_height() / 2)))

    def _text(self, words: str, colour: Colour, size: int):
        if len(self._texts) > 1000:
            self._texts.clear()
        if (words, colour, size) not in self._texts:
            self._texts[words, colour, size] = self._fonts[size].render(words, True, colour)
        return self._texts[words, colour, size]


def _draw_gauge(canvas: Canvas, row: Mapping[str, float]):
    """The scale of speed: the true one as a bar, the reading as a line, mission and command as marks at its edges."""
    left, width, top = 678.0, 258.0, 74.0
    marks = ticks(0.0, max(MAXIMUM_COMMAND, row[TRUE_SPEED]))
    places = {
        name: left + width * min(max(row[name] / marks[-1], 0.0), 1.0) for name in (trace.channel for trace in SPEEDS)
    }
    canvas.text(f"{row['speed']:.2f} m/s measured", (left, 52), size=LARGE)
    canvas.box(left, top, width, 12, GRID)
    canvas.box(left, top, places[TRUE_SPEED] - left, 12, VIOLET)
    canvas.box(places["speed"] - 1, top - 2, 2, 16, INK)
    for name, colour, y, tip in (
        ("speed_command", BLUE, top - 5, top + 3),
        ("mission_speed", STEEL, top + 17, top + 9),
    ):
        canvas.polygon([(places[name] - 4, y), (places[name] + 4, y), (places[name], tip)], colour, INK)
    for mark in marks:
        canvas.text(f"{mark:.1f}", (left + width * mark / marks[-1], top + 24), FAINT, 0.5, SMALL)


def _draw_caption(canvas: Canvas, time: float, faults: Sequence[tuple[str, float, float]]):
    """Time, and a table of the faults in force: class, severity, since when."""
    for side, x in zip(SIDES, (513, 579), strict=True):
        canvas.text(side, (x, 204), SIDE_COLOURS[side], 0.5)
    canvas.text("NPS AUV II", (674, 18), size=LARGE)
    canvas.text(f"{time:.1f} s", (946, 18), size=LARGE, align=1.0)
    for words, x, align in (("fault" if faults else "no fault", 674, 0), ("severity", 896, 1), ("since", 946, 1)):
        canvas.text(words if faults or x == 674 else "", (x, 122), FAINT, align)
    shown = 5 if len(faults) <= 5 else 4
    for line, (name, severity, since) in enumerate(faults[:shown]):
        y = 142 + 20 * line
        canvas.box(668, y - 9, 282, 18, WARNING, 4)
        for words, x, align in ((name, 674, 0), (f"{severity:.2f}", 896, 1), (f"{since:.1f} s", 946, 1)):
            canvas.text(words, (x, y), align=align)
    if len(faults) > shown:
        canvas.text(f"and {len(faults) - shown} more", (674, 142 + 20 * shown), FAINT)


def _bounds(traces: Sequence[Trace], values: np.ndarray) -> np.ndarray:
    """Ticks around the values, never over less than twenty times the noise, which would be blown up."""
    channel = CHANNELS[traces[0].channel]
    least = 20.0 * channel.noise or (channel.high - channel.low) / 2
    margin = max(least - np.ptp(values), 0.0) / 2
    return ticks(values.min() - margin, values.max() + margin)


def _number(value: float, step: float) -> str:
    """The value with as many decimals as a step of that size needs."""
    decimals = max(0, math.ceil(-math.log10(step) - 1e-9))
    return f"{round(value, decimals) + 0.0:.{decimals}f}"


def _round_times(start: float) -> np.ndarray:
    return np.arange(math.ceil(start / 10.0) * 10.0, start + WINDOW + 0.01, 10.0)


def _draw_times(canvas: Canvas, corner: Point, now: float):
    start = max(0.0, now - WINDOW)
    for time in _round_times(start):
        canvas.text(
            f"{time:.0f} s", (corner[0] + 46 + (time - start) / WINDOW * 400, corner[1] + 10), FAINT, 0.5, SMALL
        )


def _draw_chart(canvas: Canvas, traces: Sequence[Trace], corner: Point, rows: np.ndarray, onsets: Sequence[float]):
    left, top, width, height = corner[0] + 46, corner[1] + 24, 400, 88
    start = max(0.0, rows[-1, 0] - WINDOW)
    values = rows[:, [COLUMNS[trace.channel] for trace in traces]]
    marks = _bounds(traces, values)
    x = lambda time: left + (time - start) / WINDOW * width  # noqa: E731
    y = lambda value: top + (marks[-1] - value) / (marks[-1] - marks[0]) * height  # noqa: E731
    canvas.box(left, top, width, height, PANEL)
    for mark in marks:
        canvas.box(left, round(y(mark)), width, 1, GRID)
        canvas.text(_number(mark, marks[1] - marks[0]), (left - 6, y(mark)), FAINT, 1.0, SMALL)
    for time in _round_times(start):
        canvas.box(round(x(time)), top, 1, height, GRID)
    for onset in onsets:
        canvas.box(round(x(onset)), top, 2, height, WARNING)
    for trace, series in zip(traces, values.T, strict=True):
        points = np.stack([x(rows[:, 0]), y(series)], axis=1).tolist()
        if len(points) > 1:
            canvas.line(points, trace.colour, trace.width)
        canvas.circle(points[-1], 2.5, trace.colour)


def _draw_legend(
    canvas: Canvas, title: str, traces: Sequence[Trace], corner: Point, row: Mapping[str, float], faulty: set[str]
):
    unit = CHANNELS[traces[0].channel].unit.replace("^2", "²")
    canvas.text(f"{title} [{unit}]", (corner[0], corner[1] + 9))
    right, y = corner[0] + 446, corner[1] + 9
    for trace in reversed(traces):
        noise = CHANNELS[trace.channel].noise if trace.channel in CHANNELS else 0.01
        words = f"{trace.name} {_number(row[trace.channel], noise or 0.01)}"
        broken = f"sensor:{trace.channel}" in faulty
        if broken:
            canvas.box(right - canvas.width(words) - 4, y - 9, canvas.width(words) + 8, 17, WARNING, 4)
        canvas.text(words, (right, y), INK if broken else trace.colour, 1.0)
        right -= canvas.width(words) + 16


class Renderer:
    """Keeps the last minute of an episode and draws it. Without pygame: `gymnasium.error.DependencyNotInstalled`.

    Args:
        mode: ``rgb_array`` (draws off screen; needs no display) or ``human`` (a window).
        fps: Frames per second of the window.
    """

    def __init__(self, mode: str, fps: float):
        self._mode, self._fps, self._canvas = mode, fps, Canvas()
        self._components = {fault.diagnosis: fault.component for fault in CATALOGUE.values()}
        self._clock = self._canvas.pygame.time.Clock()
        self._dismissed = False
        self.clear()

    def clear(self):
        """Forget the episode."""
        self._rows: deque[tuple[float, ...]] = deque(maxlen=round(WINDOW * SAMPLE_RATE) + 1)
        self._onsets: dict[str, float] = {}
        self._severity: dict[str, float] = {}
        self._angles, self._thrust = dict.fromkeys(SIDES, 0.0), dict.fromkeys(SIDES, 0.0)
        self._travelled = self._full_thrust = 0.0

    def record(self, time: float, observation: np.ndarray, truth: Mapping[str, Any]):
        """Take in a sample: its time [s], the observation (n_channels,) and ``info["truth"]``."""
        previous = self._rows[-1][0] if self._rows else time
        state = truth["state"]
        self._rows.append((time, *map(float, observation), state["speed"]))
        self._severity = {name: severity for name, severity in truth["severity"].items() if severity > 0.0}
        for name in self._severity:
            self._onsets.setdefault(name, previous)
        self._travelled += state["speed"] * (time - previous)
        for side in SIDES:
            self._angles[side] += state[f"{side}_rpm"] * 2.0 * math.pi / 60.0 / SLOW_MOTION * (time - previous)
            self._thrust[side] = truth["parameters"][f"{side}_beta"]
        self._full_thrust = max(self._full_thrust, *self._thrust.values())

    def frame(self) -> np.ndarray:
        """The picture, (height, width, 3) uint8."""
        self._draw()
        pixels = self._canvas.pygame.image.tobytes(self._canvas.surface, "RGB")
        return np.frombuffer(bytearray(pixels), np.uint8).reshape(*SIZE[::-1], 3)

    def show(self):
        """Bring the window up to date; once the user has closed it, do nothing."""
        if self._dismissed:
            return
        self._draw()
        display = self._canvas.pygame.display
        if display.get_surface() is None:
            display.init()
            display.set_caption("NPS AUV II")
            display.set_mode(SIZE)
        display.get_surface().blit(self._canvas.surface, (0, 0))
        display.flip()
        self._clock.tick(self._fps)
        if any(event.type == self._canvas.pygame.QUIT for event in self._canvas.pygame.event.get()):
            self.close()

    def close(self):
        """Close the window, if there is one."""
        if self._mode == "human" and not self._dismissed:
            self._canvas.pygame.display.quit()
        self._dismissed = True

    def _draw(self):
        canvas, rows = self._canvas, np.array(self._rows)
        row = dict(zip(COLUMNS, self._rows[-1], strict=True))
        faulty = {self._components.get(name, name) for name in self._severity}
        onsets = [onset for onset in self._onsets.values() if onset >= row["time"] - WINDOW]
        shares = {side: thrust / (self._full_thrust or 1.0) for side, thrust in self._thrust.items()}
        parts = vehicle_parts(row["rudder"], row["stern_plane"], self._angles, shares)
        faults = [(name, severity, self._onsets[name]) for name, severity in self._severity.items()]
        with canvas.fresh():
            for view in VIEWS:
                draw_vehicle(canvas, view, parts, faulty)
            draw_ruler(canvas, self._travelled)
            _draw_gauge(canvas, row)
            _draw_caption(canvas, row["time"], sorted(faults, key=lambda fault: fault[2]))
            for place, (title, traces) in enumerate(CHARTS.items()):
                corner = (14 + place % 2 * 486, 244 + place // 2 * 124)
                _draw_chart(canvas, traces, corner, rows, onsets)
                _draw_legend(canvas, title, traces, corner, row, faulty)
            for place in (14, 500):
                _draw_times(canvas, (place, 606), rows[-1, 0])
