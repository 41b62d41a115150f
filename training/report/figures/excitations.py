"""Figures of excitations: what they say about faults, and what they cost."""

from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure

from training.report.colours import COLOURS, MARKERS
from training.report.figures.style import legend_above, panel_grid

Points = Sequence[tuple[float, float]]


def evidence_energy(panels: Mapping[str, Mapping[str, Points]]) -> Figure:
    """Evidence [nat/s] against added energy [%], a panel per fault and knowledge of the vehicle.

    `panels` hold by name and family of excitations the points (added energy, evidence), cruise
    first and then one for each strength.
    """
    n_columns = 2
    figure, axes = panel_grid(len(panels), n_columns, 0.8, 1.9, sharex=True)
    for axis, (fault, families) in zip(axes, panels.items(), strict=True):
        for (name, points), colour, marker in zip(families.items(), COLOURS, MARKERS, strict=False):
            energy, evidence = zip(*points, strict=True)
            style = {"color": colour, "marker": marker, "ms": 4, "lw": 1.2}
            axis.plot(energy, evidence, label=name, **style)
        axis.set_title(fault, fontsize=9)
        axis.set(ylim=(0, None))
    for axis in axes[-n_columns:]:
        axis.set_xlabel("added energy per metre [%]")
    for axis in axes[::n_columns]:
        axis.set_ylabel("evidence [nat/s]")
    legend_above(figure, axes)
    return figure
