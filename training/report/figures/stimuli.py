"""Figures of stimuli: functions that take data and return the figure. `colours` are by stimulus."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from training.report.figures.benchmark import MARKERS
from training.report.figures.scores import Series
from training.report.figures.style import (
    COMMAND,
    PORT,
    SPEED,
    STARBOARD,
    STYLE,
    TRUTH,
    legend_above,
)

Colours = Mapping[str, str]
SPREAD = 0.7  # of a class' row, over which its stimuli are spread
LABELS = ("speed [m/s]", "offset [m/s]", "probability")  # of an episode's panels


def speed_ups(
    classes: Sequence[str], panels: Mapping[str, Mapping[str, Sequence[Series]]], colours: Colours
) -> Figure:
    """How many times sooner each class (row) is isolated than under a reference, a panel each: dots with intervals.

    `panels` by reference and stimulus hold (value, low, high) of each class.
    """
    rows = np.arange(len(classes))
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 1.2 + 0.5 * len(classes)), layout="constrained")
        axes = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
        for axis, (reference, stimuli) in zip(axes, panels.items(), strict=True):
            places = np.linspace(-0.5, 0.5, len(stimuli)) * SPREAD
            for place, (name, triples) in zip(places, stimuli.items(), strict=True):
                value, low, high = np.transpose(triples)
                axis.hlines(rows + place, low, high, color=colours[name], lw=0.9, alpha=0.7)
                axis.plot(value, rows + place, "o", color=colours[name], ms=3.5, label=name)
            axis.axvline(1.0, color=TRUTH, lw=0.8, ls="--")
            for row in rows[1:]:
                axis.axhline(row - 0.5, color="#e3e8ec", lw=0.8)
            axis.set_xscale("log", base=2)
            axis.xaxis.set_major_formatter("{x:g}")
            axis.set(xlabel=f"times sooner than under {reference}", ylim=(len(classes) - 0.5, -0.5))
            axis.grid(False, axis="y")
        axes[0].set_yticks(rows, classes)
        legend_above(figure, axes, columns=5)
    return figure


def delay_cost_plane(
    points: Sequence[Mapping[str, Any]],
    fronts: Mapping[str, Sequence[Series]],
    costs: Mapping[str, str],
    colours: Colours,
) -> Figure:
    """Isolation time against what it costs, a panel per cost (key and label of its axis), with the best trade-offs.

    A point holds stimulus (colour), budget (marker), delay (value, low, high) [s] and the costs;
    `fronts` by cost are the places (cost, delay) of those that no other beats in both.
    """
    budgets = dict.fromkeys(point["budget"] for point in points)
    markers = dict(zip(budgets, MARKERS * len(budgets), strict=False))
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 5.0), layout="constrained")
        axes = figure.subplots(1, len(costs), sharey=True, squeeze=False)[0]
        for axis, (cost, label) in zip(axes, costs.items(), strict=True):
            axis.plot(
                *np.transpose(fronts[cost]),
                color=TRUTH,
                lw=1.0,
                ls=":",
                label="best trade-offs",
                zorder=1,
            )
            for point in points:
                (value, low, high) = point["delay"]
                colour = colours[point["stimulus"]]
                axis.vlines(point[cost], low, high, color=colour, lw=0.9, alpha=0.7)
                axis.plot(
                    point[cost],
                    value,
                    markers[point["budget"]],
                    color=colour,
                    ms=6,
                    label=point["stimulus"],
                )
            axis.set(xlabel=label)
            axis.margins(0.08)
        axes[0].set_ylabel("isolation, restricted mean [s]")
        handles = [Line2D([], [], marker=marker, color=TRUTH, ls="") for marker in markers.values()]
        figure.legend(
            handles, markers, title="budget", loc="outside lower center", ncols=6, frameon=False
        )
        legend_above(figure, axes, columns=5)
    return figure


def around_onset(
    time: Series, panels: Mapping[str, Mapping[str, Series]], label: str, colours: Colours
) -> Figure:
    """Lines over the time since onset, a panel per class, a line per stimulus."""
    columns = 4
    rows = -(-len(panels) // 4)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 0.8 + 1.75 * rows), layout="constrained")
        axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        for axis in axes.flat[len(panels) :]:
            axis.remove()
        for k, (axis, (title, lines)) in enumerate(zip(axes.flat, panels.items(), strict=False)):
            for name, values in lines.items():
                axis.plot(time, values, color=colours[name], lw=1.1, label=name)
            axis.axvline(0.0, color=TRUTH, lw=0.8, ls=":")
            axis.set_title(title, fontsize=8)
            axis.set_xlim(time[0], time[-1])
            axis.tick_params(labelbottom=k >= len(panels) - columns)
        figure.supxlabel("time since onset [s]", fontsize=9)
        figure.supylabel(label, fontsize=9)
        legend_above(figure, axes.flat[: len(panels)])
    return figure


def active_episodes(drawn: Sequence[Mapping[str, Any]]) -> Figure:
    """Episodes three abreast: speeds, offset from the mission's, and probabilities; onset and isolation marked.

    An episode holds title, onset and isolation [s] (from the start, None if never), time [s],
    mission, command, speed and offset [m/s], normal and true (probabilities).
    """
    columns = 3
    rows = -(-len(drawn) // 3)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 0.6 + 4.3 * rows), layout="constrained")
        grid = figure.subplots(
            3 * rows, columns, sharex=True, sharey="row", height_ratios=[1.3, 0.8, 1.0] * rows
        )
        for k, episode in enumerate(drawn):
            row, column = divmod(k, columns)
            _episode(grid[3 * row : 3 * row + 3, column], episode)
        for row in range(rows):
            for axis, label in zip(grid[3 * row : 3 * row + 3, 0], LABELS, strict=True):
                axis.set_ylabel(label)
        for axis in grid[-1]:
            axis.set_xlabel("time [s]")
        figure.align_ylabels(grid[:, 0])
        legend_above(figure, grid.flat, columns=5)
    return figure


def _episode(axes: Sequence[Axes], episode: Mapping[str, Any]) -> None:
    time = episode["time"]
    axes[0].plot(time, episode["command"], color=STARBOARD, lw=1.0, label="commanded")
    axes[0].plot(time, episode["speed"], color=SPEED, lw=1.0, label="true")
    axes[0].plot(time, episode["mission"], color=COMMAND, lw=1.2, ls="--", label="mission's")
    axes[1].plot(time, episode["offset"], color=STARBOARD, lw=1.0)
    axes[2].plot(time, episode["normal"], color=COMMAND, lw=1.2, label="p(normal)")
    axes[2].plot(time, episode["true"], color=PORT, lw=1.2, label="p(true fault)")
    axes[0].set_title(episode["title"], fontsize=8)
    axes[0].set_xlim(0.0, time[-1])
    axes[2].set_ylim(-0.04, 1.04)
    for axis in axes:
        axis.axvline(episode["onset"], color=TRUTH, lw=1.0, ls=":", label="onset")
        if episode["isolation"] is not None:
            axis.axvline(
                episode["isolation"], color=PORT, lw=1.0, ls="--", label="isolated for good"
            )
