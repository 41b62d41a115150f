"""The charts of the live page: functions of the history that return options of Apache ECharts.

Every chart takes the history and whether the truth is shown; its options are plain data.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from auv_fault_env.channels import INDEX
from auv_fault_env.faults import NORMAL, UNKNOWN, classes
from auv_fault_env.parameters import SIDES
from training.live.history import WINDOW, History
from training.report.colours import COMMAND, PORT, SPEED, STARBOARD, TRUTH

Options = dict[str, Any]
N_FAULTS = 4  # fault classes whose probabilities are shown over time
N_BARS = 6  # classes in the bar chart
LEAST_PROBABILITY = 0.05  # from which the severity of a class is shown
TRUE_COLOUR = "#7d3c98"
UNKNOWN_COLOUR = "#7f8c8d"
CLASS_COLOURS = (
    "#c0392b #2874a6 #b9770e #117864 #7d3c98 #a04000 #5d6d7e #d81b60 #1e8449 #00838f".split()
)
SMALL = {"fontSize": 11}
LEGEND = {
    "top": 24,
    "itemWidth": 18,
    "itemHeight": 8,
    "itemGap": 8,
    "textStyle": SMALL,
}
MARK_COLOURS = {"fault": "#111111", "repair": "#1e8449"}


def speed(history: History, show_truth: bool) -> Options:
    """Speed of the mission, the command and the reading, and with the truth the true speed."""
    lines = {
        "mission": _line(_channel(history, "mission_speed"), COMMAND, width=3),
        "command": _line(_channel(history, "speed_command"), SPEED),
        "measured": _line(_channel(history, "speed"), TRUTH),
    }
    if show_truth:
        lines["true"] = _line(history.true_speed, TRUE_COLOUR, width=2)
    return _over_time("speed [m/s]", history, lines)


def of_both_sides(title: str, quantity: str) -> Callable[[History, bool], Options]:
    """A chart of the same reading on both sides."""

    def chart(history: History, show_truth: bool) -> Options:
        lines = {}
        for side, colour in zip(SIDES, (PORT, STARBOARD), strict=True):
            lines[side] = _line(_channel(history, f"{side}_{quantity}"), colour)
        return _over_time(title, history, lines)

    return chart


def belief(history: History, show_truth: bool) -> Options:
    """Probability of `normal`, and of the faults that were the likeliest at any time shown."""
    probability = history.probability
    highest = probability[:, 1:].max(axis=0)
    likeliest = 1 + np.argsort(-highest, kind="stable")[:N_FAULTS]
    lines = {}
    for k in (0, *sorted(likeliest.tolist())):
        lines[classes()[k]] = _line(probability[:, k], **_class_style(k), width=2)
    title = "belief: probability of normal and of the likeliest faults"
    options = _over_time(title, history, lines, top=1.0)
    options["grid"]["top"] = 66  # below two rows of names
    return options


def severity(history: History, show_truth: bool) -> Options:
    """Severity of the likeliest fault now, with its 95 % interval, while it was likely enough."""
    index = history.likeliest_fault
    is_likely = history.probability[:, index] >= LEAST_PROBABILITY
    mean, low, high = (np.where(is_likely, line, np.nan) for line in history.severity(index))
    colour = _class_style(index)["colour"]
    area = {
        "stack": "interval",
        "symbol": "none",
        "lineStyle": {"width": 0},
        "color": colour,
    }
    lines = {
        "low": _line(low, colour) | area,
        "95 % interval": _line(high - low, colour) | area | {"areaStyle": {"opacity": 0.2}},
        classes()[index]: _line(mean, colour, width=2),
    }
    options = _over_time("severity of the likeliest fault", history, lines, top=1.0)
    options["legend"] = LEGEND | {"data": [name for name in lines if name != "low"]}
    return options


def ranking(history: History, show_truth: bool) -> Options:
    """The likeliest classes now, the likeliest on top."""
    percent = np.round(100.0 * history.probability[-1].astype(np.float64), 1)
    order = np.argsort(-percent, kind="stable")[:N_BARS][::-1]
    bars = []
    for k in order:
        style = {"color": _class_style(k)["colour"]}
        bars.append({"value": float(percent[k]), "itemStyle": style})
    label = {"show": True, "position": "right", "fontSize": 11}
    return {
        "animation": False,
        "title": _title("belief now [%]"),
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


def _class_style(index: int) -> dict[str, str]:
    """Colour and dash of a class: `normal` is black, `unknown` grey and dotted, sensors dashed."""
    if classes()[index] == NORMAL:
        return {"colour": TRUTH, "dash": "solid"}
    if classes()[index] == UNKNOWN:
        return {"colour": UNKNOWN_COLOUR, "dash": "dotted"}
    is_sensor = classes()[index].startswith("sensor:")
    colour = CLASS_COLOURS[(index - 1) % len(CLASS_COLOURS)]
    return {"colour": colour, "dash": "dashed" if is_sensor else "solid"}


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


def _points(time: np.ndarray, values: np.ndarray) -> list[list[float | None]]:
    """Pairs for a line; NaN becomes a gap."""
    times = np.round(time, 1).tolist()
    rounded = np.round(values.astype(np.float64), 4)
    with_gaps = np.where(np.isnan(rounded), None, rounded).tolist()
    return [list(point) for point in zip(times, with_gaps, strict=True)]


def _marks(history: History) -> Options:
    label = {"formatter": "{b}", "fontSize": 10, "position": "insideEndTop"}
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
