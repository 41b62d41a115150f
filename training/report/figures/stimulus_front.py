"""The front of stimuli: isolation against what they cost healthy vehicles."""

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from training.report.colours import TRUTH
from training.report.figures.style import legend_above, new_panels

Points = Sequence[Mapping[str, Any]]


def stimulus_front(
    points: Points, labels: Sequence[str], known_onset: float, colours: Mapping[str, str]
) -> Figure:
    """Isolation time as a share of that under the thesis' stimulus, a panel for each cost.

    Each point has stimulus, isolation (value, low, high), and by cost, in the order of their
    labels, costs and on_front (bool). `known_onset` is the isolation with the known onset.
    """
    figure, axes = new_panels(5.6, 1, len(labels), sharey=True, squeeze=False)
    for panel, (axis, label) in enumerate(zip(axes[0], labels, strict=True)):
        _front(axis, points, panel)
        for name, colour in colours.items():
            _stimulus(axis, [one for one in points if one["stimulus"] == name], panel, colour)
        axis.axhline(known_onset, color=TRUTH, lw=0.9, ls="--", label="onset known")
        axis.set(xlabel=label)
        axis.margins(0.06)
    axes[0][0].set_ylabel("isolation time, share of that under thesis")
    legend_above(figure, axes[0], columns=5)
    return figure


def _front(axis: Axes, points: Points, panel: int) -> None:
    """Steps along the points on the front: the least time for at most a cost."""
    chosen = [
        (one["costs"][panel], one["isolation"][0]) for one in points if one["on_front"][panel]
    ]
    cost, time = zip(*sorted(chosen), strict=True)
    axis.step(cost, time, where="post", color=TRUTH, lw=1.0, ls=":", label="front", zorder=1)


def _stimulus(axis: Axes, points: Points, panel: int, colour: str) -> None:
    by_cost = sorted(points, key=lambda one: one["costs"][panel])
    cost = [one["costs"][panel] for one in by_cost]
    value, low, high = zip(*(one["isolation"] for one in by_cost), strict=True)
    axis.vlines(cost, low, high, color=colour, lw=0.8, alpha=0.5)
    axis.plot(cost, value, color=colour, lw=0.9, alpha=0.7)
    for one, x, y in zip(by_cost, cost, value, strict=True):
        face = colour if one["on_front"][panel] else "white"
        axis.plot(x, y, "o", color=colour, mfc=face, ms=5.5, label=one["stimulus"])
