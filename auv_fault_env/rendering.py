"""Frames of `PropulsionEnv`: the vehicle in three projections, and strip charts of the last minute.

A fault shows from its onset on, in the caption and on the part that its `component` names: a new
one of the catalogue needs no edit here.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from auv_fault_env import palette
from auv_fault_env.canvas import LARGE, SIZE, SMALL, Canvas
from auv_fault_env.charts import (
    COLUMNS,
    SPEEDS,
    TRUE_SPEED,
    WINDOW,
    charts,
    draw_chart,
    draw_legend,
    draw_times,
    ticks,
)
from auv_fault_env.faults import CATALOGUE
from auv_fault_env.parameters import SAMPLE_RATE, Vehicle
from auv_fault_env.physics import RPM
from auv_fault_env.silhouette import (
    PROJECTIONS,
    draw_ruler,
    draw_vehicle,
    vehicle_parts,
)

# factor by which propellers turn slower on the screen: ten frames a second would show them at rest
SLOW_MOTION = 20.0
# px, places of the names of the sides below the view from astern
SIDE_LABELS = {1: (546,), 2: (513, 579)}


def _draw_gauge(canvas: Canvas, row: Mapping[str, float], maximum_speed: float):
    """The scale of speed: true speed as a bar, reading as a line, mission and command as marks."""
    left = 678.0
    width = 258.0
    top = 74.0
    marks = ticks(0.0, max(maximum_speed, row[TRUE_SPEED]))
    places = {}
    for trace in SPEEDS:
        fraction = min(max(row[trace.channel] / marks[-1], 0.0), 1.0)
        places[trace.channel] = left + width * fraction
    canvas.text(f"{row['speed']:.2f} m/s measured", (left, 52), size=LARGE)
    canvas.box(left, top, width, 12, palette.GRID)
    canvas.box(left, top, places[TRUE_SPEED] - left, 12, palette.VIOLET)
    canvas.box(places["speed"] - 1, top - 2, 2, 16, palette.INK)
    for name, colour, y, tip in (
        ("speed_command", palette.BLUE, top - 5, top + 3),
        ("mission_speed", palette.STEEL, top + 17, top + 9),
    ):
        x = places[name]
        corners = [(x - 4, y), (x + 4, y), (x, tip)]
        canvas.polygon(corners, colour, palette.INK)
    for mark in marks:
        x = left + width * mark / marks[-1]
        canvas.text(f"{mark:.1f}", (x, top + 24), palette.FAINT, 0.5, SMALL)


def _draw_caption(
    canvas: Canvas, vehicle: Vehicle, time: float, faults: Sequence[tuple[str, float, float]]
):
    """Vehicle, time, and a table of the present faults: class, severity, onset."""
    for side, x in zip(vehicle.sides, SIDE_LABELS[vehicle.shafts], strict=True):
        canvas.text(side, (x, 204), palette.SIDES[side], 0.5)
    canvas.text(vehicle.name, (674, 18), size=LARGE)
    canvas.text(f"{time:.1f} s", (946, 18), size=LARGE, align=1.0)
    canvas.text("fault" if faults else "no fault", (674, 122), palette.FAINT)
    if faults:
        canvas.text("severity", (896, 122), palette.FAINT, 1.0)
        canvas.text("since", (946, 122), palette.FAINT, 1.0)
    shown = 5 if len(faults) <= 5 else 4
    for line, (name, severity, since) in enumerate(faults[:shown]):
        y = 142 + 20 * line
        canvas.box(668, y - 9, 282, 18, palette.WARNING, 4)
        canvas.text(name, (674, y))
        canvas.text(f"{severity:.2f}", (896, y), align=1.0)
        canvas.text(f"{since:.1f} s", (946, y), align=1.0)
    if len(faults) > shown:
        canvas.text(f"and {len(faults) - shown} more", (674, 142 + 20 * shown), palette.FAINT)


class Renderer:
    """Records the last minute of an episode and draws it.

    `mode` is ``rgb_array`` (off screen; needs no display) or ``human`` (a window of so many frames
    per second). Without pygame it raises `gymnasium.error.DependencyNotInstalled`. The hull is
    always that of the NPS AUV II.
    """

    def __init__(self, mode: str, fps: float, vehicle: Vehicle):
        self._vehicle = vehicle
        self._charts = charts(vehicle)
        self._mode = mode
        self._fps = fps
        self._canvas = Canvas()
        self._clock = self._canvas.pygame.time.Clock()
        self._is_closed = False
        self.clear()

    def clear(self):
        """Remove the recorded episode."""
        n_rows = round(WINDOW * SAMPLE_RATE) + 1
        self._rows: deque[tuple[float, ...]] = deque(maxlen=n_rows)
        self._onsets: dict[str, float] = {}
        self._severity: dict[str, float] = {}
        self._angles = dict.fromkeys(self._vehicle.sides, 0.0)
        self._thrust = dict.fromkeys(self._vehicle.sides, 0.0)
        self._travelled = 0.0
        self._full_thrust = 0.0

    def record(self, time: float, observation: np.ndarray, truth: Mapping[str, Any]):
        """Record a sample: its time [s], the observation (n_channels,) and ``info["truth"]``."""
        previous = self._rows[-1][0] if self._rows else time
        state = truth["state"]
        self._rows.append((time, *map(float, observation), state["speed"]))
        self._severity = {name: s for name, s in truth["severity"].items() if s > 0.0}
        for name in self._severity:
            self._onsets.setdefault(name, previous)
        duration = time - previous
        self._travelled += state["speed"] * duration
        for side in self._vehicle.sides:
            shaft_speed = state[f"{side}_rpm"] / RPM
            self._angles[side] += shaft_speed / SLOW_MOTION * duration
            self._thrust[side] = truth["parameters"][f"{side}_beta"]
        self._full_thrust = max(self._full_thrust, *self._thrust.values())

    def frame(self) -> np.ndarray:
        """The picture, (height, width, 3) uint8."""
        self._draw()
        pixels = self._canvas.pygame.image.tobytes(self._canvas.surface, "RGB")
        frame = np.frombuffer(bytearray(pixels), np.uint8)
        return frame.reshape(*SIZE[::-1], 3)

    def show(self):
        """Update the window; do nothing once the user has closed it."""
        if self._is_closed:
            return
        self._draw()
        display = self._canvas.pygame.display
        if display.get_surface() is None:
            display.init()
            display.set_caption(self._vehicle.name)
            display.set_mode(SIZE)
        display.get_surface().blit(self._canvas.surface, (0, 0))
        display.flip()
        self._clock.tick(self._fps)
        events = self._canvas.pygame.event.get()
        if any(event.type == self._canvas.pygame.QUIT for event in events):
            self.close()

    def close(self):
        """Close the window, if there is one."""
        if self._mode == "human" and not self._is_closed:
            self._canvas.pygame.display.quit()
        self._is_closed = True

    def _draw(self):
        canvas = self._canvas
        rows = np.array(self._rows)
        row = dict(zip(COLUMNS, self._rows[-1], strict=True))
        components = {fault.diagnosis: fault.component for fault in CATALOGUE.values()}
        faulty = {components[name] for name in self._severity if name in components}
        start = row["time"] - WINDOW
        onsets = [onset for onset in self._onsets.values() if onset >= start]
        full_thrust = self._full_thrust or 1.0
        shares = {side: thrust / full_thrust for side, thrust in self._thrust.items()}
        parts = vehicle_parts(row["rudder"], row["stern_plane"], self._angles, shares)
        faults = [(name, severity, self._onsets[name]) for name, severity in self._severity.items()]
        with canvas.new_frame():
            for projection in PROJECTIONS:
                draw_vehicle(canvas, projection, parts, faulty)
            draw_ruler(canvas, self._travelled)
            _draw_gauge(canvas, row, self._vehicle.maximum_speed)
            by_onset = sorted(faults, key=lambda fault: fault[2])
            _draw_caption(canvas, self._vehicle, row["time"], by_onset)
            for place, (title, traces) in enumerate(self._charts.items()):
                corner = (14 + place % 2 * 486, 244 + place // 2 * 124)
                draw_chart(canvas, traces, corner, rows, onsets)
                draw_legend(canvas, title, traces, corner, row, faulty)
            for place in (14, 500):
                draw_times(canvas, (place, 606), rows[-1, 0])
