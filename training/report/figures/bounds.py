"""Figures of the limits of diagnosis: isolability, sensors, and the Cramér-Rao bound."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from training.report.colours import COMMAND, PORT, SPEED, TRUTH
from training.report.figures.style import (
    legend_above,
    new_panels,
    panel_grid,
    show_map,
    slanted_names,
    write_cell,
)

Series = Sequence[float]
Matrix = Sequence[Series]
# nat/s, ends of the colour scale
LEAST = 1e-2
MOST = 1e3
LINE_COLOURS = (COMMAND, TRUTH, SPEED, PORT)


def isolability_maps(classes: Sequence[str], rates: Mapping[str, Matrix]) -> Figure:
    """Rate of evidence for each class (row) against each other (column), a map per condition."""
    n_columns = 2
    same_class = np.eye(len(classes), dtype=bool)
    figure, axes = panel_grid(len(rates), n_columns, 1.8, 3.5, sharex=True, sharey=True)
    for k, (axis, (name, matrix)) in enumerate(zip(axes, rates.items(), strict=True)):
        shown = np.ma.masked_array(np.maximum(matrix, LEAST), same_class)
        image = show_map(axis, shown, cmap="viridis", norm=LogNorm(LEAST, MOST))
        axis.set_title(name)
        slanted_names(axis, classes, 60, fontsize=7)
        axis.set_yticks(range(len(classes)), classes, fontsize=7)
        axis.tick_params(labelbottom=k >= len(rates) - n_columns)
    place = {"location": "bottom", "shrink": 0.6, "aspect": 40, "extend": "both"}
    bar = figure.colorbar(image, ax=figure.axes, **place)
    bar.set_label("evidence for the row's class against the column's [nat/s]")
    return figure


def sensor_removal(classes: Sequence[str], channels: Sequence[str], shares: Matrix) -> Figure:
    """Share of the evidence of a class (row) that is left without a sensor (column).

    The evidence is that against the rival hardest to distinguish from the class.
    """
    percent = 100.0 * np.array(shares, float)
    figure, axis = new_panels(6.4)
    image = show_map(axis, percent, cmap="viridis", vmin=0, vmax=100)
    for (row, column), value in np.ndenumerate(percent):
        if np.isfinite(value):
            colour = TRUTH if value > 55 else "white"
            write_cell(axis, row, column, f"{value:.0f}", colour)
    slanted_names(axis, channels, 40)
    axis.set_yticks(range(len(classes)), classes)
    axis.set(xlabel="sensor that is missing", ylabel="class")
    figure.colorbar(image, ax=axis, label="evidence left [%]", pad=0.01)
    return figure


def cramer_rao(time: Series, lines: Mapping[str, Mapping[str, Series]]) -> Figure:
    """Root mean square errors of drag and thrust over time, by estimator, beside their bound."""
    figure, axes = new_panels(3.6, 1, 2)
    for axis, parameter in zip(axes, ("alpha", "beta"), strict=True):
        for (name, errors), colour in zip(lines.items(), LINE_COLOURS, strict=False):
            dash = "--" if name.startswith("bound") else "-"
            axis.plot(time, errors[parameter], color=colour, ls=dash, lw=1.3, label=name)
        axis.set(xlabel="time [s]", ylabel=f"error of {parameter} [%]")
        axis.set(xlim=(0, time[-1]), ylim=(0, None))
    legend_above(figure, axes)
    return figure


def rank_histograms(counts: Mapping[str, Series], band: tuple[float, float]) -> Figure:
    """How many truths lie above each share of their posterior, in even bins, panel by quantity.

    `band` holds the central 95 % of the counts if the posterior is right.
    """
    figure, axes = new_panels(3.2, 1, len(counts), sharey=True)
    for axis, (name, values) in zip(axes, counts.items(), strict=True):
        edges = np.linspace(0.0, 1.0, len(values) + 1)
        axis.axhspan(*band, color=COMMAND, alpha=0.3, lw=0, label="95 % if the posterior is right")
        axis.axhline(np.mean(values), color=COMMAND, lw=1.0)
        axis.stairs(values, edges, color=SPEED, lw=1.6, label="episodes")
        axis.set(xlabel=f"share of the posterior below the true {name}", xlim=(0, 1))
    axes[0].set(ylabel="episodes", ylim=(0, None))
    legend_above(figure, axes)
    return figure
