"""The comparison with the thesis: values from the recordings of its test runs, and their texts."""

from collections.abc import Sequence

import numpy as np

from auv_fault_env.channels import INDEX
from auv_fault_env.parameters import FOOT, PRESETS, SAMPLE_RATE
from training.thesis.runs import Recording

ALPHA = 0
BETA = 1
VEHICLE = PRESETS["thesis1992"]
# 1/ft, (ft/s^2)/rpm^2
ALPHA_FT = VEHICLE.alpha * FOOT
BETA_FT = VEHICLE.beta / FOOT
VERDICT = "verdict (noise-free)"
AGREES = "agrees"
IN_PART = "agrees in part"
DIFFERS = "differs"
# of the tables: thesis beside ours
COLUMNS = [
    "where",
    "quantity",
    "thesis",
    "ours, noise-free",
    "ours, default noise",
    VERDICT,
    "why",
]
SPEED_CHANGES = [10.0, 20.0, 30.0, 40.0, 50.0]  # s, of the thesis' stimulus
# alpha and beta after the fault, relative to nominal
TRUE_PARAMETERS = {
    "normal": (1.0, 1.0),
    "drag": (1.35, 1.0),
    "thrust": (1.0, 0.65),
    "loss": (1.0, 0.5),
}


class Comparison:
    """The recordings without noise (one seed) and with noise (many), by run, parameter and time.

    `runs` are the names of the runs in the order of the recordings; `command` makes the report.
    """

    def __init__(self, clean: Recording, noisy: Recording, runs: Sequence[str], command: str):
        self.clean = clean
        self.noisy = noisy
        self.runs = list(runs)
        self.command = command

    def estimate(self, run: str, parameter: int, time: float) -> tuple[float, np.ndarray]:
        """Estimates relative to nominal: without noise, and with noise (n_seeds,)."""
        sample = round(time * SAMPLE_RATE)
        row = self.runs.index(run)
        clean = float(self.clean.mean[sample, row, 0, parameter])
        return clean, self.noisy.mean[sample, row, :, parameter]

    def error(self, run: str, parameter: int, time: float) -> tuple[float, np.ndarray]:
        """Relative errors of the estimates [%]: without noise, and with noise (n_seeds,)."""
        true = TRUE_PARAMETERS[run][parameter]
        clean, noisy = self.estimate(run, parameter, time)
        return 100 * (clean / true - 1), 100 * (noisy / true - 1)

    def filter_std(self, run: str, parameter: int, time: float) -> str:
        """The standard deviation that the filter reports under noise, as a sentence."""
        sample = round(time * SAMPLE_RATE)
        std = self.noisy.std[sample, self.runs.index(run), :, parameter].mean()
        percent = 100 * std / TRUE_PARAMETERS[run][parameter]
        return f"With noise the filter itself expects ± {percent:.1f} %."

    @staticmethod
    def row(
        where: str,
        quantity: str,
        thesis: str,
        clean: str,
        noisy: str,
        agrees: bool,
        why: str,
    ) -> list[str]:
        """One row of the comparison."""
        verdict = AGREES if agrees else DIFFERS
        return [where, quantity, thesis, clean, noisy, verdict, why]

    def reading(self, run: str, channel: str) -> np.ndarray:
        """Reading without noise over time, (n_samples,)."""
        return self.clean.readings[:, self.runs.index(run), 0, INDEX[channel]]

    def line(
        self, run: str, channel: str, label: str, n_samples: int | None = None
    ) -> dict[str, list[float]]:
        """A reading over time for a figure: without noise, and mean and std over the seeds.

        Speeds are in ft/s if the label of the axis names that unit.
        """
        unit = 1 / FOOT if "ft/s" in label else 1.0
        column = INDEX[channel]
        noisy = unit * self.noisy.readings[:n_samples, self.runs.index(run), :, column]
        lines = {
            "clean": unit * self.reading(run, channel)[:n_samples],
            "mean": noisy.mean(axis=1),
            "std": noisy.std(axis=1, ddof=1),
        }
        return {name: np.round(line.astype(float), 6).tolist() for name, line in lines.items()}


def error_texts(clean: float, noisy: np.ndarray) -> tuple[str, str]:
    """Errors [%] as text: without noise, and mean and standard deviation with noise."""
    clean = round(clean, 2) + 0.0
    mean = round(noisy.mean(), 1) + 0.0
    return f"{clean:+.2f} %", f"{mean:+.1f} ± {noisy.std(ddof=1):.1f} %"


def estimate_texts(estimates: tuple[float, np.ndarray], unit: float, form: str) -> tuple[str, str]:
    """Both estimates as text, multiplied by the unit."""
    clean, noisy = estimates
    return format(clean * unit, form), mean_and_std(noisy * unit, form)


def mean_and_std(values: np.ndarray, form: str = ".0f", unit: str = "") -> str:
    """Mean and standard deviation over networks or seeds, (n,), as text."""
    return f"{values.mean():{form}} ± {values.std(ddof=1):{form}}{unit}"


def mean_and_std_percent(shares: np.ndarray) -> str:
    """Mean and standard deviation of shares over networks or seeds, (n,), in per cent."""
    return mean_and_std(100 * shares, ".1f", " %")
