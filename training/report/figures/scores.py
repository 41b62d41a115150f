"""Figures of how good diagnosers are: functions that take data and return the figure."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from training.report.figures.style import (
    COMMAND,
    PORT,
    SPEED,
    STARBOARD,
    STYLE,
    TRUTH,
    legend_above,
)

Series = Sequence[float]
COLOURS = (
    PORT,
    SPEED,
    STARBOARD,
    "#b9770e",
    "#7d3c98",
    "#117a8b",
    "#8d6e63",
    "#d4478c",
    "#5d6d7e",
    "#a3b81e",
    "#f0a8b8",
    "#4a235a",
)
DASHES = ("--", ":", "-.", (0, (5, 1, 1, 1, 1, 1)))


def line_styles(names: Iterable[str], references: Collection[str]) -> dict[str, dict[str, Any]]:
    """How the line of each name looks: coloured and the first thick, references grey and dashed, and these last."""
    names = list(names)
    ranked = [name for name in names if name not in references]
    styles = {
        name: {"color": COLOURS[k % len(COLOURS)], "lw": 1.3 if k else 2.2}
        for k, name in enumerate(ranked)
    }
    for k, name in enumerate(name for name in names if name in references):
        styles[name] = {"color": COMMAND, "lw": 1.3, "ls": DASHES[k % len(DASHES)]}
    return styles


def isolation_curves(
    time: Series, shares: Mapping[str, Series], references: Sequence[str]
) -> Figure:
    """Share of the faults isolated by a time since onset, a line per name."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 4.8), layout="constrained")
        axis = figure.subplots()
        for name, style in line_styles(shares, references).items():
            axis.plot(time, shares[name], label=name, **style)
        axis.set(
            xlabel="time since onset [s]",
            ylabel="share of the faults isolated",
            xlim=(0, time[-1]),
            ylim=(-0.02, 1.02),
        )
        legend_above(figure, [axis], columns=5)
    return figure


def heat_map(
    rows: Sequence[str],
    columns: Sequence[str],
    values: np.ndarray,
    top: float,
    digits: int,
    labels: tuple[str, str],
) -> Figure:
    """Values from 0 to `top` as colour and, unless they round to 0, as numbers; labels of the axes, (columns, rows)."""
    with matplotlib.rc_context(STYLE | {"axes.grid": False}):
        figure = Figure(figsize=(9.6, 7.8), layout="constrained")
        axis = figure.subplots()
        axis.imshow(values, cmap="Blues", vmin=0, vmax=top, aspect="auto")
        for (row, column), value in np.ndenumerate(values):
            if round(value, digits) > 0.0:
                colour = "white" if value > 0.55 * top else TRUTH
                axis.text(
                    column,
                    row,
                    f"{value:.{digits}f}",
                    ha="center",
                    va="center",
                    color=colour,
                    fontsize=8,
                )
        axis.set_xticks(
            np.arange(len(columns)), columns, rotation=50, ha="right", rotation_mode="anchor"
        )
        axis.set_yticks(np.arange(len(rows)), rows)
        axis.set(xlabel=labels[0], ylabel=labels[1])
    return figure


def confusion_matrix(classes: Sequence[str], shares: Sequence[Series]) -> Figure:
    """Per cent of each true class (row) that were given each class (column)."""
    return heat_map(
        classes, classes, 100.0 * np.array(shares, float), 100.0, 0, ("decision", "true class")
    )


def reliability_diagrams(diagrams: Mapping[str, Mapping[str, Series]]) -> Figure:
    """Accuracy against confidence, a panel per name; the area of a point is the share of the beliefs in its bin."""
    columns = 4
    rows = -(-len(diagrams) // 4)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 2.5 * rows), layout="constrained")
        axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        for axis in axes.flat[len(diagrams) :]:
            axis.remove()
        for axis, (name, bins) in zip(axes.flat, diagrams.items(), strict=False):
            axis.plot([0, 1], [0, 1], color=COMMAND, lw=1, ls="--")
            area = 8 + 300 * np.array(bins["share"])
            axis.scatter(
                bins["confidence"], bins["accuracy"], area, color=SPEED, alpha=0.7, clip_on=False
            )
            axis.set(title=name, xlim=(-0.05, 1.05), ylim=(-0.05, 1.05), aspect="equal")
            axis.tick_params(labelbottom=True)
        figure.supxlabel("confidence in the most probable class", fontsize=9)
        figure.supylabel("share that was right", fontsize=9)
    return figure


def severities(truth: Series, estimates: Mapping[str, Series]) -> Figure:
    """Estimated against true severity, a panel per name."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 3.6), layout="constrained")
        axes = figure.subplots(1, len(estimates), sharex=True, sharey=True, squeeze=False)
        for axis, (name, values) in zip(axes.flat, estimates.items(), strict=True):
            axis.plot([0, 1], [0, 1], color=COMMAND, lw=1, ls="--")
            axis.plot(truth, values, ".", color=SPEED, alpha=0.45, ms=4, mew=0)
            axis.set(
                title=name,
                xlabel="true severity",
                xlim=(-0.02, 1.02),
                ylim=(-0.02, 1.02),
                aspect="equal",
            )
            axis.set(xticks=(0.0, 0.5, 1.0), yticks=(0.0, 0.5, 1.0))
        axes[0, 0].set_ylabel("estimated severity, given the true class")
    return figure
