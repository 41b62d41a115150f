"""Figures of stimuli; `colours` are by stimulus."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from training.report.colours import COMMAND, MARKERS, PORT, SPEED, STARBOARD, TRUTH
from training.report.figures.scores import Series
from training.report.figures.style import (
    legend_above,
    marker_legend,
    new_panels,
    panel_grid,
)

Colours = Mapping[str, str]
ROW_SHARE = 0.7  # of the row of a class, over which its stimuli are placed
LABELS = ("speed [m/s]", "offset [m/s]", "probability")  # of an episode's panels


def speed_ups(
    classes: Sequence[str],
    panels: Mapping[str, Mapping[str, Sequence[Series]]],
    colours: Colours,
) -> Figure:
    """How many times sooner each class (row) is isolated than under a reference stimulus.

    `panels` hold by reference (a panel) and stimulus (value, low, high) of each class.
    """
    figure, axes = new_panels(1.2 + 0.5 * len(classes), 1, len(panels), sharey=True, squeeze=False)
    axes = axes[0]
    for axis, (reference, stimuli) in zip(axes, panels.items(), strict=True):
        _ratios(axis, len(classes), stimuli, colours)
        axis.set(
            xlabel=f"times sooner than under {reference}",
            ylim=(len(classes) - 0.5, -0.5),
        )
    axes[0].set_yticks(range(len(classes)), classes)
    legend_above(figure, axes, columns=5)
    return figure


def _ratios(
    axis: Axes, n_rows: int, stimuli: Mapping[str, Sequence[Series]], colours: Colours
) -> None:
    """Dots with intervals, a row per class, the stimuli one above the other."""
    rows = np.arange(n_rows)
    shifts = np.linspace(-0.5, 0.5, len(stimuli)) * ROW_SHARE
    for shift, (name, triples) in zip(shifts, stimuli.items(), strict=True):
        value, low, high = np.transpose(triples)
        axis.hlines(rows + shift, low, high, color=colours[name], lw=0.9, alpha=0.7)
        axis.plot(value, rows + shift, "o", color=colours[name], ms=3.5, label=name)
    axis.axvline(1.0, color=TRUTH, lw=0.8, ls="--")
    for row in rows[1:]:
        axis.axhline(row - 0.5, color="#e3e8ec", lw=0.8)
    axis.set_xscale("log", base=2)
    axis.xaxis.set_major_formatter("{x:g}")
    axis.grid(False, axis="y")


def delay_cost_plane(
    points: Sequence[Mapping[str, Any]],
    fronts: Mapping[str, Sequence[Series]],
    costs: Mapping[str, str],
    colours: Colours,
) -> Figure:
    """Isolation time against cost, a panel per cost, with the best trade-offs.

    Each point has stimulus (colour), budget (marker), delay (value, low, high) [s] and the costs,
    whose labels are `costs`. `fronts` hold by cost the places (cost, delay) of those points that no
    other beats in both.
    """
    budgets = dict.fromkeys(point["budget"] for point in points)
    markers = dict(zip(budgets, MARKERS * len(budgets), strict=False))
    front_style = {
        "color": TRUTH,
        "lw": 1.0,
        "ls": ":",
        "label": "best trade-offs",
        "zorder": 1,
    }
    figure, axes = new_panels(5.0, 1, len(costs), sharey=True, squeeze=False)
    axes = axes[0]
    for axis, (cost, label) in zip(axes, costs.items(), strict=True):
        axis.plot(*np.transpose(fronts[cost]), **front_style)
        for point in points:
            value, low, high = point["delay"]
            stimulus = point["stimulus"]
            style = {"color": colours[stimulus], "ms": 6, "label": stimulus}
            axis.vlines(point[cost], low, high, color=colours[stimulus], lw=0.9, alpha=0.7)
            axis.plot(point[cost], value, markers[point["budget"]], **style)
        axis.set(xlabel=label)
        axis.margins(0.08)
    axes[0].set_ylabel("isolation, restricted mean [s]")
    marker_legend(figure, markers, "budget")
    legend_above(figure, axes, columns=5)
    return figure


def around_onset(
    time: Series,
    panels: Mapping[str, Mapping[str, Series]],
    label: str,
    colours: Colours,
) -> Figure:
    """Lines over the time since onset, a panel per class, a line per stimulus."""
    n_columns = 4
    figure, axes = panel_grid(len(panels), n_columns, 0.8, 1.75, sharex=True, sharey=True)
    for k, (axis, (title, lines)) in enumerate(zip(axes, panels.items(), strict=True)):
        for name, line in lines.items():
            axis.plot(time, line, color=colours[name], lw=1.1, label=name)
        axis.axvline(0.0, color=TRUTH, lw=0.8, ls=":")
        axis.set_title(title, fontsize=8)
        axis.set_xlim(time[0], time[-1])
        axis.tick_params(labelbottom=k >= len(panels) - n_columns)
    figure.supxlabel("time since onset [s]", fontsize=9)
    figure.supylabel(label, fontsize=9)
    legend_above(figure, axes)
    return figure


def active_episodes(drawn: Sequence[Mapping[str, Any]]) -> Figure:
    """Episodes three abreast: speeds, offset from the mission speed, and probabilities.

    Each has title, onset and isolation [s] (from the start, None if never), time [s], mission,
    command, speed and offset [m/s], normal and true (probabilities).
    """
    n_columns = 3
    n_rows = -(-len(drawn) // n_columns)
    options = {
        "sharex": True,
        "sharey": "row",
        "height_ratios": [1.3, 0.8, 1.0] * n_rows,
    }
    figure, grid = new_panels(0.6 + 4.3 * n_rows, 3 * n_rows, n_columns, **options)
    for k, episode in enumerate(drawn):
        row, column = divmod(k, n_columns)
        _episode(grid[3 * row : 3 * row + 3, column], episode)
    for axis, label in zip(grid[:, 0], LABELS * n_rows, strict=True):
        axis.set_ylabel(label)
    for axis in grid[-1]:
        axis.set_xlabel("time [s]")
    figure.align_ylabels(grid[:, 0])
    legend_above(figure, grid.flat, columns=5)
    return figure


def _episode(axes: Sequence[Axes], episode: Mapping[str, Any]) -> None:
    time = episode["time"]
    speed, offset, probability = axes
    speed.plot(time, episode["command"], color=STARBOARD, lw=1.0, label="commanded")
    speed.plot(time, episode["speed"], color=SPEED, lw=1.0, label="true")
    speed.plot(time, episode["mission"], color=COMMAND, lw=1.2, ls="--", label="mission's")
    offset.plot(time, episode["offset"], color=STARBOARD, lw=1.0)
    probability.plot(time, episode["normal"], color=COMMAND, lw=1.2, label="p(normal)")
    probability.plot(time, episode["true"], color=PORT, lw=1.2, label="p(true fault)")
    speed.set_title(episode["title"], fontsize=8)
    speed.set_xlim(0.0, time[-1])
    probability.set_ylim(-0.04, 1.04)
    isolation = episode["isolation"]
    for axis in axes:
        axis.axvline(episode["onset"], color=TRUTH, lw=1.0, ls=":", label="onset")
        if isolation is not None:
            axis.axvline(isolation, color=PORT, lw=1.0, ls="--", label="isolated for good")
