"""Figures of the ablation of inputs."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from training.report.colours import COLOURS, MARKERS
from training.report.figures.style import legend_above, new_panels

Series = Sequence[float]


def ablation_scores(
    isolation: Mapping[str, float],
    intervals: Mapping[str, Series],
    groups: Mapping[str, Mapping[str, float]],
) -> Figure:
    """Isolation time of all faults with its interval, and F1 of each group of faults, by input."""
    figure, (times, scores) = new_panels(4.4, 1, 2, sharey=True)
    names = list(isolation)
    rows = np.arange(len(names))[::-1]
    values = np.array([isolation[name] for name in names])
    limits = np.array([intervals[name] for name in names])
    errors = np.abs(limits - values[:, None]).T
    times.errorbar(values, rows, xerr=errors, fmt="o", color=COLOURS[1], capsize=3)
    times.set(xlabel="isolation, restricted mean [s]", xlim=(0, 31))
    times.set_yticks(rows, names)
    for k, (group, of_inputs) in enumerate(groups.items()):
        marker = {"marker": MARKERS[k], "color": COLOURS[k], "ls": "", "ms": 5}
        scores.plot([of_inputs[name] for name in names], rows, label=group, **marker)
    scores.set(xlabel="F1 ten seconds after onset, mean of the classes", xlim=(-0.02, 1.02))
    legend_above(figure, [scores])
    return figure


def ablation_curves(curves: Mapping[str, Mapping[str, Any]]) -> Figure:
    """Validation loss and macro-F1 over the episodes that the networks have been trained on."""
    figure, (losses, scores) = new_panels(4.0, 1, 2)
    for k, (name, curve) in enumerate(curves.items()):
        style = {"color": COLOURS[k], "lw": 1.4, "label": name}
        thousands = np.array(curve["episodes"]) / 1000.0
        losses.plot(thousands, curve["validation_loss"], **style)
        scores.plot(thousands, curve["macro_f1"], **style)
    losses.set(
        xlabel="episodes, repeated ones included [thousands]", ylabel="validation loss [nat]"
    )
    scores.set(xlabel="episodes, repeated ones included [thousands]", ylabel="macro-F1")
    legend_above(figure, [losses], columns=4)
    return figure
