"""Figures of simulated runs: readings, estimates of the filters, and their consistency."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from training.report.colours import COMMAND, PORT, SPEED, STARBOARD, TRUTH
from training.report.figures.style import fill_band, legend_above, new_panels

Series = Sequence[float]
Lines = Mapping[str, Series]  # clean, mean and std over time
LINE_COLOURS = {
    "port": PORT,
    "starboard": STARBOARD,
    "speed": SPEED,
    "commanded": COMMAND,
}
DASHED = ("starboard", "commanded")
NOISY_BAND = "noisy, ±1 std"


def filter_response(
    time: Series,
    truth: Mapping[str, Series],
    clean: Mapping[str, Series],
    noisy_mean: Mapping[str, Series],
    noisy_std: Mapping[str, Series],
    units: Mapping[str, str],
    speed_changes: Series,
) -> Figure:
    """Estimates of the parameter filter over time, a panel per parameter.

    The band is the standard deviation of the noisy runs; dotted lines are changes of the speed
    command.
    """
    figure, axes = new_panels(3.6, 1, len(truth))
    for axis, name in zip(axes, truth, strict=True):
        mean = np.array(noisy_mean[name])
        std = np.array(noisy_std[name])
        band = {"color": SPEED, "alpha": 0.18, "lw": 0, "label": NOISY_BAND}
        axis.fill_between(time, mean - std, mean + std, **band)
        axis.plot(time, mean, color=SPEED, lw=1, label="noisy, mean")
        axis.plot(time, clean[name], color=PORT, lw=1.4, label="noise-free")
        axis.plot(time, truth[name], color=TRUTH, lw=1, ls="--", label="true")
        for change in speed_changes:
            axis.axvline(change, color=COMMAND, lw=0.6, ls=":")
        axis.set(
            xlabel="time [s]",
            ylabel=f"{name} [{units[name]}]",
            xlim=(time[0], time[-1]),
        )
    legend_above(figure, axes.flat)
    return figure


def transients(
    time: Series,
    panels: Mapping[str, Mapping[str, Lines]],
    onset: float | None = None,
) -> Figure:
    """Readings over time, and the onset of the fault [s].

    `panels` hold by label of the axis and name of the line `clean`, and `mean` and `std` of the
    noisy runs.
    """
    figure, axes = new_panels(5.0, 2, 2, sharex=True)
    for axis, (label, lines) in zip(axes.flat, panels.items(), strict=True):
        _reading_lines(axis, time, lines)
        if onset is not None:
            axis.axvline(onset, color=TRUTH, lw=0.8, ls=":", label="onset of the fault")
        axis.set(ylabel=label, xlim=(time[0], time[-1]))
    for axis in axes[1]:
        axis.set_xlabel("time [s]")
    legend_above(figure, axes.flat)
    return figure


def _reading_lines(axis: Axes, time: Series, lines: Mapping[str, Lines]) -> None:
    default_colours = (TRUTH, PORT, STARBOARD, SPEED)
    for (name, line), default in zip(lines.items(), default_colours, strict=False):
        colour = LINE_COLOURS.get(name, default)
        dash = "--" if name in DASHED else "-"
        fill_band(axis, time, np.array(line["mean"]), np.array(line["std"]), colour)
        axis.plot(time, line["clean"], lw=1.2, color=colour, label=name, ls=dash)


def consistency(time: Series, summaries: Sequence[Mapping]) -> Figure:
    """NEES and NIS over time, a row per filter, with the 95 % band of one instant."""
    figure, grid = new_panels(4.6, len(summaries), 2, sharex=True, squeeze=False)
    for axes, summary in zip(grid, summaries, strict=True):
        for axis, key in zip(axes, ("NEES", "NIS"), strict=True):
            _statistic(axis, time, summary[key])
            axis.set_ylabel(f"{key}, {summary['name']}")
    for axis in grid[-1]:
        axis.set_xlabel("time [s]")
    legend_above(figure, grid.flat)
    return figure


def _statistic(axis: Axes, time: Series, statistic: Mapping) -> None:
    low = statistic["low"]
    high = statistic["high"]
    expected = statistic["freedom"]
    axis.axhspan(low, high, color=STARBOARD, alpha=0.15, lw=0, label="95 % band")
    axis.plot(time, statistic["series"], lw=0.8, color=SPEED, label="mean over seeds")
    reach = 1.25 * (high - low)
    axis.set(xlim=(0, time[-1]), ylim=(expected - reach, expected + reach))
