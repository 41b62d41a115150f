"""What a lane of a fleet shows to its renderer."""

from typing import TYPE_CHECKING, Any

import numpy as np

from auv_fault_env.errors import known_name
from auv_fault_env.fleet import Fleet
from auv_fault_env.truth import SingleLaneTruth

if TYPE_CHECKING:
    from auv_fault_env.rendering import Renderer

METADATA: dict[str, Any] = {"render_modes": ["rgb_array", "human"], "render_fps": 10}


def known_render_mode(mode: str | None) -> str | None:
    """The render mode, if there is one of that name."""
    return None if mode is None else known_name("render_mode", mode, METADATA["render_modes"])


class Recording:
    """The last minute of one lane; the renderer is made when the first sample comes."""

    def __init__(self, mode: str, fleet: Fleet, lane: int = 0):
        self._mode = mode
        self._fleet = fleet
        self._lane = lane
        self._truth = SingleLaneTruth(fleet, lane)
        self._renderer: Renderer | None = None

    def clear(self) -> None:
        """Remove the recorded episode."""
        if self._renderer is not None:
            self._renderer.clear()

    def record(self, observation: np.ndarray) -> None:
        """Record the present sample; in mode `human` show it."""
        if self._renderer is None:
            from auv_fault_env.rendering import Renderer

            self._renderer = Renderer(self._mode, METADATA["render_fps"], self._fleet.vehicle)
        time = float(self._fleet.time[self._lane])
        self._renderer.record(time, observation, self._truth.read())
        if self._mode == "human":
            self._renderer.show()

    def frame(self) -> np.ndarray | None:
        """The frame (height, width, 3) uint8 in mode `rgb_array`, None in mode `human`."""
        if self._renderer is None or self._mode != "rgb_array":
            return None
        return self._renderer.frame()

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def __getstate__(self):
        """Without the renderer: a copy makes its own."""
        return self.__dict__ | {"_renderer": None}
