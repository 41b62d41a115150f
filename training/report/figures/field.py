"""Figures of the logs of real vehicles: their calibration and their diagnosis."""

from collections.abc import Mapping, Sequence

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from training.report.figures.scores import COLOURS
from training.report.figures.style import (
    COMMAND,
    PORT,
    SPEED,
    STARBOARD,
    STYLE,
    TRUTH,
    legend_above,
)

Series = Sequence[float | None]
NAMED = {
    "port": PORT,
    "starboard": STARBOARD,
    "speed": SPEED,
    "commanded": COMMAND,
    "threshold": TRUTH,
}
DASHED = ("threshold", "commanded")
SPARSE = 100  # points; fewer are marked one by one


def measured_and_simulated(time: Series, panels: Mapping[str, Mapping[str, Series]]) -> Figure:
    """Readings over what the model makes of them, a row per channel, and their difference beside it."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 1.9 * len(panels) + 0.7), layout="constrained")
        axes = figure.subplots(len(panels), 2, sharex=True, squeeze=False, width_ratios=(3, 2))
        for (left, right), (label, lines) in zip(axes, panels.items(), strict=True):
            measured, simulated = (
                np.array(lines[name], float) for name in ("measured", "simulated")
            )
            left.plot(time, measured, ".", ms=2, color=COMMAND, label="measured")
            left.plot(time, simulated, color=SPEED, lw=1.2, label="simulated")
            right.plot(
                time, measured - simulated, ".", ms=2, color=PORT, label="measured − simulated"
            )
            left.set(ylabel=label, xlim=(time[0], time[-1]))
        for axis in axes[-1]:
            axis.set_xlabel("time [s]")
        legend_above(figure, axes.flat)
    return figure


def mission_estimates(panels: Mapping[str, Mapping]) -> Figure:
    """Each mission's own estimates around the common one, relative, a panel per parameter, with the healthy band."""
    colours = {"all shafts": SPEED, "port": PORT, "starboard": STARBOARD}
    with matplotlib.rc_context(STYLE):
        columns = 2
        rows = -(-len(panels) // 2)
        figure = Figure(figsize=(9.6, 2.1 * rows + 0.5), layout="constrained")
        axes = figure.subplots(rows, columns, squeeze=False)
        for axis in axes.flat[len(panels) :]:
            axis.remove()
        for axis, (name, panel) in zip(axes.flat, panels.items(), strict=False):
            band = 100.0 * panel["band"]
            axis.axhspan(-band, band, color=STARBOARD, alpha=0.12, lw=0, label="healthy band")
            axis.axhline(0.0, color=TRUTH, lw=0.8)
            for k, (side, points) in enumerate(panel["sides"].items()):
                place, value, std = (
                    np.array(points[key], float) for key in ("mission", "value", "std")
                )
                bars = dict(fmt="o", ms=3, lw=1, color=colours[side], label=f"{side}, ± 2 std")
                axis.errorbar(place + 0.16 * k, 100.0 * value, 200.0 * std, **bars)
            axis.set_title(name, loc="left", fontsize=9)
            axis.set_ylabel("from common [%]")
            axis.xaxis.get_major_locator().set_params(integer=True)
            axis.set_xlabel("mission")
        legend_above(figure, axes.flat[: len(panels)], columns=4)
    return figure


def diagnosed_log(
    panels: Mapping[str, Mapping[str, Mapping[str, Sequence[float]]]],
    alarms: Sequence[Sequence[float]],
) -> Figure:
    """Panels by axis label, in each lines by name: time [s], value, and a half-width if it has a band.

    alarms (n_alarms, 2): begin and end [s]. A name ending in ", healthy" is the dotted companion of
    the one before.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 1.45 * len(panels) + 0.5), layout="constrained")
        axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        for axis, (label, lines) in zip(axes, panels.items(), strict=True):
            for k, (name, line) in enumerate(lines.items()):
                _draw(axis, name, line, COLOURS[k % len(COLOURS)])
            for begin, end in alarms:
                axis.axvspan(begin, max(end, begin + 0.1), color=PORT, alpha=0.10, lw=0)
            axis.set_ylabel(label)
            if lines:
                axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize=8)
        axes[-1].set_xlabel("time [s]; shaded: alarm")
    return figure


def _draw(axis, name: str, line: Mapping[str, Sequence[float]], other: str) -> None:
    base, healthy, _ = name.partition(", healthy")
    colour = NAMED.get(base, other)
    dash = ":" if healthy else "--" if base in DASHED else "-"
    marker = "." if len(line["time"]) < SPARSE and base not in DASHED else None
    axis.plot(
        line["time"], line["value"], color=colour, lw=1.2, ls=dash, marker=marker, ms=3, label=name
    )
    if "width" in line:
        value = np.array(line["value"])
        width = np.array(line["width"])
        axis.fill_between(
            line["time"], value - width, value + width, color=colour, alpha=0.18, lw=0
        )
