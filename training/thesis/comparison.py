"""The comparison with the thesis: what the recordings of its test runs say, by run, parameter and time."""

from collections.abc import Sequence

import numpy as np

from auv_fault_env.channels import CHANNELS
from auv_fault_env.parameters import FOOT, PRESETS, SAMPLE_RATE
from training.thesis.runs import Recording

ALPHA = 0
BETA = 1
VEHICLE = PRESETS["thesis1992"]
# 1/ft, (ft/s^2)/rpm^2
ALPHA_FT = VEHICLE.alpha * FOOT
BETA_FT = VEHICLE.beta / FOOT
TRUE = {"normal": (1.0, 1.0), "drag": (1.35, 1.0), "thrust": (1.0, 0.65), "loss": (1.0, 0.5)}


class Comparison:
    """The recordings, noise-free and noisy, read by run, parameter and time."""

    def __init__(self, clean: Recording, noisy: Recording, runs: Sequence[str], command: str):
        self.clean = clean
        self.noisy = noisy
        self.runs = list(runs)
        self.command = command

    def estimate(self, run: str, parameter: int, time: float) -> tuple[float, np.ndarray]:
        """Noise-free estimate and those of every seed (n_seeds,), relative to nominal."""
        k = round(time * SAMPLE_RATE)
        row = self.runs.index(run)
        return float(self.clean.mean[k, row, 0, parameter]), self.noisy.mean[k, row, :, parameter]

    def error(self, run: str, parameter: int, time: float) -> tuple[float, np.ndarray]:
        """Relative errors of the estimates [%]."""
        true = TRUE[run][parameter]
        clean, noisy = self.estimate(run, parameter, time)
        return 100 * (clean / true - 1), 100 * (noisy / true - 1)

    def floor(self, run: str, parameter: int, time: float) -> str:
        """What the filter itself expects under noise: its standard deviation relative to the true value."""
        std = self.noisy.std[round(time * SAMPLE_RATE), self.runs.index(run), :, parameter].mean()
        return f"With noise the filter itself expects ± {100 * std / TRUE[run][parameter]:.1f} %."

    def row(
        self, where: str, quantity: str, thesis: str, clean: str, noisy: str, met: bool, why: str
    ) -> list[str]:
        """One row of the comparison."""
        return [
            where,
            quantity,
            thesis,
            clean,
            noisy,
            "agrees" if met else "differs",
            why,
            self.command,
        ]

    def reading(self, run: str, channel: str) -> np.ndarray:
        """Noise-free reading over time (n_samples,)."""
        return self.clean.readings[:, self.runs.index(run), 0, list(CHANNELS).index(channel)]

    def line(
        self, run: str, channel: str, label: str, samples: int | None = None
    ) -> dict[str, list[float]]:
        """A reading over time for a figure, in the unit of its axis: noise-free, and mean and std over the seeds."""
        unit = 1 / FOOT if "ft/s" in label else 1.0
        noisy = (
            unit
            * self.noisy.readings[:samples, self.runs.index(run), :, list(CHANNELS).index(channel)]
        )
        values = {"clean": unit * self.reading(run, channel)[:samples]}
        values |= {"mean": noisy.mean(axis=1), "std": noisy.std(axis=1, ddof=1)}
        return {name: np.round(series.astype(float), 6).tolist() for name, series in values.items()}


def percent(clean: float, noisy: np.ndarray) -> tuple[str, str]:
    """Both errors as text."""
    return (
        f"{round(clean, 2) + 0.0:+.2f} %",
        f"{round(noisy.mean(), 1) + 0.0:+.1f} ± {noisy.std(ddof=1):.1f} %",
    )


def scaled(estimates: tuple[float, np.ndarray], unit: float, form: str) -> tuple[str, str]:
    """Both estimates in the thesis' unit as text."""
    clean = estimates[0] * unit
    noisy = estimates[1] * unit
    return format(clean, form), spread(noisy, form)


def spread(values: np.ndarray, form: str = ".0f", unit: str = "") -> str:
    """Mean and standard deviation over networks or seeds, (n,), as text."""
    return f"{values.mean():{form}} ± {values.std(ddof=1):{form}}{unit}"


def share(values: np.ndarray) -> str:
    """The same of shares, in per cent."""
    return spread(100 * values, ".1f", " %")
