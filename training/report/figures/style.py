"""The look of every figure: size, fonts, colours, panels and legends."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D

from training.report.colours import TRUTH

STYLE = {
    "font.size": 9,
    "axes.grid": True,
    "grid.color": "#e3e8ec",
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.fonttype": "path",
    "svg.hashsalt": "auv-fault",
}


def new_panels(height: float, *shape: int, **options: Any) -> tuple[Figure, Any]:
    """A figure as wide as the page, its height in inches, and its panels as of `subplots`."""
    figure = Figure(figsize=(9.6, height), layout="constrained")
    return figure, figure.subplots(*shape, **options)


def panel_grid(
    n_panels: int, n_columns: int, margin: float, row_height: float, **options: Any
) -> tuple[Figure, list[Axes]]:
    """A figure of so many panels, row by row; its height is `margin` and `row_height` per row."""
    n_rows = -(-n_panels // n_columns)
    height = margin + row_height * n_rows
    figure, grid = new_panels(height, n_rows, n_columns, squeeze=False, **options)
    for axis in grid.flat[n_panels:]:
        axis.remove()
    return figure, list(grid.flat[:n_panels])


def fill_band(
    axis: Axes,
    x: Sequence[float],
    middle: np.ndarray,
    half_width: np.ndarray,
    colour: str,
) -> None:
    """A transparent band around a line."""
    low = middle - half_width
    high = middle + half_width
    axis.fill_between(x, low, high, color=colour, alpha=0.18, lw=0)


def show_map(axis: Axes, values: np.ndarray, **options: Any) -> AxesImage:
    """The values as colours, without the grid."""
    axis.grid(visible=False)
    return axis.imshow(values, **({"aspect": "auto"} | options))


def slanted_names(axis: Axes, names: Sequence[str], angle: float, **options: Any) -> None:
    """Names below the columns of a map."""
    options |= {"rotation": angle, "ha": "right", "rotation_mode": "anchor"}
    axis.set_xticks(range(len(names)), names, **options)


def write_cell(axis: Axes, row: int, column: int, text: str, colour: str, size: int = 8) -> None:
    """A text in the middle of a cell of a map."""
    axis.text(column, row, text, ha="center", va="center", color=colour, fontsize=size)


def legend_above(figure: Figure, axes: Iterable[Axes], columns: int | None = None) -> None:
    """One legend above all panels with each name once; in one row unless `columns` are given."""
    entries: dict[str, Any] = {}
    for axis in axes:
        handles, names = axis.get_legend_handles_labels()
        entries |= dict(zip(names, handles, strict=True))
    options = {"ncols": columns or len(entries), "frameon": False}
    figure.legend(entries.values(), entries.keys(), loc="outside upper center", **options)


def marker_legend(figure: Figure, markers: Mapping[str, str], title: str) -> None:
    """A legend of the markers below all panels."""
    handles = [Line2D([], [], marker=marker, color=TRUTH, ls="") for marker in markers.values()]
    options = {"title": title, "ncols": 6, "frameon": False}
    figure.legend(handles, markers, loc="outside lower center", **options)
