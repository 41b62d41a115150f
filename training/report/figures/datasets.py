"""Figures of the published data sets."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from training.report.colours import COMMAND, PORT, SPEED, STARBOARD, TRUTH
from training.report.figures.style import (
    legend_above,
    new_panels,
    show_map,
    slanted_names,
    write_cell,
)

Series = Sequence[float]
BAND_LABEL = "default healthy band"


def confusion_grid(
    classes: Sequence[str], shares: Mapping[str, Mapping[str, Sequence[Series]]]
) -> Figure:
    """Confusion matrices in per cent, true classes in rows.

    `shares` are matrices, 0 to 1, by protocol (a row of panels) and title (a panel).
    """
    n_rows = len(shares)
    n_columns = max(map(len, shares.values()))
    options = {"sharex": True, "sharey": True, "squeeze": False}
    figure, grid = new_panels(0.8 + 2.3 * n_rows, n_rows, n_columns, **options)
    for axes, (protocol, panels) in zip(grid, shares.items(), strict=True):
        for axis, (title, matrix) in zip(axes, panels.items(), strict=True):
            _confusion(axis, classes, np.array(matrix))
            axis.set_title(title, fontsize=9)
        axes[0].set_ylabel(protocol, fontweight="bold")
    return figure


def _confusion(axis: Axes, classes: Sequence[str], matrix: np.ndarray) -> None:
    show_map(axis, matrix, cmap="Blues", vmin=0, vmax=1, aspect="equal")
    for (row, column), share in np.ndenumerate(matrix):
        colour = "white" if share > 0.55 else TRUTH
        write_cell(axis, row, column, f"{100 * share:.0f}", colour, size=7)
    slanted_names(axis, classes, 50)
    axis.set_yticks(range(len(classes)), classes)


def healthy_band(runs: Sequence[str], panels: Mapping[str, Mapping[str, Any]]) -> Figure:
    """Relative parameters of each run with intervals, over a band and a wider window.

    `panels` hold by parameter the ends of `band` and `window`, and `series` by name, of values
    (n_runs,) and intervals (n_runs, 2); None where a run does not tell.
    """
    figure, axes = new_panels(1.2 + 0.4 * len(runs), 1, len(panels), sharey=True, squeeze=False)
    axes = axes[0]
    for axis, (parameter, panel) in zip(axes, panels.items(), strict=True):
        axis.axvspan(*panel["band"], color=STARBOARD, alpha=0.18, lw=0, label=BAND_LABEL)
        for edge in panel["window"]:
            axis.axvline(edge, color=COMMAND, lw=1, ls="--", label="thesis' window")
        _run_intervals(axis, panel["series"])
        axis.set_xlabel(f"{parameter} relative to all runs")
        axis.set_yticks(np.arange(len(runs)), runs)
    axes[0].invert_yaxis()
    legend_above(figure, axes)
    return figure


def _run_intervals(axis: Axes, series: Mapping[str, Mapping[str, Any]]) -> None:
    """Dots with intervals, a row per run, the series one above the other."""
    for k, (name, colour) in enumerate(zip(series, (PORT, SPEED), strict=True)):
        values = np.array(series[name]["values"], float)
        low, high = np.array(series[name]["intervals"], float).T
        rows = np.arange(len(values)) + 0.3 * k - 0.15
        axis.hlines(rows, low, high, color=colour, lw=1.4)
        axis.plot(values, rows, "o", color=colour, ms=5, label=name)
    values = np.concatenate([np.array(line["values"], float) for line in series.values()])
    known = values[~np.isnan(values)]
    if len(known) > 1:
        margin = 0.5 * np.ptp(known)
        axis.set_xlim(known.min() - margin, known.max() + margin)
