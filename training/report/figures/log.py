"""The figure of a diagnosed log: panels above one another on one time axis, the alarms shaded in all of them."""

from collections.abc import Mapping, Sequence

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from training.report.figures.scores import COLOURS
from training.report.figures.style import COMMAND, PORT, SPEED, STARBOARD, STYLE, TRUTH

NAMED = {
    "port": PORT,
    "starboard": STARBOARD,
    "speed": SPEED,
    "commanded": COMMAND,
    "threshold": TRUTH,
}
DASHED = ("threshold", "commanded")
SPARSE = 100  # points; fewer are marked one by one


def stacked(
    panels: Mapping[str, Mapping[str, Mapping[str, Sequence[float]]]],
    alarms: Sequence[Sequence[float]],
) -> Figure:
    """Panels by axis label, in each lines by name: time [s], value, and a half-width if it has a band.

    alarms (n_alarms, 2): begin and end [s]. A name ending in ", healthy" is the dotted companion of
    the one before.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 1.45 * len(panels) + 0.5), layout="constrained")
        axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        for axis, (label, lines) in zip(axes, panels.items(), strict=True):
            for k, (name, line) in enumerate(lines.items()):
                _draw(axis, name, line, COLOURS[k % len(COLOURS)])
            for begin, end in alarms:
                axis.axvspan(begin, max(end, begin + 0.1), color=PORT, alpha=0.10, lw=0)
            axis.set_ylabel(label)
            if lines:
                axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize=8)
        axes[-1].set_xlabel("time [s]; shaded: alarm")
    return figure


def _draw(axis, name: str, line: Mapping[str, Sequence[float]], other: str) -> None:
    base, healthy, _ = name.partition(", healthy")
    colour = NAMED.get(base, other)
    dash = ":" if healthy else "--" if base in DASHED else "-"
    marker = "." if len(line["time"]) < SPARSE and base not in DASHED else None
    axis.plot(
        line["time"], line["value"], color=colour, lw=1.2, ls=dash, marker=marker, ms=3, label=name
    )
    if "width" in line:
        value = np.array(line["value"])
        width = np.array(line["width"])
        axis.fill_between(
            line["time"], value - width, value + width, color=colour, alpha=0.18, lw=0
        )
