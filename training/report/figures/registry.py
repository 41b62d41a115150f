"""Figures: functions that take data and return the figure."""

from collections.abc import Callable, Mapping, Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from training.report.figures import (
    advisory,
    benchmark,
    bounds,
    calibration,
    log,
    scores,
    stimuli,
    thesis,
)
from training.report.figures import datasets as dataset_plots
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


def learning_curve(train: Series, validation: Series, best: int) -> Figure:
    """Losses over the epochs, counted from 1; `best` is the epoch whose weights were kept."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 3.6), layout="constrained")
        axis = figure.subplots()
        epochs = np.arange(1, len(train) + 1)
        axis.plot(epochs, train, color=SPEED, lw=1.2, marker=".", label="training")
        axis.plot(epochs, validation, color=PORT, lw=1.2, marker=".", label="validation")
        axis.plot(
            best,
            validation[best - 1],
            "o",
            color=TRUTH,
            fillstyle="none",
            ms=9,
            ls="",
            label="weights kept",
        )
        axis.set(xlabel="epoch", ylabel="loss")
        axis.xaxis.get_major_locator().set_params(integer=True)
        legend_above(figure, [axis])
    return figure


PLOTS: dict[str, Callable[..., Figure]] = {
    "filter_response": filter_response,
    "transients": transients,
    "consistency": consistency,
    "learning_curve": learning_curve,
    "isolation_curves": scores.isolation_curves,
    "confusion_matrix": scores.confusion_matrix,
    "reliability_diagrams": scores.reliability_diagrams,
    "severities": scores.severities,
    "curves": benchmark.curves,
    "cost_delay": benchmark.cost_delay,
    "class_delays": benchmark.class_delays,
    "episodes": benchmark.episodes,
    "isolability_maps": bounds.isolability_maps,
    "sensor_removal": bounds.sensor_removal,
    "cramer_rao": bounds.cramer_rao,
    "recall": thesis.recall,
    "confusion_by_size": thesis.confusion_by_size,
    "decision_surfaces": thesis.decision_surfaces,
    "network_response": thesis.network_response,
    "trajectories": thesis.trajectories,
    "speed_ups": stimuli.speed_ups,
    "delay_cost_plane": stimuli.delay_cost_plane,
    "around_onset": stimuli.around_onset,
    "active_episodes": stimuli.active_episodes,
    "outcome_shares": advisory.outcome_shares,
    "confusion_grid": dataset_plots.confusion_grid,
    "healthy_band": dataset_plots.healthy_band,
    "stacked": log.stacked,
    "measured_and_simulated": calibration.measured_and_simulated,
    "mission_estimates": calibration.mission_estimates,
}
