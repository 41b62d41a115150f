"""Figures of a calibration: functions that take data and return the figure."""

from collections.abc import Mapping, Sequence

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

Series = Sequence[float | None]


def measured_and_simulated(time: Series, panels: Mapping[str, Mapping[str, Series]]) -> Figure:
    """Readings over what the model makes of them, a row per channel, and their difference beside it."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 1.9 * len(panels) + 0.7), layout="constrained")
        axes = figure.subplots(len(panels), 2, sharex=True, squeeze=False, width_ratios=(3, 2))
        for (left, right), (label, lines) in zip(axes, panels.items(), strict=True):
            measured, simulated = (
                np.array(lines[name], float) for name in ("measured", "simulated")
            )
            left.plot(time, measured, ".", ms=2, color=COMMAND, label="measured")
            left.plot(time, simulated, color=SPEED, lw=1.2, label="simulated")
            right.plot(
                time, measured - simulated, ".", ms=2, color=PORT, label="measured − simulated"
            )
            left.set(ylabel=label, xlim=(time[0], time[-1]))
        for axis in axes[-1]:
            axis.set_xlabel("time [s]")
        legend_above(figure, axes.flat)
    return figure


def mission_estimates(panels: Mapping[str, Mapping]) -> Figure:
    """Each mission's own estimates around the common one, relative, a panel per parameter, with the healthy band."""
    colours = {"all shafts": SPEED, "port": PORT, "starboard": STARBOARD}
    with matplotlib.rc_context(STYLE):
        columns = 2
        rows = -(-len(panels) // 2)
        figure = Figure(figsize=(9.6, 2.1 * rows + 0.5), layout="constrained")
        axes = figure.subplots(rows, columns, squeeze=False)
        for axis in axes.flat[len(panels) :]:
            axis.remove()
        for axis, (name, panel) in zip(axes.flat, panels.items(), strict=False):
            band = 100.0 * panel["band"]
            axis.axhspan(-band, band, color=STARBOARD, alpha=0.12, lw=0, label="healthy band")
            axis.axhline(0.0, color=TRUTH, lw=0.8)
            for k, (side, points) in enumerate(panel["sides"].items()):
                place, value, std = (
                    np.array(points[key], float) for key in ("mission", "value", "std")
                )
                bars = dict(fmt="o", ms=3, lw=1, color=colours[side], label=f"{side}, ± 2 std")
                axis.errorbar(place + 0.16 * k, 100.0 * value, 200.0 * std, **bars)
            axis.set_title(name, loc="left", fontsize=9)
            axis.set_ylabel("from common [%]")
            axis.xaxis.get_major_locator().set_params(integer=True)
            axis.set_xlabel("mission")
        legend_above(figure, axes.flat[: len(panels)], columns=4)
    return figure
