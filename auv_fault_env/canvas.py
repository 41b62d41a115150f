"""The surface off screen on which frames are drawn."""

import os
import warnings
from collections.abc import Sequence
from contextlib import contextmanager
from typing import Any

import gymnasium as gym

from auv_fault_env import palette
from auv_fault_env.palette import INK, Colour

Point = Sequence[float]

SIZE = (960, 640)  # px
# sizes of the text
SMALL = 16
MEDIUM = 18
LARGE = 24


def _pygame():
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # pygame imports pkg_resources, which warns
            import pygame
    except ImportError as error:
        raise gym.error.DependencyNotInstalled(
            'rendering needs pygame: pip install "auv-fault[render]"'
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
    def new_frame(self):
        """An empty frame, with fonts of its own: `pygame.quit()` elsewhere breaks older ones."""
        self.pygame.font.init()
        font = self.pygame.font.Font
        self._fonts = {size: font(None, size) for size in (SMALL, MEDIUM, LARGE)}
        self.surface.fill(palette.PAPER)
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

    def circle(self, centre: Point, radius: float, colour: Colour, width: int = 0):
        """A disc, or a ring of that width."""
        self.pygame.draw.circle(self.surface, colour, centre, radius, width)

    def box(
        self,
        left: float,
        top: float,
        width: float,
        height: float,
        fill: Colour,
        radius: int = 0,
    ):
        """A filled rectangle with rounded corners."""
        rectangle = (left, top, width, height)
        self.pygame.draw.rect(self.surface, fill, rectangle, border_radius=radius)

    def width(self, words: str) -> int:
        """Width of words of medium size [px]."""
        return self._text(words, INK, MEDIUM).get_width()

    def text(
        self,
        words: str,
        place: Point,
        colour: Colour = INK,
        align: float = 0.0,
        size: int = MEDIUM,
    ):
        """Words at the height of `place`: right of it (align 0), centred (0.5) or left (1)."""
        text = self._text(words, colour, size)
        left = round(place[0] - align * text.get_width())
        top = round(place[1] - text.get_height() / 2)
        self.surface.blit(text, (left, top))

    def _text(self, words: str, colour: Colour, size: int):
        if len(self._texts) > 1000:
            self._texts.clear()
        key = (words, colour, size)
        if key not in self._texts:
            self._texts[key] = self._fonts[size].render(words, True, colour)
        return self._texts[key]
