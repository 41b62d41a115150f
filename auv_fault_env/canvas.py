"""Where frames are drawn: an off-screen surface with a few strokes, and the colours."""

import os
import warnings
from collections.abc import Sequence
from contextlib import contextmanager
from typing import Any

import gymnasium as gym

from auv_fault_env.parameters import SIDES

Colour = tuple[int, int, int]
Point = Sequence[float]

SIZE = (960, 640)  # px
# sizes of the text
SMALL = 16
MEDIUM = 18
LARGE = 24
PAPER = (250, 251, 252)
PANEL = (255, 255, 255)
INK = (33, 41, 52)
FAINT = (112, 121, 133)
GRID = (226, 231, 236)
# the nautical side lights
PORT = (200, 32, 48)
STARBOARD = (0, 132, 72)
BLUE = (30, 104, 196)
VIOLET = (142, 68, 190)
STEEL = (150, 160, 172)
WARNING = (255, 152, 20)
PALE_WARNING = (255, 206, 140)
WARNING_EDGE = (196, 84, 0)
SIDE_COLOURS = dict(zip(SIDES, (PORT, STARBOARD), strict=True))


def _pygame():
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # pygame looks for pkg_resources, which warns
            import pygame
    except ImportError as error:
        remedy = 'pip install "auv-fault[render]"'
        raise gym.error.DependencyNotInstalled(
            f"pygame: got no such package; rendering needs it; {remedy}"
        ) from error
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

    def box(
        self, left: float, top: float, width: float, height: float, fill: Colour, radius: int = 0
    ):
        """A filled rectangle with rounded corners."""
        self.pygame.draw.rect(self.surface, fill, (left, top, width, height), border_radius=radius)

    def width(self, words: str) -> int:
        """Width of words of medium size [px]."""
        return self._text(words, INK, MEDIUM).get_width()

    def text(
        self, words: str, place: Point, colour: Colour = INK, align: float = 0.0, size: int = MEDIUM
    ):
        """Words whose middle height is at `place`, to the right of it (align 0), centred (0.5) or to the left (1)."""
        text = self._text(words, colour, size)
        self.surface.blit(
            text,
            (round(place[0] - align * text.get_width()), round(place[1] - text.get_height() / 2)),
        )

    def _text(self, words: str, colour: Colour, size: int):
        if len(self._texts) > 1000:
            self._texts.clear()
        if (words, colour, size) not in self._texts:
            self._texts[words, colour, size] = self._fonts[size].render(words, True, colour)
        return self._texts[words, colour, size]
