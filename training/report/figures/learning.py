"""Figure of a training."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from training.report.colours import PORT, SPEED, TRUTH
from training.report.figures.style import legend_above, new_panels

Series = Sequence[float]


def learning_curve(train: Series, validation: Series, best: int) -> Figure:
    """Losses over the epochs, counted from 1; `best` is the epoch whose weights are used."""
    figure, axis = new_panels(3.6)
    epochs = np.arange(1, len(train) + 1)
    axis.plot(epochs, train, color=SPEED, lw=1.2, marker=".", label="training")
    axis.plot(epochs, validation, color=PORT, lw=1.2, marker=".", label="validation")
    circle = {"color": TRUTH, "fillstyle": "none", "ms": 9, "ls": ""}
    axis.plot(best, validation[best - 1], "o", label="weights used", **circle)
    axis.set(xlabel="epoch", ylabel="loss")
    axis.xaxis.get_major_locator().set_params(integer=True)
    legend_above(figure, [axis])
    return figure
