"""Figure of how missions ended: a function that takes data and returns the figure."""

from collections.abc import Mapping, Sequence

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from training.report.figures.style import COMMAND, PORT, SPEED, STARBOARD, STYLE, legend_above

COLOURS = (STARBOARD, SPEED, COMMAND, PORT)


def outcome_shares(
    panels: Mapping[str, Mapping[str, Mapping[str, float]]], names: Sequence[str]
) -> Figure:
    """Shares of the outcomes `names` as stacked bars, a panel per kind of vehicle with a bar for each way to act."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(
            figsize=(9.6, 1.0 + 0.5 * sum(map(len, panels.values()))), layout="constrained"
        )
        axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        for axis, (title, bars) in zip(axes, panels.items(), strict=True):
            shares = 100.0 * np.array([[bar[name] for name in names] for bar in bars.values()])
            starts = shares.cumsum(axis=1) - shares
            for name, colour, share, start in zip(names, COLOURS, shares.T, starts.T, strict=True):
                drawn = axis.barh(
                    list(bars), share, left=start, color=colour, label=name, height=0.7
                )
                axis.bar_label(
                    drawn,
                    [f"{x:.0f} %" if x >= 4.0 else "" for x in share],
                    label_type="center",
                    color="white",
                )
            axis.set(title=title, xlim=(0, 100))
            axis.invert_yaxis()
            axis.grid(visible=False)
        axes[-1].set_xlabel("missions [%]")
        legend_above(figure, axes)
    return figure
