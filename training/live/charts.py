"""The charts of the live page: functions of what is remembered that return options of Apache ECharts, plain data."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from auv_fault_env.channels import INDEX
from auv_fault_env.faults import NORMAL, classes
from auv_fault_env.parameters import SIDES
from training.live.history import WINDOW, History
from training.report.figures.style import COMMAND, PORT, SPEED, STARBOARD, TRUTH

Options = dict[str, Any]
RIVALS = 4  # fault classes whose probabilities are drawn over time
RANKED = 6  # classes in the bars
LIKELY = 0.05  # probability from which a class's severity is worth drawing
TRUE = "#7d3c98"
PALETTE = (
    "#c0392b",
    "#2874a6",
    "#b9770e",
    "#117864",
    "#7d3c98",
    "#a04000",
    "#5d6d7e",
    "#d81b60",
    "#1e8449",
    "#00838f",
)
MARKED = {"fault": "#111111", "repair": "#1e8449"}


def speed(history: History, truth: bool) -> Options:
    """What the mission asks for, what is commanded, what is measured, and if wanted what is so."""
    lines = {
        "mission": _line(_channel(history, "mission_speed"), COMMAND, width=3),
        "command": _line(_channel(history, "speed_command"), SPEED),
        "measured": _line(_channel(history, "speed"), TRUTH),
    }
    if truth:
        lines["true"] = _line(history.true_speed, TRUE, width=2)
    return _over_time("speed [m/s]", history, lines)


def rpm(history: History, truth: bool) -> Options:
    """Both shafts' speeds."""
    return _over_time("shaft speed [rpm]", history, _sides(history, "rpm"))


def current(history: History, truth: bool) -> Options:
    """Both motors' currents."""
    return _over_time("motor current [A]", history, _sides(history, "current"))


def voltage(history: History, truth: bool) -> Options:
    """Both motors' voltages."""
    return _over_time("motor voltage [V]", history, _sides(history, "voltage"))


def belief(history: History, truth: bool) -> Options:
    """Probability of `normal`, and of the faults that were the likeliest at any time shown."""
    probability = history.probability
    rivals = 1 + np.argsort(-probability[:, 1:].max(axis=0), kind="stable")[:RIVALS]
    lines = {
        classes()[k]: _line(probability[:, k], **_look(k)) for k in (0, *sorted(rivals.tolist()))
    }
    options = _over_time(
        "belief: probability of normal and of the likeliest faults", history, lines, top=1.0
    )
    options["grid"]["top"] = 66  # below two rows of names
    return options


def severity(history: History, truth: bool) -> Options:
    """Severity of the fault that is now the likeliest, where it was likely at all, with its 95 % interval."""
    index = history.suspect
    likely = history.probability[:, history.suspect] >= LIKELY
    mean, low, high = (np.where(likely, values, np.nan) for values in history.severity(index))
    colour = _look(index)["colour"]
    area = {"stack": "interval", "symbol": "none", "lineStyle": {"width": 0}, "color": colour}
    lines = {
        "low": _line(low, colour) | area,
        "95 % interval": _line(high - low, colour) | area | {"areaStyle": {"opacity": 0.2}},
        classes()[index]: _line(mean, colour, width=2),
    }
    options = _over_time("severity, if that is the fault", history, lines, top=1.0)
    options["legend"]["data"] = [name for name in lines if name != "low"]
    return options


def ranking(history: History, truth: bool) -> Options:
    """The likeliest classes now, the likeliest on top; of equal ones the first of the catalogue."""
    percent = np.round(100.0 * history.probability[-1].astype(np.float64), 1)
    order = np.argsort(-percent, kind="stable")[:RANKED][::-1]
    bars = [{"value": float(percent[k]), "itemStyle": {"color": _look(k)["colour"]}} for k in order]
    label = {"show": True, "position": "right", "fontSize": 11}
    return {
        "animation": False,
        "title": _title("belief now [%]"),
        "grid": {"left": 8, "right": 48, "top": 34, "bottom": 8, "containLabel": True},
        "xAxis": {"type": "value", "min": 0, "max": 100},
        "yAxis": {
            "type": "category",
            "data": [classes()[k] for k in order],
            "axisLabel": {"fontSize": 11},
        },
        "series": [{"type": "bar", "data": bars, "label": label, "barCategoryGap": "35%"}],
    }


CHARTS: dict[str, Callable[[History, bool], Options]] = {
    "ranking": ranking,
    "belief": belief,
    "severity": severity,
    "speed": speed,
    "rpm": rpm,
    "current": current,
    "voltage": voltage,
}


def _channel(history: History, name: str) -> np.ndarray:
    return history.observation[:, INDEX[name]]


def _sides(history: History, quantity: str) -> dict[str, Options]:
    colours = dict(zip(SIDES, (PORT, STARBOARD), strict=True))
    return {side: _line(_channel(history, f"{side}_{quantity}"), colours[side]) for side in SIDES}


def _look(index: int) -> dict[str, str]:
    """Colour and dash of a class: `normal` is black, sensors are dashed."""
    if classes()[index] == NORMAL:
        return {"colour": TRUTH, "dash": "solid"}
    sensor = classes()[index].startswith("sensor:")
    return {"colour": PALETTE[(index - 1) % len(PALETTE)], "dash": "dashed" if sensor else "solid"}


def _line(values: np.ndarray, colour: str, dash: str = "solid", width: int = 1) -> Options:
    return {
        "type": "line",
        "data": values,
        "symbol": "none",
        "color": colour,
        "lineStyle": {"width": width, "type": dash},
    }


def _over_time(
    title: str, history: History, lines: Mapping[str, Options], top: float | None = None
) -> Options:
    """Lines over the last minute, with the alarms as areas and what was done as upright lines."""
    end = max(WINDOW, float(history.time[-1]))
    still = end == WINDOW  # else the ends of the axis are no round numbers
    series = [
        line | {"name": name, "data": _points(history.time, line["data"])}
        for name, line in lines.items()
    ]
    series[0] |= _marks(history)
    return {
        "animation": False,
        "title": _title(title),
        "legend": {
            "top": 24,
            "itemWidth": 18,
            "itemHeight": 8,
            "itemGap": 8,
            "textStyle": {"fontSize": 11},
        },
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
            "axisLabel": {"showMinLabel": still, "showMaxLabel": still},
        },
        "yAxis": {"type": "value"} | ({} if top is None else {"min": 0, "max": top}),
        "series": series,
    }


def _points(time: np.ndarray, values: np.ndarray) -> list[list[float | None]]:
    """Pairs for a line; no number becomes a gap."""
    kept = np.round(values.astype(np.float64), 4)
    return [
        [x, y if y == y else None]
        for x, y in zip(np.round(time, 1).tolist(), kept.tolist(), strict=True)
    ]


def _marks(history: History) -> Options:
    label = {"formatter": "{b}", "fontSize": 10, "position": "insideEndTop"}
    lines = [
        {
            "name": mark.what,
            "xAxis": round(mark.time, 1),
            "lineStyle": {"color": MARKED[mark.what], "type": "solid"},
        }
        for mark in history.marks
    ]
    areas = [[{"name": "alarm", "xAxis": begin}, {"xAxis": end}] for begin, end in history.alarms()]
    tint = {"color": "rgba(192, 57, 43, 0.12)"}
    name = {"fontSize": 10, "color": PORT, "position": "insideBottom"}
    return {
        "markLine": {"silent": True, "symbol": "none", "label": label, "data": lines},
        "markArea": {"silent": True, "itemStyle": tint, "label": name, "data": areas},
    }


def _title(text: str) -> Options:
    return {
        "text": text,
        "left": 6,
        "top": 4,
        "textStyle": {"fontSize": 13, "fontWeight": "normal"},
    }
