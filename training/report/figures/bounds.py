"""Figures of what can be known at all: functions that take data and return the figure."""

from collections.abc import Mapping, Sequence

import matplotlib
import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from training.report.figures.style import COMMAND, PORT, SPEED, STYLE, TRUTH, legend_above

Series = Sequence[float]
Matrix = Sequence[Series]
# nat/s, ends of the colour scale
LEAST = 1e-2
MOST = 1e3


def isolability_maps(classes: Sequence[str], rates: Mapping[str, Matrix]) -> Figure:
    """Rate of evidence for each class (row) against each other (column), a map per condition, logarithmic colours."""
    columns = 2
    rows = -(-len(rates) // 2)
    with matplotlib.rc_context(STYLE | {"axes.grid": False}):
        figure = Figure(figsize=(9.6, 3.5 * rows + 1.8), layout="constrained")
        axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        places = np.arange(len(classes))
        for axis in axes.flat[len(rates) :]:
            axis.remove()
        for k, (axis, (name, matrix)) in enumerate(zip(axes.flat, rates.items(), strict=False)):
            shown = np.ma.masked_array(np.maximum(matrix, LEAST), np.eye(len(classes), dtype=bool))
            image = axis.imshow(shown, cmap="viridis", norm=LogNorm(LEAST, MOST), aspect="auto")
            axis.set_title(name)
            axis.set_xticks(
                places, classes, rotation=60, ha="right", rotation_mode="anchor", fontsize=7
            )
            axis.set_yticks(places, classes, fontsize=7)
            axis.tick_params(labelbottom=k >= len(rates) - columns)
        bar = figure.colorbar(
            image, ax=figure.axes, location="bottom", shrink=0.6, aspect=40, extend="both"
        )
        bar.set_label("evidence for the row's class against the column's [nat/s]")
    return figure


def sensor_removal(classes: Sequence[str], channels: Sequence[str], shares: Matrix) -> Figure:
    """Share of the evidence against the most dangerous rival that a class (row) keeps without a sensor (column)."""
    percent = 100.0 * np.array(shares, float)
    with matplotlib.rc_context(STYLE | {"axes.grid": False}):
        figure = Figure(figsize=(9.6, 6.4), layout="constrained")
        axis = figure.subplots()
        image = axis.imshow(percent, cmap="viridis", vmin=0, vmax=100, aspect="auto")
        for (row, column), value in np.ndenumerate(percent):
            if np.isfinite(value):
                colour = TRUTH if value > 55 else "white"
                axis.text(
                    column, row, f"{value:.0f}", ha="center", va="center", color=colour, fontsize=8
                )
        axis.set_xticks(
            np.arange(len(channels)), channels, rotation=40, ha="right", rotation_mode="anchor"
        )
        axis.set_yticks(np.arange(len(classes)), classes)
        axis.set(xlabel="sensor that is missing", ylabel="class")
        figure.colorbar(image, ax=axis, label="evidence left [%]", pad=0.01)
    return figure


def cramer_rao(time: Series, lines: Mapping[str, Mapping[str, Series]]) -> Figure:
    """Root mean square errors of drag and thrust over time, by estimator, beside their bound."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 3.6), layout="constrained")
        axes = figure.subplots(1, 2)
        for axis, parameter in zip(axes, ("alpha", "beta"), strict=True):
            for (name, values), colour in zip(
                lines.items(), (COMMAND, TRUTH, SPEED, PORT), strict=False
            ):
                dash = "--" if name.startswith("bound") else "-"
                axis.plot(time, values[parameter], color=colour, ls=dash, lw=1.3, label=name)
            axis.set(
                xlabel="time [s]",
                ylabel=f"error of {parameter} [%]",
                xlim=(0, time[-1]),
                ylim=(0, None),
            )
        legend_above(figure, axes)
    return figure
