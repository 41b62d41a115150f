"""Figures of how good diagnosers are."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from training.report.colours import COLOURS, COMMAND, SPEED, TRUTH
from training.report.figures.style import (
    legend_above,
    new_panels,
    panel_grid,
    show_map,
    slanted_names,
    write_cell,
)

Series = Sequence[float]
DASHES = ("--", ":", "-.", (0, (5, 1, 1, 1, 1, 1)))


def line_styles(names: Iterable[str], references: Collection[str]) -> dict[str, dict[str, Any]]:
    """Style of the line of each name: the first thick, references last, grey and dashed."""
    names = list(names)
    styles: dict[str, dict[str, Any]] = {}
    for name in names:
        if name not in references:
            colour = COLOURS[len(styles) % len(COLOURS)]
            styles[name] = {"color": colour, "lw": 1.3 if styles else 2.2}
    present = [name for name in names if name in references]
    for k, name in enumerate(present):
        styles[name] = {"color": COMMAND, "lw": 1.3, "ls": DASHES[k % len(DASHES)]}
    return styles


def isolation_curves(
    time: Series, shares: Mapping[str, Series], references: Sequence[str]
) -> Figure:
    """Share of the faults isolated by a time since onset, a line per name."""
    figure, axis = new_panels(4.8)
    for name, style in line_styles(shares, references).items():
        axis.plot(time, shares[name], label=name, **style)
    axis.set(xlabel="time since onset [s]", ylabel="share of the faults isolated")
    axis.set(xlim=(0, time[-1]), ylim=(-0.02, 1.02))
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
    """Values from 0 to `top` as colour and, unless they round to 0, as numbers.

    `labels` are those of the columns and of the rows.
    """
    figure, axis = new_panels(7.8)
    show_map(axis, values, cmap="Blues", vmin=0, vmax=top)
    for (row, column), value in np.ndenumerate(values):
        if round(value, digits) > 0.0:
            colour = "white" if value > 0.55 * top else TRUTH
            write_cell(axis, row, column, f"{value:.{digits}f}", colour)
    slanted_names(axis, columns, 50)
    axis.set_yticks(np.arange(len(rows)), rows)
    axis.set(xlabel=labels[0], ylabel=labels[1])
    return figure


def confusion_matrix(classes: Sequence[str], shares: Sequence[Series]) -> Figure:
    """Per cent of each true class (row) decided as each class (column)."""
    percent = 100.0 * np.array(shares, float)
    return heat_map(classes, classes, percent, 100.0, 0, ("decision", "true class"))


def reliability_diagrams(diagrams: Mapping[str, Mapping[str, Series]]) -> Figure:
    """Accuracy against confidence, a panel per name.

    The area of a point is the share of the beliefs in its bin.
    """
    figure, axes = panel_grid(len(diagrams), 4, 0.0, 2.5, sharex=True, sharey=True)
    for axis, (name, bins) in zip(axes, diagrams.items(), strict=True):
        axis.plot([0, 1], [0, 1], color=COMMAND, lw=1, ls="--")
        area = 8 + 300 * np.array(bins["share"])
        style = {"color": SPEED, "alpha": 0.7, "clip_on": False}
        axis.scatter(bins["confidence"], bins["accuracy"], area, **style)
        axis.set(title=name, xlim=(-0.05, 1.05), ylim=(-0.05, 1.05), aspect="equal")
        axis.tick_params(labelbottom=True)
    figure.supxlabel("confidence in the most probable class", fontsize=9)
    figure.supylabel("share that was right", fontsize=9)
    return figure


def severities(truth: Series, estimates: Mapping[str, Series]) -> Figure:
    """Estimated against true severity, a panel per name."""
    limits = (-0.02, 1.02)
    ticks = (0.0, 0.5, 1.0)
    figure, axes = new_panels(3.6, 1, len(estimates), sharex=True, sharey=True, squeeze=False)
    for axis, (name, estimated) in zip(axes.flat, estimates.items(), strict=True):
        axis.plot([0, 1], [0, 1], color=COMMAND, lw=1, ls="--")
        axis.plot(truth, estimated, ".", color=SPEED, alpha=0.45, ms=4, mew=0)
        axis.set(title=name, xlabel="true severity")
        axis.set(xlim=limits, ylim=limits, aspect="equal", xticks=ticks, yticks=ticks)
    axes[0, 0].set_ylabel("estimated severity, given the true class")
    return figure
