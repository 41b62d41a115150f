"""Figure of how missions ended."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from training.report.colours import COMMAND, PORT, SPEED, STARBOARD
from training.report.figures.style import legend_above, new_panels

OUTCOME_COLOURS = (STARBOARD, SPEED, COMMAND, PORT)
LEAST_WRITTEN = 4.0  # %, the least share whose number has room in its bar


def outcome_shares(
    panels: Mapping[str, Mapping[str, Mapping[str, float]]], names: Sequence[str]
) -> Figure:
    """Shares of the outcomes, `names` from left to right, as stacked bars.

    `panels` are shares, 0 to 1, by kind of vehicle (a panel), way to act (a bar) and outcome.
    """
    n_bars = sum(map(len, panels.values()))
    figure, axes = new_panels(1.0 + 0.5 * n_bars, len(panels), 1, sharex=True, squeeze=False)
    axes = axes[:, 0]
    for axis, (title, bars) in zip(axes, panels.items(), strict=True):
        _stacked_bars(axis, bars, names)
        axis.set(title=title, xlim=(0, 100))
    axes[-1].set_xlabel("missions [%]")
    legend_above(figure, axes)
    return figure


def _stacked_bars(
    axis: Axes, bars: Mapping[str, Mapping[str, float]], names: Sequence[str]
) -> None:
    start = np.zeros(len(bars))
    for name, colour in zip(names, OUTCOME_COLOURS, strict=True):
        share = 100.0 * np.array([shares[name] for shares in bars.values()])
        drawn = axis.barh(list(bars), share, left=start, color=colour, label=name, height=0.7)
        texts = [f"{value:.0f} %" if value >= LEAST_WRITTEN else "" for value in share]
        axis.bar_label(drawn, texts, label_type="center", color="white")
        start = start + share
    axis.invert_yaxis()
    axis.grid(visible=False)
