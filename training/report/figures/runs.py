"""Figures of simulated runs: readings, estimates of the filters, and their consistency."""

from collections.abc import Mapping, Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes
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
Lines = Mapping[str, Series]  # clean, mean and std over time


def filter_response(
    time: Series,
    truth: Mapping[str, Series],
    clean: Mapping[str, Series],
    noisy_mean: Mapping[str, Series],
    noisy_std: Mapping[str, Series],
    units: Mapping[str, str],
    speed_changes: Series,
) -> Figure:
    """Estimates of the parameter filter over time, one panel per parameter; scatter of the noisy runs as a band."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 3.6), layout="constrained")
        axes = figure.subplots(1, len(truth))
        for axis, name in zip(axes, truth, strict=True):
            mean = np.array(noisy_mean[name])
            std = np.array(noisy_std[name])
            axis.fill_between(
                time, mean - std, mean + std, color=SPEED, alpha=0.18, lw=0, label="noisy, ±1 std"
            )
            axis.plot(time, mean, color=SPEED, lw=1, label="noisy, mean")
            axis.plot(time, clean[name], color=PORT, lw=1.4, label="noise-free")
            axis.plot(time, truth[name], color=TRUTH, lw=1, ls="--", label="true")
            for change in speed_changes:
                axis.axvline(change, color=COMMAND, lw=0.6, ls=":")
            axis.set(xlabel="time [s]", ylabel=f"{name} [{units[name]}]", xlim=(time[0], time[-1]))
        legend_above(figure, axes.flat)
    return figure


def _line(axis: Axes, time: Series, line: Mapping[str, Series], **style) -> None:
    mean = np.array(line["mean"])
    std = np.array(line["std"])
    axis.fill_between(time, mean - std, mean + std, color=style["color"], alpha=0.18, lw=0)
    axis.plot(time, line["clean"], lw=1.2, **style)


def transients(
    time: Series, panels: Mapping[str, Mapping[str, Lines]], onset: float | None = None
) -> Figure:
    """Readings over time: panels by axis label, each with lines by name; a fault's onset as a vertical line."""
    named = {"port": PORT, "starboard": STARBOARD, "speed": SPEED, "commanded": COMMAND}
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 5.0), layout="constrained")
        axes = figure.subplots(2, 2, sharex=True)
        for axis, (label, lines) in zip(axes.flat, panels.items(), strict=True):
            for (name, line), other in zip(
                lines.items(), (TRUTH, PORT, STARBOARD, SPEED), strict=False
            ):
                _line(axis, time, line, color=named.get(name, other), label=name, ls=_dash(name))
            if onset is not None:
                axis.axvline(onset, color=TRUTH, lw=0.8, ls=":", label="onset of the fault")
            axis.set(ylabel=label, xlim=(time[0], time[-1]))
        for axis in axes[1]:
            axis.set_xlabel("time [s]")
        legend_above(figure, axes.flat)
    return figure


def _dash(name: str) -> str:
    return "--" if name in ("starboard", "commanded") else "-"


def consistency(time: Series, summaries: Sequence[Mapping]) -> Figure:
    """NEES and NIS over time, a row per filter, with the 95 % band of one instant."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 4.6), layout="constrained")
        grid = figure.subplots(len(summaries), 2, sharex=True, squeeze=False)
        for axes, summary in zip(grid, summaries, strict=True):
            for axis, key in zip(axes, ("NEES", "NIS"), strict=True):
                part = summary[key]
                axis.axhspan(
                    part["low"], part["high"], color=STARBOARD, alpha=0.15, lw=0, label="95 % band"
                )
                axis.plot(time, part["series"], lw=0.8, color=SPEED, label="mean over seeds")
                reach = 2.5 * (part["high"] - part["low"])
                axis.set(
                    xlim=(0, time[-1]),
                    ylim=(part["freedom"] - reach / 2, part["freedom"] + reach / 2),
                )
                axis.set_ylabel(f"{key}, {summary['name']}")
        for axis in grid[-1]:
            axis.set_xlabel("time [s]")
        legend_above(figure, grid.flat)
    return figure
