"""Figures of the benchmark."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from training.report.colours import COMMAND, MARKERS, PORT, SPEED, STARBOARD, TRUTH
from training.report.figures.scores import Series, heat_map, line_styles
from training.report.figures.style import (
    legend_above,
    marker_legend,
    new_panels,
    panel_grid,
)

LOWEST = -1000.0  # ln p(normal) that is shown
# colour by whether the most probable fault is the right one, and whether the alarm stands
BANDS = {
    "no alarm, another fault on top": "#f6d5d1",
    "no alarm, right fault on top": "#cfe8d6",
    "alarm, another fault on top": PORT,
    "alarm, right fault on top": STARBOARD,
}
EPISODE_LABELS = ("speed [m/s]", "shaft speed [rpm]", "current [A]", "ln p(normal)")


def curves(
    panels: Mapping[str, Mapping[str, Mapping[str, Series]]],
    references: Collection[str],
    labels: tuple[str, str],
    top: float,
    logarithmic: bool = False,
    marks: Series = (),
    bounds: Mapping[str, Mapping[str, Series]] | None = None,
) -> Figure:
    """Lines by name in one or several panels.

    `panels` are lines {x, y} by title of the panel and name, `labels` those of x and y. The y axis
    ends at `top`, x may be logarithmic, and `marks` are values of x with a vertical line. `bounds`
    are lines by panel that no other should cross; `references` are names that do not compete.
    """
    names = dict.fromkeys(name for lines in panels.values() for name in lines)
    styles = line_styles(names, references)
    bound_style = {"color": TRUTH, "lw": 2.2, "ls": (0, (1, 1)), "label": "bound"}
    n_columns = min(2, len(panels))
    figure, axes = panel_grid(len(panels), n_columns, 0.7, 3.5, sharex=True, sharey=True)
    for axis, (title, lines) in zip(axes, panels.items(), strict=True):
        for name, style in styles.items():
            if name in lines:
                axis.plot(lines[name]["x"], lines[name]["y"], label=name, **style)
        if bounds and title in bounds:
            axis.plot(bounds[title]["x"], bounds[title]["y"], **bound_style)
        for mark in marks:
            axis.axvline(mark, color=COMMAND, lw=0.8, ls=":")
        axis.set(title=title, xlabel=labels[0], ylim=(-0.02 * top, 1.02 * top))
        if logarithmic:
            axis.set_xscale("log")
            axis.xaxis.set_major_formatter("{x:g}")
    for axis in axes[::n_columns]:
        axis.set_ylabel(labels[1])
    legend_above(figure, axes, columns=6)
    return figure


def cost_delay(
    points: Mapping[str, Mapping[str, Mapping[str, float]]],
    references: Collection[str],
    costs: Mapping[str, str],
) -> Figure:
    """Isolation time against the cost of the stimulus, a panel per cost.

    `points` are by diagnoser (a colour and a line) and stimulus (a marker): the costs, and `delay`
    [s]. `costs` are labels of the axes; `references` are diagnosers that do not compete.
    """
    stimuli = dict.fromkeys(stimulus for by_stimulus in points.values() for stimulus in by_stimulus)
    markers = dict(zip(stimuli, MARKERS * len(stimuli), strict=False))
    figure, axes = new_panels(4.6, 1, len(costs), sharey=True, squeeze=False)
    axes = axes[0]
    for axis, (cost, label) in zip(axes, costs.items(), strict=True):
        for name, style in line_styles(points, references).items():
            places = [(point[cost], point["delay"]) for point in points[name].values()]
            axis.plot(*np.transpose(places), label=name, **(style | {"lw": 0.8}))
            for stimulus, place in zip(points[name], places, strict=True):
                axis.plot(*place, markers[stimulus], color=style["color"], ms=6)
        axis.set(xlabel=label)
        axis.margins(0.08)
        axis.locator_params(axis="x", nbins=6)
    axes[0].set_ylabel("isolation, restricted mean [s]")
    marker_legend(figure, markers, "stimulus")
    legend_above(figure, axes, columns=6)
    return figure


def class_delays(classes: Sequence[str], delays: Mapping[str, Series], horizon: float) -> Figure:
    """Delay [s] of each class (row) by column, 0 to the horizon, the bounds apart on the left."""
    values = np.array(list(delays.values()), float).T
    figure = heat_map(classes, list(delays), values, horizon, 1, ("", "true class"))
    n_bounds = sum(name.startswith("bound") for name in delays)
    if n_bounds:
        figure.axes[0].axvline(n_bounds - 0.5, color=TRUTH, lw=2.5)
    return figure


def episodes(drawn: Sequence[Mapping[str, Any]]) -> Figure:
    """Episodes side by side: readings, log p(normal) with its threshold, and the fault on top.

    Each has title, onset [s], time [s], readings by channel, log_normal, threshold, alarm (bools)
    and right (whether the most probable fault is the true one, bools).
    """
    options = {
        "sharex": "col",
        "sharey": "row",
        "height_ratios": [1.0, 1.0, 1.0, 1.2, 0.18],
    }
    figure, grid = new_panels(6.6, 5, len(drawn), squeeze=False, **options)
    for axes, episode in zip(grid.T, drawn, strict=True):
        _readings(axes[:3], episode)
        _belief(axes[3], episode)
        _verdict_strip(axes[4], episode)
        axes[0].set_title(episode["title"], fontsize=8)
        axes[4].set(xlabel="time [s]", xlim=(0, episode["time"][-1]))
        for axis in axes:
            axis.axvline(episode["onset"], color=TRUTH, lw=1.0, ls=":", label="onset")
    first_column = grid[:4, 0]
    for axis, label in zip(first_column, EPISODE_LABELS, strict=True):
        axis.set_ylabel(label)
    figure.align_ylabels(first_column)
    bands = [Patch(color=colour, label=label) for label, colour in BANDS.items()]
    figure.legend(handles=bands, loc="outside lower center", ncols=4, frameon=False)
    legend_above(figure, first_column)
    return figure


def _readings(axes: Sequence[Axes], episode: Mapping[str, Any]) -> None:
    time = episode["time"]
    readings = episode["readings"]
    axes[0].plot(time, readings["speed"], color=SPEED, lw=1.0, label="speed")
    axes[0].plot(
        time,
        readings["speed_command"],
        color=COMMAND,
        lw=1.0,
        ls="--",
        label="command",
    )
    for axis, kind in zip(axes[1:], ("rpm", "current"), strict=True):
        port = readings[f"port_{kind}"]
        starboard = readings[f"starboard_{kind}"]
        axis.plot(time, port, color=PORT, lw=1.0, label="port")
        axis.plot(time, starboard, color=STARBOARD, lw=1.0, ls="--", label="starboard")


def _belief(axis: Axes, episode: Mapping[str, Any]) -> None:
    log_normal = np.maximum(episode["log_normal"], LOWEST)
    axis.plot(episode["time"], log_normal, color=TRUTH, lw=1.2, label="ln p(normal)")
    if episode["threshold"] is not None:
        axis.axhline(episode["threshold"], color=PORT, lw=1.0, ls="--", label="threshold")
    # linear above -1, then logarithmic, as the minor ticks show
    axis.set_yscale("symlog", linthresh=1.0, subs=range(2, 10))
    axis.yaxis.set_major_formatter("{x:g}")


def _verdict_strip(axis: Axes, episode: Mapping[str, Any]) -> None:
    """A strip in the colours of `BANDS`."""
    time = np.array(episode["time"])
    width = time[1] - time[0]
    kind = 2 * np.array(episode["alarm"], int) + np.array(episode["right"], int)
    for k, colour in enumerate(BANDS.values()):
        spans = [(start, width) for start in time[kind == k]]
        axis.broken_barh(spans, (0, 1), color=colour, lw=0)
    axis.set(yticks=[], ylim=(0, 1))
    axis.grid(False)
