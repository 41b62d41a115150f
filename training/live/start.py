"""The start of the live page: what it needs is compiled while the page already says so."""

from threading import Event, Thread

from nicegui import ui

from training.live.page import Page
from training.live.session import Session

CHECK_INTERVAL = 0.5  # s


class Preparation:
    """Compiles all that a session needs, in a thread that ends with the process.

    What fails there fails again, and is reported, where a visitor's session is made.
    """

    def __init__(self, seed: int):
        self._seed = seed
        self._is_over = Event()
        Thread(target=self._compile, daemon=True).start()

    def _compile(self) -> None:
        try:
            Session(self._seed).step()
        finally:
            self._is_over.set()

    @property
    def is_over(self) -> bool:
        """Whether pages can be made at once."""
        return self._is_over.is_set()


def show_page(seed: int, preparation: Preparation, notice: str) -> None:
    """Show the page of a visitor, or the notice until the preparation is over."""
    if preparation.is_over:
        Page(seed)
        return
    text = f"{notice[0].upper()}{notice[1:]}. The page appears by itself."
    label = ui.label(text).mark("notice")

    def check() -> None:
        if preparation.is_over:
            timer.cancel()
            label.delete()
            Page(seed)

    timer = ui.timer(CHECK_INTERVAL, check)
