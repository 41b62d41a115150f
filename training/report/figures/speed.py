"""Figure of the speed of the environments over time."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from training.report.colours import PORT, SPEED, STARBOARD
from training.report.figures.style import legend_above, new_panels

COLOURS = (SPEED, PORT, STARBOARD)
MARKERS = "osD^v"


def speed_history(machines: Mapping[str, Mapping[str, Any]]) -> Figure:
    """Rates in units of CartPole-v1 over the runs, a marker for each machine.

    Parameters
    ----------
    machines
        By machine: `date` of its runs, and `ratios` of each environment, None where it was not
        measured.
    """
    figure, axis = new_panels(3.6)
    first = 0
    labels: list[str] = []
    for marker, (machine, of_machine) in zip(MARKERS, machines.items(), strict=False):
        places = first + np.arange(len(of_machine["date"]))
        for colour, (label, ratios) in zip(COLOURS, of_machine["ratios"].items(), strict=True):
            values = np.array(ratios, dtype=float)
            name = label if first == 0 else None
            axis.plot(places, values, color=colour, marker=marker, lw=1.2, label=name)
        labels += of_machine["date"]
        axis.text(first, 1.0, machine, transform=axis.get_xaxis_transform(), fontsize=8, va="top")
        first += len(places)
    axis.set(yscale="log", ylabel="rate in units of CartPole-v1", xlabel="run")
    # room for the name of the last machine
    axis.set_xlim(-0.25, first)
    axis.set_xticks(np.arange(first), labels, rotation=30, ha="right")
    axis.margins(y=0.25)
    legend_above(figure, [axis])
    return figure
