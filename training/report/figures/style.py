"""The look of every figure: fonts, colours, and one legend for all panels."""

from collections.abc import Iterable

from matplotlib.axes import Axes
from matplotlib.figure import Figure

PORT = "#c0392b"
STARBOARD = "#1e8449"
SPEED = "#1f4e79"
COMMAND = "#8a949e"
TRUTH = "#111111"
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


def legend_above(figure: Figure, axes: Iterable[Axes], columns: int | None = None) -> None:
    """One legend for all panels, above them, each name once; all names in one row unless `columns` are given."""
    entries = {}
    for axis in axes:
        handles, names = axis.get_legend_handles_labels()
        entries |= dict(zip(names, handles, strict=True))
    columns = columns or len(entries)
    figure.legend(
        entries.values(), entries.keys(), loc="outside upper center", ncols=columns, frameon=False
    )
