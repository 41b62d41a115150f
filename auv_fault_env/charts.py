"""Strip charts of the readings over the last minute of an episode."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from auv_fault_env import palette
from auv_fault_env.canvas import SMALL, Canvas, Point
from auv_fault_env.channels import CHANNELS
from auv_fault_env.parameters import SIDES, Vehicle, is_of_missing_side

WINDOW = 60.0  # s, length of the strip charts


class Trace(NamedTuple):
    """One line of a strip chart."""

    channel: str
    name: str
    colour: palette.Colour
    width: int = 1


def _pair(quantity: str) -> tuple[Trace, ...]:
    return tuple(Trace(f"{side}_{quantity}", side, palette.SIDES[side]) for side in SIDES)


TRUE_SPEED = "true_speed"
COLUMNS = {name: column for column, name in enumerate(("time", *CHANNELS, TRUE_SPEED))}
SPEEDS = (
    Trace("speed", "measured", palette.INK),
    Trace("mission_speed", "mission", palette.STEEL, 4),
    Trace("speed_command", "command", palette.BLUE, 2),
    Trace(TRUE_SPEED, "true", palette.VIOLET),
)
DEFLECTIONS = (
    Trace("rudder", "rudder", palette.BLUE, 4),
    Trace("stern_plane", "stern plane", palette.VIOLET, 2),
)
CHARTS = {
    "speed": SPEEDS,
    "shaft speed": _pair("rpm"),
    "acceleration": (Trace("acceleration", "measured", palette.INK),),
    "motor voltage": _pair("voltage"),
    "deflection": DEFLECTIONS,
    "motor current": _pair("current"),
}


def charts(vehicle: Vehicle) -> dict[str, tuple[Trace, ...]]:
    """Traces of the vehicle's charts by title, those of `CHARTS` that it has."""
    return {
        title: tuple(trace for trace in traces if not is_of_missing_side(trace.channel, vehicle))
        for title, traces in CHARTS.items()
    }


def ticks(low: float, high: float, intervals: int = 4) -> np.ndarray:
    """Multiples of 1, 2 or 5 times a power of ten that enclose the range, but for 2 % of a step.

    >>> ticks(0.12, 0.87)
    array([0. , 0.2, 0.4, 0.6, 0.8, 1. ])
    """
    least_step = (high - low) / intervals
    power = 10.0 ** math.floor(math.log10(least_step))
    steps = [factor * power for factor in (1, 2, 5, 10)]
    step = next(step for step in steps if step >= 0.999 * least_step)
    first = math.floor(low / step + 0.02)
    last = math.ceil(high / step - 0.02)
    return np.arange(first, last + 1) * step


def _value_ticks(traces: Sequence[Trace], values: np.ndarray) -> np.ndarray:
    """Ticks around the values, over at least twenty standard deviations of the noise."""
    channel = CHANNELS[traces[0].channel]
    least_range = 20.0 * channel.noise or (channel.high - channel.low) / 2
    margin = max(least_range - np.ptp(values), 0.0) / 2
    return ticks(values.min() - margin, values.max() + margin)


def _number(value: float, step: float) -> str:
    """The value with the decimals of a step of that size."""
    decimals = max(0, math.ceil(-math.log10(step) - 1e-9))
    return f"{round(value, decimals) + 0.0:.{decimals}f}"


def _time_ticks(start: float) -> np.ndarray:
    """Multiples of 10 s within the window."""
    return np.arange(math.ceil(start / 10.0) * 10.0, start + WINDOW + 0.01, 10.0)


def draw_times(canvas: Canvas, corner: Point, now: float):
    """The time scale below a column of charts."""
    start = max(0.0, now - WINDOW)
    for time in _time_ticks(start):
        x = corner[0] + 46 + (time - start) / WINDOW * 400
        canvas.text(f"{time:.0f} s", (x, corner[1] + 10), palette.FAINT, 0.5, SMALL)


def draw_chart(
    canvas: Canvas,
    traces: Sequence[Trace],
    corner: Point,
    rows: np.ndarray,
    onsets: Sequence[float],
):
    """One chart: grid, a vertical line for each onset, and a line for each trace."""
    left = corner[0] + 46
    top = corner[1] + 24
    width = 400
    height = 88
    start = max(0.0, rows[-1, 0] - WINDOW)
    values = rows[:, [COLUMNS[trace.channel] for trace in traces]]
    marks = _value_ticks(traces, values)

    def x(time):
        return left + (time - start) / WINDOW * width

    def y(value):
        return top + (marks[-1] - value) / (marks[-1] - marks[0]) * height

    canvas.box(left, top, width, height, palette.PANEL)
    for mark in marks:
        words = _number(mark, marks[1] - marks[0])
        canvas.box(left, round(y(mark)), width, 1, palette.GRID)
        canvas.text(words, (left - 6, y(mark)), palette.FAINT, 1.0, SMALL)
    for time in _time_ticks(start):
        canvas.box(round(x(time)), top, 1, height, palette.GRID)
    for onset in onsets:
        canvas.box(round(x(onset)), top, 2, height, palette.WARNING)
    for trace, series in zip(traces, values.T, strict=True):
        times = rows[:, 0]
        points = np.stack([x(times), y(series)], axis=1).tolist()
        if len(points) > 1:
            canvas.line(points, trace.colour, trace.width)
        canvas.circle(points[-1], 2.5, trace.colour)


def draw_legend(
    canvas: Canvas,
    title: str,
    traces: Sequence[Trace],
    corner: Point,
    row: Mapping[str, float],
    faulty: set[str],
):
    """Title and unit of a chart, names and latest values of its traces, faulty sensors marked."""
    unit = CHANNELS[traces[0].channel].unit.replace("^2", "²")
    canvas.text(f"{title} [{unit}]", (corner[0], corner[1] + 9))
    right = corner[0] + 446
    y = corner[1] + 9
    for trace in reversed(traces):
        noise = CHANNELS[trace.channel].noise if trace.channel in CHANNELS else 0.0
        words = f"{trace.name} {_number(row[trace.channel], noise or 0.01)}"
        width = canvas.width(words)
        is_faulty = f"sensor:{trace.channel}" in faulty
        if is_faulty:
            canvas.box(right - width - 4, y - 9, width + 8, 17, palette.WARNING, 4)
        canvas.text(words, (right, y), palette.INK if is_faulty else trace.colour, 1.0)
        right -= width + 16
