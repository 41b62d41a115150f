"""The charts of the live page: functions of the history that return options of Apache ECharts.

Every chart takes the history and whether the truth is shown; its options are plain data.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from auv_fault_env.channels import INDEX
from auv_fault_env.faults import classes
from auv_fault_env.parameters import SIDES
from training.live.history import WINDOW, History
from training.live.texts import LEAST_SHOWN, NEGLIGIBLE
from training.report.colours import (
    COMMAND,
    PORT,
    SPEED,
    STARBOARD,
    TRUTH,
    class_style,
)

Options = dict[str, Any]
N_FAULTS = 3  # fault classes whose probabilities are shown over time
LEAST_DRAWN = 0.01  # probability from which a fault is among them
N_BARS = 6  # classes in the bar chart
MEASURED = "#0080ff"
HINT_COLOUR = "#5d6d7e"
# port is wider, so that it is seen where starboard covers it
SIDE_WIDTHS = {"port": 2, "starboard": 1}
SIDE_COLOURS = {"port": PORT, "starboard": STARBOARD}
BEFORE_START = "Press START: the last minute appears here."
NO_LIKELY_FAULT = f"Appears when a fault reaches {100 * LEAST_SHOWN:g} %."
SMALL = {"fontSize": 11}
LEGEND = {
    "show": True,
    "top": 24,
    "itemWidth": 18,
    "itemHeight": 8,
    "itemGap": 8,
    "textStyle": SMALL,
}
MARK_COLOURS = {"fault": TRUTH, "repair": STARBOARD}


def speed(history: History, show_truth: bool) -> Options:
    """Speed of the mission, the command and the reading, and with the truth the true speed."""
    lines = {
        "mission": _line(_channel(history, "mission_speed"), COMMAND, width=5),
        "command": _line(_channel(history, "speed_command"), SPEED, width=2),
        "measured": _line(_channel(history, "speed"), MEASURED),
    }
    if show_truth:
        lines["true"] = _line(history.true_speed, TRUTH, width=2)
    return _over_time("speed [m/s]", history, lines)


def of_both_sides(title: str, quantity: str) -> Callable[[History, bool], Options]:
    """A chart of the same reading on both sides."""

    def chart(history: History, show_truth: bool) -> Options:
        lines = {}
        for side in SIDES:
            values = _channel(history, f"{side}_{quantity}")
            lines[side] = _line(values, SIDE_COLOURS[side], width=SIDE_WIDTHS[side])
        return _over_time(title, history, lines)

    return chart


def belief(history: History, show_truth: bool) -> Options:
    """Probability of `normal`, and of the faults that were the likeliest at any time shown."""
    probability = history.probability
    highest = probability[:, 1:].max(axis=0)
    likeliest = 1 + np.argsort(-highest, kind="stable")[:N_FAULTS]
    likeliest = likeliest[highest[likeliest - 1] >= LEAST_DRAWN]
    lines = {}
    for k in (0, *sorted(likeliest.tolist())):
        name = classes()[k]
        lines[name] = _line(100.0 * probability[:, k], *class_style(name), width=2)
    title = "probability of normal and of the likeliest faults [%]"
    options = _over_time(title, history, lines, top=100.0)
    options["grid"]["top"] = 80  # below three rows of names
    return options


def severity(history: History, show_truth: bool) -> Options:
    """Severity of the likeliest fault now, with its 95 % interval, while it was likely enough."""
    index = history.likeliest_fault
    name = classes()[index]
    is_likely = history.probability[:, index] >= LEAST_SHOWN
    mean, low, high = (np.where(is_likely, line, np.nan) for line in history.severity(index))
    colour, _ = class_style(name)
    area = {
        "stack": "interval",
        "symbol": "none",
        "lineStyle": {"width": 0},
        "color": colour,
    }
    lines = {
        "low": _line(low, colour) | area,
        "95 % interval": _line(high - low, colour) | area | {"areaStyle": {"opacity": 0.2}},
        name: _line(mean, colour, width=2),
    }
    title = "severity of the likeliest fault (0 healthy, 1 full)"
    options = _over_time(title, history, lines, top=1.0)
    if is_likely.any():
        options["legend"] = LEGEND | {"data": [line for line in lines if line != "low"]}
    else:
        options["legend"] = {"show": False}
        options["graphic"] = [_hint(history, NO_LIKELY_FAULT)]
    return options


def ranking(history: History, show_truth: bool) -> Options:
    """The likeliest classes now, the likeliest on top."""
    percent = 100.0 * history.probability[-1].astype(np.float64)
    order = np.argsort(-percent, kind="stable")[:N_BARS][::-1]
    bars = []
    for k in order:
        style = {"color": class_style(classes()[k])[0]}
        bar = {"value": round(float(percent[k]), 1), "itemStyle": style}
        if percent[k] < 100.0 * NEGLIGIBLE:
            bar["label"] = {"formatter": f"< {100.0 * NEGLIGIBLE:g}"}
        bars.append(bar)
    label = {"show": True, "position": "right", "fontSize": 11}
    return {
        "animation": False,
        "title": _title("probability now [%]"),
        "grid": {
            "left": 8,
            "right": 48,
            "top": 34,
            "bottom": 8,
            "containLabel": True,
        },
        "xAxis": {"type": "value", "min": 0, "max": 100},
        "yAxis": {
            "type": "category",
            "data": [classes()[k] for k in order],
            "axisLabel": SMALL,
        },
        "series": [{"type": "bar", "data": bars, "label": label, "barCategoryGap": "35%"}],
    }


CHARTS: dict[str, Callable[[History, bool], Options]] = {
    "ranking": ranking,
    "belief": belief,
    "severity": severity,
    "speed": speed,
    "rpm": of_both_sides("shaft speed [rpm]", "rpm"),
    "current": of_both_sides("motor current [A]", "current"),
    "voltage": of_both_sides("motor voltage [V]", "voltage"),
}


def _channel(history: History, name: str) -> np.ndarray:
    return history.observation[:, INDEX[name]]


def _line(values: np.ndarray, colour: str, dash: str = "solid", width: int = 1) -> Options:
    style = {"width": width, "type": dash}
    return {
        "type": "line",
        "data": values,
        "symbol": "none",
        "color": colour,
        "lineStyle": style,
    }


def _over_time(
    title: str,
    history: History,
    lines: Mapping[str, Options],
    top: float | None = None,
) -> Options:
    """Lines over the last minute, alarms as areas, and faults and repairs as vertical lines."""
    end = max(WINDOW, float(history.time[-1]))
    has_round_ends = end == WINDOW
    series = []
    for name, line in lines.items():
        series.append(line | {"name": name, "data": _points(history.time, line["data"])})
    series[0] |= _marks(history)
    limits = {} if top is None else {"min": 0, "max": top}
    return {
        "animation": False,
        "title": _title(title),
        "graphic": [_hint(history, "")],
        "legend": LEGEND,
        "grid": {"left": 44, "right": 14, "top": 50, "bottom": 34},
        "tooltip": {"trigger": "axis"},
        "xAxis": {
            "type": "value",
            "name": "time [s]",
            "nameLocation": "middle",
            "nameGap": 20,
            "min": round(end - WINDOW, 1),
            "max": round(end, 1),
            "splitLine": {"show": False},
            "axisLabel": {
                "showMinLabel": has_round_ends,
                "showMaxLabel": has_round_ends,
            },
        },
        "yAxis": {"type": "value"} | limits,
        "series": series,
    }


def _hint(history: History, text: str) -> Options:
    """What the middle of a chart says while it has no line; nothing once it has one."""
    shown = BEFORE_START if len(history.time) < 2 else text
    style = {
        "text": shown,
        "fontSize": 12,
        "fill": HINT_COLOUR,
        "backgroundColor": "white",
        "padding": 4 if shown else 0,
    }
    return {"type": "text", "id": "hint", "left": "center", "top": "55%", "style": style}


def _points(time: np.ndarray, values: np.ndarray) -> list[list[float | None]]:
    """Pairs for a line; NaN becomes a gap."""
    times = np.round(time, 1).tolist()
    rounded = np.round(values.astype(np.float64), 4)
    with_gaps = np.where(np.isnan(rounded), None, rounded).tolist()
    return [list(point) for point in zip(times, with_gaps, strict=True)]


def _marks(history: History) -> Options:
    label = {"formatter": "{b}", "fontSize": 10, "position": "end", "distance": 2}
    lines = []
    for mark in history.marks:
        style = {"color": MARK_COLOURS[mark.action], "type": "solid"}
        lines.append({"name": mark.action, "xAxis": round(mark.time, 1), "lineStyle": style})
    areas = [[{"name": "alarm", "xAxis": begin}, {"xAxis": end}] for begin, end in history.alarms()]
    tint = {"color": "rgba(192, 57, 43, 0.12)"}
    name = {"fontSize": 10, "color": PORT, "position": "insideBottom"}
    return {
        "markLine": {"silent": True, "symbol": "none", "label": label, "data": lines},
        "markArea": {"silent": True, "itemStyle": tint, "label": name, "data": areas},
    }


def _title(text: str) -> Options:
    style = {"fontSize": 13, "fontWeight": "normal"}
    return {"text": text, "left": 6, "top": 4, "textStyle": style}
