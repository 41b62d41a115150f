"""Figures of the published data sets: functions that take data and return the figure."""

from collections.abc import Mapping, Sequence
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


def confusion_grid(
    classes: Sequence[str], shares: Mapping[str, Mapping[str, Sequence[Series]]]
) -> Figure:
    """Per cent of each true class (row) given each class (column): a row of panels per name, a panel per inner name."""
    rows = len(shares)
    columns = max(map(len, shares.values()))
    with matplotlib.rc_context(STYLE | {"axes.grid": False}):
        figure = Figure(figsize=(9.6, 0.8 + 2.3 * rows), layout="constrained")
        grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        for axes, (protocol, panels) in zip(grid, shares.items(), strict=True):
            for axis, (title, values) in zip(axes, panels.items(), strict=True):
                axis.imshow(np.array(values), cmap="Blues", vmin=0, vmax=1)
                for (row, column), share in np.ndenumerate(values):
                    colour = "white" if share > 0.55 else TRUTH
                    axis.text(
                        column,
                        row,
                        f"{100 * share:.0f}",
                        ha="center",
                        va="center",
                        color=colour,
                        fontsize=7,
                    )
                axis.set_title(title, fontsize=9)
                axis.set_xticks(
                    range(len(classes)), classes, rotation=50, ha="right", rotation_mode="anchor"
                )
                axis.set_yticks(range(len(classes)), classes)
            axes[0].set_ylabel(protocol, fontweight="bold")
    return figure


def healthy_band(runs: Sequence[str], panels: Mapping[str, Mapping[str, Any]]) -> Figure:
    """Relative parameters of each run with intervals, a panel per parameter, over a band and a wider window.

    A panel has series by name, of values (n_runs,) and intervals (n_runs, 2), and the ends of band
    and window.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 1.2 + 0.4 * len(runs)), layout="constrained")
        axes = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
        for axis, (parameter, panel) in zip(axes, panels.items(), strict=True):
            axis.axvspan(
                *panel["band"], color=STARBOARD, alpha=0.18, lw=0, label="default healthy band"
            )
            for edge in panel["window"]:
                axis.axvline(edge, color=COMMAND, lw=1, ls="--", label="thesis' window")
            for k, ((name, series), colour) in enumerate(
                zip(panel["series"].items(), (PORT, SPEED), strict=True)
            ):
                rows = np.arange(len(runs)) + 0.3 * k - 0.15
                ends = np.array(series["intervals"])
                axis.hlines(rows, ends[:, 0], ends[:, 1], color=colour, lw=1.4)
                axis.plot(series["values"], rows, "o", color=colour, ms=5, label=name)
            values = np.concatenate([series["values"] for series in panel["series"].values()])
            reach = 0.5 * np.ptp(values)
            axis.set(
                xlabel=f"{parameter} relative to all runs",
                xlim=(values.min() - reach, values.max() + reach),
            )
            axis.set_yticks(np.arange(len(runs)), runs)
        axes[0].invert_yaxis()
        legend_above(figure, axes)
    return figure
