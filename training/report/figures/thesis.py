"""Figures of the thesis' networks: functions that take data and return the figure."""

from collections.abc import Mapping, Sequence
from textwrap import fill

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.patheffects import withStroke

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
Rows = Sequence[Series]
COLOURS = (STARBOARD, "#b9770e", SPEED, PORT, "#7d3c98")  # by output node, normal first
HEIGHT = {"cmap": "YlOrRd", "vmin": 0.0, "vmax": 1.0}


def network_outputs(
    point: Series,
    modes: Sequence[str],
    presentations: Sequence[int],
    mean: Sequence[Rows],
    std: Sequence[Rows],
) -> Figure:
    """Outputs over the points of the training set, (n_checkpoints, n_modes, n_points), a panel per checkpoint."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 7.6), layout="constrained")
        axes = figure.subplots(len(presentations), 1, sharex=True)
        step = point[1] - point[0]
        length = len(point) * step / len(modes)
        for axis, count, means, stds in zip(axes, presentations, mean, std, strict=True):
            _outputs(axis, point, modes, means, stds)
            for k in range(1, len(modes)):
                axis.axvline(k * length, color=TRUTH, lw=0.8, ls=":")
            axis.set(ylabel="output", xlim=(0, len(modes) * length), ylim=(-0.05, 1.1))
            axis.set_title(f"after {count:,} presentations", loc="left", fontsize=9)
        for k, mode in enumerate(modes):
            axes[0].text(
                (k + 0.5) * length, 1.14, f"true: {mode}", ha="center", fontsize=8, color=COLOURS[k]
            )
        axes[0].set_title(f"after {presentations[0]:,} presentations\n", loc="left", fontsize=9)
        axes[-1].set_xlabel("point of the training set")
        legend_above(figure, axes)
    return figure


def _outputs(axis: Axes, x: Series, modes: Sequence[str], means: Rows, stds: Rows) -> None:
    """A line with a band per output."""
    for mode, colour, mean, std in zip(
        modes, COLOURS, np.array(means), np.array(stds), strict=False
    ):
        axis.fill_between(x, mean - std, mean + std, color=colour, alpha=0.18, lw=0)
        axis.plot(x, mean, color=colour, lw=1.1, label=mode)


def confusion_by_size(
    drags: Sequence[str], propellers: Sequence[str], count: Rows, text: Sequence[Sequence[str]]
) -> Figure:
    """How many of 100 points are confused, by size of the drag fault (rows) and kind of the propeller fault."""
    with matplotlib.rc_context(STYLE | {"axes.grid": False}):
        figure = Figure(figsize=(9.6, 3.6), layout="constrained")
        axis = figure.subplots()
        image = axis.imshow(
            np.array(count), aspect="auto", cmap="YlOrRd", vmin=0.0, vmax=100.0, origin="lower"
        )
        for (row, column), value in np.ndenumerate(np.array(count)):
            colour = "w" if value > 60 else TRUTH
            axis.text(
                column, row, text[row][column], ha="center", va="center", color=colour, fontsize=8
            )
        axis.set_xticks(range(len(propellers)), [fill(name, 16) for name in propellers], fontsize=8)
        axis.set_yticks(range(len(drags)), drags)
        axis.set(xlabel="propeller fault", ylabel="drag fault")
        figure.colorbar(image, ax=axis, label="points of 100")
    return figure


def decision_surfaces(
    axis: Series, surfaces: Mapping[str, Rows], windows: Mapping[str, Series]
) -> Figure:
    """Heights over the map of alpha (across) and beta, (n_alpha, n_beta), a panel each; the normal window as a box."""
    with matplotlib.rc_context(STYLE | {"axes.grid": False}):
        figure = Figure(figsize=(9.6, 3.5), layout="constrained")
        panels = figure.subplots(1, len(surfaces), sharex=True, sharey=True)
        for panel, (title, surface) in zip(panels, surfaces.items(), strict=True):
            image = _surface(panel, axis, surface, windows)
            panel.set(title=title, xlabel="alpha, normalised", xticks=(0.0, 0.2, 0.4, 0.6, 0.8))
        panels[0].set_ylabel("beta, normalised")
        figure.colorbar(image, ax=panels, label="height: severity")
    return figure


def _surface(
    panel: Axes, axis: Series, surface: Rows, windows: Mapping[str, Series]
) -> matplotlib.image.AxesImage:
    half = 0.5 * (axis[1] - axis[0])
    extent = (axis[0] - half, axis[-1] + half) * 2
    image = panel.imshow(
        np.array(surface).T, origin="lower", extent=extent, aspect="auto", **HEIGHT
    )
    (left, right) = windows["alpha"]
    (low, high) = windows["beta"]
    panel.add_patch(
        Rectangle((left, low), right - left, high - low, fill=False, ec=TRUTH, lw=1.0, ls="--")
    )
    return image


def network_response(
    time: Series,
    modes: Sequence[str],
    panels: Mapping[str, Mapping[str, Rows]],
    onset: float,
    speed_changes: Series,
) -> Figure:
    """Outputs and severity over time, a panel per kind of data: mean and std (n_modes + 1, n_samples) over networks."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 5.0), layout="constrained")
        axes = figure.subplots(len(panels), 1, sharex=True)
        for axis, (title, lines) in zip(axes, panels.items(), strict=True):
            _outputs(axis, time, modes, lines["mean"], lines["std"])
            axis.plot(time, lines["mean"][-1], color=TRUTH, lw=1.2, ls="--", label="severity")
            axis.axvline(onset, color=TRUTH, lw=0.9, label="fault begins")
            for change in speed_changes:
                axis.axvline(change, color=COMMAND, lw=0.6, ls=":")
            axis.set(ylabel="output", xlim=(time[0], time[-1]), ylim=(-0.05, 1.15))
            axis.set_title(title, loc="left", fontsize=9)
        axes[-1].set_xlabel("time [s]")
        legend_above(figure, axes, columns=4)
    return figure


def trajectories(
    axis: Series,
    surface: Rows,
    windows: Mapping[str, Series],
    paths: Mapping[str, Mapping[str, Sequence[Series]]],
    instants: Sequence[float],
) -> Figure:
    """Estimates (n_samples, 2) moving over the map, a panel per run: noise-free, and one with noise."""
    with matplotlib.rc_context(STYLE | {"axes.grid": False}):
        figure = Figure(figsize=(9.6, 4.4), layout="constrained")
        panels = figure.subplots(1, len(paths), sharex=True, sharey=True)
        for panel, (title, path) in zip(panels, paths.items(), strict=True):
            image = _surface(panel, axis, surface, windows)
            panel.plot(*np.array(path["noisy"]).T, color="#5dade2", lw=0.8, label="one noisy run")
            clean = np.array(path["clean"])
            panel.plot(*clean.T, color=SPEED, lw=1.6, label="noise-free")
            marked = clean[np.array(path["marks"], int)]
            panel.plot(*marked.T, "o", color=SPEED, ms=4, ls="", label="at the times given")
            for group in _gathered(marked, instants):
                text = panel.annotate(*group, textcoords="offset points", xytext=(6, 5), fontsize=8)
                text.set_path_effects([withStroke(linewidth=2.5, foreground="white")])
            panel.set(title=title, xlabel="alpha, normalised", xlim=(0, 1), ylim=(0, 1))
        panels[0].set_ylabel("beta, normalised")
        figure.colorbar(image, ax=panels, label="severity of the map")
        legend_above(figure, panels)
    return figure


def _gathered(points: np.ndarray, instants: Sequence[float]) -> list[tuple[str, np.ndarray]]:
    """One text per place, naming all instants at which the path is within 0.05 of it."""
    groups: list[tuple[list[str], np.ndarray]] = []
    for point, instant in zip(points, instants, strict=True):
        near = next((names for names, place in groups if np.hypot(*(place - point)) < 0.05), None)
        if near is None:
            groups.append(([f"{instant:g}"], point))
        else:
            near.append(f"{instant:g}")
    return [(", ".join(names) + " s", place) for names, place in groups]
