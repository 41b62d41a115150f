"""The Haizhe AUV fault data set: its runs, the inputs of a classifier, and blocks of time.

Ji, Yao, Li, Tang & Tian, "Autonomous underwater vehicle fault diagnosis dataset", Data in Brief 39
(2021) 107477, doi:10.1016/j.dib.2021.107477; data doi:10.17632/7rp2pmr6mx.1, CC BY 4.0. Runs of
about ten seconds in a pool, at 19.7 Hz; the fault is present from the first sample, so the data
serve classification, not delay.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.signal import periodogram
from tqdm import tqdm

from auv_fault_env.errors import known_name
from training.datasets.reading import data_files, read_columns

SOURCE = "doi.org/10.17632/7rp2pmr6mx.1 (Mendeley Data, CC BY 4.0)"
CLASSES = (
    "Normal",
    "AddWeight",
    "PressureGain_constant",
    "PropellerDamage_slight",
    "PropellerDamage_bad",
)
READINGS = tuple("depth press voltage roll pitch yaw a_x a_y a_z w_row w_pitch w_yaw".split())
YAW = READINGS.index("yaw")
RATE = 19.7  # Hz
QUANTILES = (5.0, 25.0, 50.0, 75.0, 95.0)  # per cent
BANDS = (0.0, 0.5, 2.0, 5.0, 10.0)  # Hz, edges
SHORTEST = 16  # rows of a run: enough for a spectrum; the data's runs have 136 to 296
EVENING = 18 * 3600.0  # s; in the training split nothing was recorded from 17:06 to 18:24


class Run(NamedTuple):
    """One run."""

    label: int  # index of its class in `CLASSES`
    time: float  # of the day, at which it began [s]; the data give no date
    command: np.ndarray  # the thrusters' pulse width [µs], (n_rows,), the same for all four
    # (n_rows, n_readings): m, the sensor's count, V, deg, m/s^2, deg/s; yaw is unwrapped
    readings: np.ndarray


def load(folder: Path, split: str) -> list[Run]:
    """The runs of a split, `train` or `test`, from ``folder/split/<class>/*.csv``."""
    files = data_files(folder, f"{split}/*/*.csv", SOURCE)
    return [read_run(path) for path in tqdm(files, desc=split, unit="run", leave=False)]


def read_run(path: Path) -> Run:
    """One run; its folder names its class."""
    label = CLASSES.index(known_name("class folder", path.parent.name, CLASSES))
    columns = read_columns(path, ("time", "pwm1", *READINGS), SHORTEST)
    readings = columns[:, 2:].copy()
    readings[:, YAW] = np.unwrap(readings[:, YAW], period=360.0)
    return Run(label, seconds_of_day(columns[0, 0]), columns[:, 1], readings)


def seconds_of_day(clock: float) -> float:
    """Seconds since midnight of a clock written as hhmmss, leading zeros lost.

    >>> seconds_of_day(20128)  # 02:01:28
    7288.0
    """
    hours, rest = divmod(clock, 10000)
    minutes, seconds = divmod(rest, 100)
    return 3600.0 * hours + 60.0 * minutes + seconds


def features(signals: np.ndarray) -> np.ndarray:
    """Figures of each signal (n_rows, n_signals), one after the other, (n_figures n_signals,).

    Mean, standard deviation, least, largest, last less first, mean and largest absolute step,
    first, last, `QUANTILES`, and the shares of the detrended signal's power in the bands between
    `BANDS`.
    """
    steps = np.abs(np.diff(signals, axis=0))
    frequency, power = periodogram(signals, RATE, detrend="linear", axis=0)
    shares = power / np.maximum(power.sum(axis=0), np.finfo(float).tiny)
    figures = [
        signals.mean(axis=0),
        signals.std(axis=0),
        signals.min(axis=0),
        signals.max(axis=0),
        signals[-1] - signals[0],
        steps.mean(axis=0),
        steps.max(axis=0),
        signals[0],
        signals[-1],
        *np.percentile(signals, QUANTILES, axis=0),
    ]
    for low, high in pairwise(BANDS):
        is_in_band = (low <= frequency) & (frequency < high)
        figures.append(shares[is_in_band].sum(axis=0))
    return np.concatenate(figures)


INPUTS: dict[str, Callable[[Run], np.ndarray]] = {
    "whole run": lambda run: features(run.readings),
    "rest removed": lambda run: features(run.readings - run.readings[0]),
    "rest only": lambda run: run.readings[0],
    "command only": lambda run: features(run.command[:, None]),
}


def is_evening(runs: Sequence[Run]) -> np.ndarray:
    """Whether each run began after 18:00, (n_runs,); no session of a class contains that hour."""
    return np.array([run.time >= EVENING for run in runs])


def time_blocks(runs: Sequence[Run], n_blocks: int) -> np.ndarray:
    """The block of each run, (n_runs,): `n_blocks` of equal size per class, by time of day."""
    labels = np.array([run.label for run in runs])
    times = np.array([run.time for run in runs])
    block = np.empty(len(runs), np.int64)
    for label in np.unique(labels):
        members = np.flatnonzero(labels == label)
        in_order = members[np.argsort(times[members], kind="stable")]
        block[in_order] = np.arange(len(members)) * n_blocks // len(members)
    return block
