"""Figure of a training: a function that takes data and returns the figure."""

from collections.abc import Sequence

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from training.report.figures.style import PORT, SPEED, STYLE, TRUTH, legend_above

Series = Sequence[float]


def learning_curve(train: Series, validation: Series, best: int) -> Figure:
    """Losses over the epochs, counted from 1; `best` is the epoch whose weights were kept."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 3.6), layout="constrained")
        axis = figure.subplots()
        epochs = np.arange(1, len(train) + 1)
        axis.plot(epochs, train, color=SPEED, lw=1.2, marker=".", label="training")
        axis.plot(epochs, validation, color=PORT, lw=1.2, marker=".", label="validation")
        axis.plot(
            best,
            validation[best - 1],
            "o",
            color=TRUTH,
            fillstyle="none",
            ms=9,
            ls="",
            label="weights kept",
        )
        axis.set(xlabel="epoch", ylabel="loss")
        axis.xaxis.get_major_locator().set_params(integer=True)
        legend_above(figure, [axis])
    return figure
