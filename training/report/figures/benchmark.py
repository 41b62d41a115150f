"""Figures of the benchmark: functions that take data and return the figure."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from training.report.figures.scores import Series, heat_map, line_styles
from training.report.figures.style import (
    COMMAND,
    PORT,
    SPEED,
    STARBOARD,
    STYLE,
    TRUTH,
    legend_above,
)

MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
DEEPEST = -1000.0  # ln p(normal) that is drawn
# colour by whether the most probable fault is the right one, and whether the alarm stands
BANDS = {
    "no alarm, another fault on top": "#f6d5d1",
    "no alarm, right fault on top": "#cfe8d6",
    "alarm, another fault on top": PORT,
    "alarm, right fault on top": STARBOARD,
}


def curves(
    panels: Mapping[str, Mapping[str, Mapping[str, Series]]],
    references: Collection[str],
    labels: tuple[str, str],
    top: float,
    logarithmic: bool = False,
    marks: Series = (),
    bounds: Mapping[str, Mapping[str, Series]] | None = None,
) -> Figure:
    """Lines {x, y} by name, a panel for each of the names above; x logarithmic or not, y from 0 to `top`.

    `labels` of x and y; `marks` are vertical lines; `bounds` are lines {x, y} by panel that no
    other should cross.
    """
    names = dict.fromkeys(name for lines in panels.values() for name in lines)
    columns = min(2, len(panels))
    with matplotlib.rc_context(STYLE):
        rows = -(-len(panels) // columns)
        figure = Figure(figsize=(9.6, 0.7 + 3.5 * rows), layout="constrained")
        axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        for axis in axes.flat[len(panels) :]:
            axis.remove()
        for axis, (title, lines) in zip(axes.flat, panels.items(), strict=False):
            for name, style in line_styles(names, references).items():
                if name in lines:
                    axis.plot(lines[name]["x"], lines[name]["y"], label=name, **style)
            if bounds and title in bounds:
                axis.plot(
                    bounds[title]["x"],
                    bounds[title]["y"],
                    color=TRUTH,
                    lw=2.2,
                    ls=(0, (1, 1)),
                    label="bound",
                )
            for mark in marks:
                axis.axvline(mark, color=COMMAND, lw=0.8, ls=":")
            axis.set(title=title, xlabel=labels[0], ylim=(-0.02 * top, 1.02 * top))
            if logarithmic:
                axis.set_xscale("log")
                axis.xaxis.set_major_formatter("{x:g}")
        for axis in axes[:, 0]:
            axis.set_ylabel(labels[1])
        legend_above(figure, axes.flat[: len(panels)], columns=6)
    return figure


def cost_delay(
    points: Mapping[str, Mapping[str, Mapping[str, float]]],
    references: Collection[str],
    costs: Mapping[str, str],
) -> Figure:
    """Isolation time against what the stimulus costs, a panel per cost (key and label of its axis).

    `points` by diagnoser (colour) and stimulus (marker) hold the costs and `delay` [s]; a line
    joins a diagnoser's.
    """
    stimuli = dict.fromkeys(stimulus for by_stimulus in points.values() for stimulus in by_stimulus)
    markers = dict(zip(stimuli, MARKERS * len(stimuli), strict=False))
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 4.6), layout="constrained")
        axes = figure.subplots(1, len(costs), sharey=True, squeeze=False)[0]
        for axis, (cost, label) in zip(axes, costs.items(), strict=True):
            for name, style in line_styles(points, references).items():
                by_stimulus = points[name]
                style = style | {"lw": 0.8}
                places = [(point[cost], point["delay"]) for point in by_stimulus.values()]
                axis.plot(*np.transpose(places), label=name, **style)
                for stimulus, place in zip(by_stimulus, places, strict=True):
                    axis.plot(*place, markers[stimulus], color=style["color"], ms=6)
            axis.set(xlabel=label)
            axis.margins(0.08)
            axis.locator_params(axis="x", nbins=6)
        axes[0].set_ylabel("isolation, restricted mean [s]")
        handles = [Line2D([], [], marker=marker, color=TRUTH, ls="") for marker in markers.values()]
        figure.legend(
            handles, markers, title="stimulus", loc="outside lower center", ncols=6, frameon=False
        )
        legend_above(figure, axes, columns=6)
    return figure


def class_delays(classes: Sequence[str], delays: Mapping[str, Series], horizon: float) -> Figure:
    """Delay [s] of each class (row) by column, 0 to the horizon; those called bound stand apart on the left."""
    values = np.array(list(delays.values()), float).T
    figure = heat_map(classes, list(delays), values, horizon, 1, ("", "true class"))
    n_bounds = sum(name.startswith("bound") for name in delays)
    if n_bounds:
        figure.axes[0].axvline(n_bounds - 0.5, color=TRUTH, lw=2.5)
    return figure


def episodes(drawn: Sequence[Mapping[str, Any]]) -> Figure:
    """Episodes side by side: readings, log p(normal) with its threshold, and what fault is on top.

    An episode holds title, onset [s], time [s], readings by channel, log_normal, threshold, alarm
    (bools) and right (whether the most probable fault is the true one, bools).
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 6.6), layout="constrained")
        heights = [1.0, 1.0, 1.0, 1.2, 0.18]
        grid = figure.subplots(
            5, len(drawn), sharex="col", sharey="row", squeeze=False, height_ratios=heights
        )
        for axes, episode in zip(grid.T, drawn, strict=True):
            _readings(axes[:3], episode)
            _belief(axes[3], episode)
            _band(axes[4], episode)
            axes[0].set_title(episode["title"], fontsize=8)
            axes[4].set(xlabel="time [s]", xlim=(0, episode["time"][-1]))
            for axis in axes:
                axis.axvline(episode["onset"], color=TRUTH, lw=1.0, ls=":", label="onset")
        labels = ("speed [m/s]", "shaft speed [rpm]", "current [A]", "ln p(normal)")
        for axis, label in zip(grid[:4, 0], labels, strict=True):
            axis.set_ylabel(label)
        figure.align_ylabels(grid[:4, 0])
        bands = [Patch(color=colour, label=label) for label, colour in BANDS.items()]
        figure.legend(handles=bands, loc="outside lower center", ncols=4, frameon=False)
        legend_above(figure, grid[:4, 0])
    return figure


def _readings(axes: Sequence[Axes], episode: Mapping[str, Any]) -> None:
    time = episode["time"]
    readings = episode["readings"]
    axes[0].plot(time, readings["speed"], color=SPEED, lw=1.0, label="speed")
    axes[0].plot(time, readings["speed_command"], color=COMMAND, lw=1.0, ls="--", label="command")
    for axis, kind in zip(axes[1:], ("rpm", "current"), strict=True):
        axis.plot(time, readings[f"port_{kind}"], color=PORT, lw=1.0, label="port")
        axis.plot(
            time, readings[f"starboard_{kind}"], color=STARBOARD, lw=1.0, ls="--", label="starboard"
        )


def _belief(axis: Axes, episode: Mapping[str, Any]) -> None:
    axis.plot(
        episode["time"],
        np.maximum(episode["log_normal"], DEEPEST),
        color=TRUTH,
        lw=1.2,
        label="ln p(normal)",
    )
    if episode["threshold"] is not None:
        axis.axhline(episode["threshold"], color=PORT, lw=1.0, ls="--", label="threshold")
    axis.set_yscale("symlog", linthresh=1.0)
    axis.yaxis.set_major_formatter("{x:g}")


def _band(axis: Axes, episode: Mapping[str, Any]) -> None:
    """A strip in the colours of `BANDS`."""
    colours = list(BANDS.values())
    kind = 2 * np.array(episode["alarm"], int) + np.array(episode["right"], int)
    step = episode["time"][1] - episode["time"][0]
    for k, colour in enumerate(colours):
        spans = [
            (time, step)
            for time, of_kind in zip(episode["time"], kind, strict=True)
            if of_kind == k
        ]
        axis.broken_barh(spans, (0, 1), color=colour, lw=0)
    axis.set(yticks=[], ylim=(0, 1))
    axis.grid(False)
