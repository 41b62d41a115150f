"""Figures of the logs of real vehicles: their calibration and their diagnosis."""

from collections.abc import Mapping, Sequence
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from training.report.colours import (
    CLASS_COLOURS,
    COLOURS,
    COMMAND,
    PORT,
    SPEED,
    STARBOARD,
    TRUTH,
    class_style,
)
from training.report.figures.style import (
    fill_band,
    legend_above,
    new_panels,
    panel_grid,
)

Series = Sequence[float | None]
LINE_COLOURS = {
    "port": PORT,
    "starboard": STARBOARD,
    "speed": SPEED,
    "commanded": COMMAND,
    "threshold": TRUTH,
    "drag ± 1 std": SPEED,
}
SIDE_COLOURS = {"all shafts": SPEED, "port": PORT, "starboard": STARBOARD}
OTHER_COLOURS = COLOURS[3:]  # of lines that are of no side and no speed
DASHED = ("threshold", "commanded")
USUAL = 97.0  # per cent of the values that an axis with a limit shows
HEADROOM = 1.3
LABEL_WIDTH = 20  # characters in a line of an axis label
HEALTHY_BAND = {"color": COMMAND, "alpha": 0.25, "lw": 0, "label": "healthy band"}
SPARSE = 100  # points; fewer are marked one by one


def measured_and_simulated(time: Series, panels: Mapping[str, Mapping[str, Series]]) -> Figure:
    """Readings and their simulation, a row per channel, and beside it their difference."""
    height = 1.9 * len(panels) + 0.7
    options = {"sharex": True, "squeeze": False, "width_ratios": (3, 2)}
    figure, axes = new_panels(height, len(panels), 2, **options)
    for (left, right), (label, lines) in zip(axes, panels.items(), strict=True):
        measured = np.array(lines["measured"], float)
        simulated = np.array(lines["simulated"], float)
        residual = measured - simulated
        left.plot(time, measured, ".", ms=2, color=COMMAND, label="measured")
        left.plot(time, simulated, color=SPEED, lw=1.2, label="simulated")
        right.plot(time, residual, ".", ms=2, color=PORT, label="measured − simulated")
        left.set(ylabel=label, xlim=(time[0], time[-1]))
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    legend_above(figure, axes.flat)
    return figure


def mission_estimates(panels: Mapping[str, Mapping]) -> Figure:
    """Estimates of each mission around the common one, relative, with the healthy band.

    `panels` hold by parameter the half-width `band`, and `sides` with mission (number), value and
    std of the estimates.
    """
    figure, axes = panel_grid(len(panels), 2, 0.5, 2.1)
    for axis, (name, panel) in zip(axes, panels.items(), strict=True):
        band = 100.0 * panel["band"]
        axis.axhspan(-band, band, color=STARBOARD, alpha=0.12, lw=0, label="healthy band")
        axis.axhline(0.0, color=TRUTH, lw=0.8)
        for k, (side, estimates) in enumerate(panel["sides"].items()):
            _error_bars(axis, side, estimates, shift=0.16 * k)
        axis.set_title(name, loc="left", fontsize=9)
        axis.set_ylabel("from common [%]")
        axis.xaxis.get_major_locator().set_params(integer=True)
        axis.set_xlabel("mission")
    legend_above(figure, axes, columns=4)
    return figure


def _error_bars(axis: Axes, side: str, estimates: Mapping[str, Series], shift: float) -> None:
    mission = np.array(estimates["mission"], float)
    value = 100.0 * np.array(estimates["value"], float)
    std = 100.0 * np.array(estimates["std"], float)
    style = {"fmt": "o", "ms": 3, "lw": 1, "color": SIDE_COLOURS[side]}
    axis.errorbar(mission + shift, value, 2.0 * std, label=f"{side}, ± 2 std", **style)


def diagnosed_log(
    panels: Mapping[str, Mapping[str, Mapping[str, Sequence[float]]]],
    alarms: Sequence[Sequence[float]],
    logarithmic: Sequence[str] = (),
) -> Figure:
    """Panels above one another on one time axis, the alarms shaded in all of them.

    `panels` hold by label of the axis and name of the line time [s], value, the half-width of a
    band around it if it has one, and the limit of a healthy band around zero if it has one. A name
    that ends in ", healthy" is the dotted companion of the line before.
    `alarms` are begins and ends [s], (n_alarms, 2); `logarithmic` are labels of axes.
    """
    figure, axes = new_panels(1.45 * len(panels) + 0.5, len(panels), 1, sharex=True, squeeze=False)
    axes = axes[:, 0]
    for axis, (label, lines) in zip(axes, panels.items(), strict=True):
        for k, (name, line) in enumerate(lines.items()):
            _log_line(axis, name, line, OTHER_COLOURS[k % len(OTHER_COLOURS)])
        for begin, end in alarms:
            axis.axvspan(begin, max(end, begin + 0.1), color=PORT, alpha=0.10, lw=0)
        axis.set_ylabel(fill(label, LABEL_WIDTH))
        if label in logarithmic:
            axis.set_yscale("log")
            axis.yaxis.set_major_formatter("{x:g}")
        if lines:
            axis.legend(
                loc="center left",
                bbox_to_anchor=(1.0, 0.5),
                frameon=False,
                fontsize=8,
            )
    figure.align_ylabels(axes)
    axes[-1].set_xlabel("time [s]; shaded: alarm")
    return figure


def _log_line(
    axis: Axes, name: str, line: Mapping[str, Sequence[float]], default_colour: str
) -> None:
    base, healthy, _ = name.partition(", healthy")
    side = base.partition(" ")[0]
    colour = LINE_COLOURS.get(base) or LINE_COLOURS.get(side, default_colour)
    style = {"color": colour, "lw": 1.2, "label": name}
    if name in CLASS_COLOURS:
        style["color"], style["ls"] = class_style(name)
    elif healthy:
        style["ls"] = ":"
    elif base in DASHED:
        style["ls"] = "--"
    if len(line["time"]) < SPARSE and base not in DASHED:
        style |= {"marker": ".", "ms": 3}
    time, value, width, limit = (
        np.array(line[key], float) if key in line else None
        for key in ("time", "value", "width", "limit")
    )
    axis.plot(time, value, **style)
    if width is not None:
        fill_band(axis, time, value, width, colour)
    if limit is not None:
        axis.fill_between(time, -limit, limit, **HEALTHY_BAND)
        axis.set_ylim(_ends(value, limit))


def _ends(value: np.ndarray, limit: np.ndarray) -> tuple[float, float]:
    """Ends of an axis for most values and limits: single ones are far off at low speed."""
    largest = np.nanpercentile(limit, USUAL)
    low, high = np.nanpercentile(value, (100.0 - USUAL, USUAL))
    return HEADROOM * min(low, -largest), HEADROOM * max(high, largest)
