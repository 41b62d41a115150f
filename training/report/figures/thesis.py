"""Figures of the thesis' networks."""

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.patches import Rectangle
from matplotlib.patheffects import withStroke

from training.report.colours import COLOURS, COMMAND, PORT, SPEED, STARBOARD, TRUTH
from training.report.figures.style import (
    fill_band,
    legend_above,
    new_panels,
    show_map,
    write_cell,
)

Series = Sequence[float]
Rows = Sequence[Series]
MODE_COLOURS = (STARBOARD, COLOURS[3], SPEED, PORT, COLOURS[4])  # by output node, normal first
HEIGHT = {"cmap": "YlOrRd", "vmin": 0.0, "vmax": 1.0}
SAME_PLACE = 0.05  # on the map, within which instants share a text


def network_outputs(
    point: Series,
    modes: Sequence[str],
    presentations: Sequence[int],
    mean: Sequence[Rows],
    std: Sequence[Rows],
) -> Figure:
    """Outputs over the points of the training set, a panel per checkpoint.

    `mean` and `std` are (n_checkpoints, n_modes, n_points).
    """
    n_points = len(point) * (point[1] - point[0])
    length = n_points / len(modes)
    figure, axes = new_panels(7.6, len(presentations), 1, sharex=True)
    for axis, count, means, stds in zip(axes, presentations, mean, std, strict=True):
        _outputs(axis, point, modes, means, stds)
        for k in range(1, len(modes)):
            axis.axvline(k * length, color=TRUTH, lw=0.8, ls=":")
        axis.set(ylabel="output", xlim=(0, n_points), ylim=(-0.05, 1.1))
        axis.set_title(f"after {count:,} presentations", loc="left", fontsize=9)
    for k, (mode, colour) in enumerate(zip(modes, MODE_COLOURS, strict=False)):
        style = {"ha": "center", "fontsize": 8, "color": colour}
        axes[0].text((k + 0.5) * length, 1.14, f"true: {mode}", **style)
    axes[0].set_title(f"after {presentations[0]:,} presentations\n", loc="left", fontsize=9)
    axes[-1].set_xlabel("point of the training set")
    legend_above(figure, axes)
    return figure


def _outputs(axis: Axes, x: Series, modes: Sequence[str], means: Rows, stds: Rows) -> None:
    """A line with a band per output."""
    for mode, colour, mean, std in zip(modes, MODE_COLOURS, means, stds, strict=False):
        fill_band(axis, x, np.array(mean), np.array(std), colour)
        axis.plot(x, mean, color=colour, lw=1.1, label=mode)


def confusion_by_size(
    drags: Sequence[str],
    propellers: Sequence[str],
    count: Rows,
    text: Sequence[Sequence[str]],
) -> Figure:
    """How many of 100 points are confused, by drag fault (rows) and propeller fault (columns)."""
    counts = np.array(count)
    scale = {"cmap": "YlOrRd", "vmin": 0.0, "vmax": 100.0}
    figure, axis = new_panels(3.6)
    image = show_map(axis, counts, origin="lower", **scale)
    for (row, column), value in np.ndenumerate(counts):
        write_cell(axis, row, column, text[row][column], "w" if value > 60 else TRUTH)
    axis.set_xticks(range(len(propellers)), [fill(name, 16) for name in propellers], fontsize=8)
    axis.set_yticks(range(len(drags)), drags)
    axis.set(xlabel="propeller fault", ylabel="drag fault")
    figure.colorbar(image, ax=axis, label="points of 100")
    return figure


def decision_surfaces(
    axis: Series, surfaces: Mapping[str, Rows], windows: Mapping[str, Series]
) -> Figure:
    """Heights over the map, (n_alpha, n_beta), a panel each; the normal window as a box."""
    figure, panels = new_panels(3.5, 1, len(surfaces), sharex=True, sharey=True)
    for panel, (title, surface) in zip(panels, surfaces.items(), strict=True):
        image = _surface(panel, axis, surface, windows)
        panel.set(title=title, xlabel="alpha, normalised", xticks=(0.0, 0.2, 0.4, 0.6, 0.8))
    panels[0].set_ylabel("beta, normalised")
    figure.colorbar(image, ax=panels, label="height: severity")
    return figure


def _surface(panel: Axes, axis: Series, surface: Rows, windows: Mapping[str, Series]) -> AxesImage:
    half_step = 0.5 * (axis[1] - axis[0])
    extent = (axis[0] - half_step, axis[-1] + half_step) * 2
    heights = np.array(surface).T
    image = show_map(panel, heights, origin="lower", extent=extent, **HEIGHT)
    left, right = windows["alpha"]
    low, high = windows["beta"]
    style = {"fill": False, "ec": TRUTH, "lw": 1.0, "ls": "--"}
    panel.add_patch(Rectangle((left, low), right - left, high - low, **style))
    return image


def network_response(
    time: Series,
    modes: Sequence[str],
    panels: Mapping[str, Mapping[str, Rows]],
    onset: float,
    speed_changes: Series,
) -> Figure:
    """Outputs and severity over time, a panel per kind of data.

    Each panel has mean and std over networks, (n_modes + 1, n_samples), the severity last.
    """
    figure, axes = new_panels(5.0, len(panels), 1, sharex=True)
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
    """Estimates (n_samples, 2) moving over the map, a panel per run.

    Each path has the estimates without noise (`clean`), those of one noisy run (`noisy`), and the
    samples of `clean` at the `instants` (`marks`).
    """
    figure, panels = new_panels(4.4, 1, len(paths), sharex=True, sharey=True)
    for panel, (title, path) in zip(panels, paths.items(), strict=True):
        image = _surface(panel, axis, surface, windows)
        _path(panel, path, instants)
        panel.set(title=title, xlabel="alpha, normalised", xlim=(0, 1), ylim=(0, 1))
    panels[0].set_ylabel("beta, normalised")
    figure.colorbar(image, ax=panels, label="severity of the map")
    legend_above(figure, panels)
    return figure


def _path(panel: Axes, path: Mapping[str, Any], instants: Sequence[float]) -> None:
    clean = np.array(path["clean"])
    marked = clean[np.array(path["marks"], int)]
    panel.plot(*np.array(path["noisy"]).T, color="#5dade2", lw=0.8, label="one noisy run")
    panel.plot(*clean.T, color=SPEED, lw=1.6, label="noise-free")
    panel.plot(*marked.T, "o", color=SPEED, ms=4, ls="", label="at the times given")
    style = {"textcoords": "offset points", "xytext": (6, 5), "fontsize": 8}
    for text, place in _instants_by_place(marked, instants):
        annotation = panel.annotate(text, place, **style)
        annotation.set_path_effects([withStroke(linewidth=2.5, foreground="white")])


def _instants_by_place(
    points: np.ndarray, instants: Sequence[float]
) -> list[tuple[str, np.ndarray]]:
    """One text per place with all instants at which the path is near it."""
    places: list[np.ndarray] = []
    texts: list[list[str]] = []
    for point, instant in zip(points, instants, strict=True):
        near = [k for k, place in enumerate(places) if np.hypot(*(place - point)) < SAME_PLACE]
        if near:
            texts[near[0]].append(f"{instant:g}")
        else:
            places.append(point)
            texts.append([f"{instant:g}"])
    joined = [", ".join(names) + " s" for names in texts]
    return list(zip(joined, places, strict=True))
