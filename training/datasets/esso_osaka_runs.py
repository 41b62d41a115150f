"""The Esso Osaka model tests: runs of a healthy ship with random propeller and rudder.

NAOE-5thLab/FRT-DS-ESSO (Osaka University), CC BY-NC-SA 4.0: a free-running model of 3 m on an open
pond; position, speeds, heading, yaw rate, propeller, rudder and wind ten times a second. It has no
fault: the variation from run to run is the healthy band.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from auv_fault_env.errors import refusal
from auv_fault_env.parameters import SAMPLE_TIME
from training.datasets.reading import data_files, read_columns

SOURCE = "github.com/NAOE-5thLab/FRT-DS-ESSO (CC BY-NC-SA 4.0)"
PATTERN = "random/*.csv"
TIME = "t [s]"
COLUMNS = (
    TIME,
    "u_velo [m/s]",
    "vm_velo [m/s]",
    "r_angvelo [rad/s]",
    "n_prop [rps]",
    "delta_rudder [rad]",
    "wind_velo_relative_mid [m/s]",
    "wind_dir_relative_mid [rad]",
)
SHORTEST = 600  # samples of a run: a minute, beside a prediction over ten seconds
JITTER = 1e-3  # s, largest departure of a time step from the sample time


class Inputs(NamedTuple):
    """The inputs of the surge speed, (n_samples,) each."""

    sway: np.ndarray  # sway speed amidships [m/s], to starboard
    yaw_rate: np.ndarray  # [rad/s]
    rpm: np.ndarray  # of the one propeller, negative astern
    rudder: np.ndarray  # [rad]
    wind: np.ndarray  # the relative wind along the ship [m/s]

    def sample_means(self) -> "Inputs":
        """The means over each sample, (n_samples - 1,)."""
        return Inputs(*(0.5 * (values[1:] + values[:-1]) for values in self))

    def at(self, instants: slice) -> "Inputs":
        """The inputs at some of the instants."""
        return Inputs(*(values[instants] for values in self))


class ShipRun(NamedTuple):
    """One run: its name, the surge speed amidships [m/s], (n_samples,), and what drives it."""

    name: str
    speed: np.ndarray
    inputs: Inputs


def load(folder: Path, but: Sequence[Path] = ()) -> list[ShipRun]:
    """The whole runs of ``folder/random/*.csv`` but some files.

    Raises `InputError` if one is broken or none is there.
    """
    left_out = {path.resolve() for path in but}
    files = [path for path in data_files(folder, PATTERN, SOURCE) if path.resolve() not in left_out]
    return [read_run(path) for path in tqdm(files, desc="runs", unit="run", leave=False)]


def read_run(path: Path) -> ShipRun:
    """One run in the units of this project, and the relative wind along the ship."""
    columns = read_columns(path, COLUMNS, SHORTEST)
    time, surge, sway, yaw_rate, propeller, rudder, wind, direction = columns.T
    late = np.flatnonzero(np.abs(np.diff(time) - SAMPLE_TIME) > JITTER)
    if late.size:
        before = time[late[0]]
        after = time[late[0] + 1]
        got = f"t = {before:g} s, then {after:g} s"
        allowed = f"a row every {SAMPLE_TIME:g} s"
        raise refusal(f"file {path.name}", got, allowed, "cut the file there")
    inputs = Inputs(
        sway=sway,
        yaw_rate=yaw_rate,
        rpm=60.0 * propeller,
        rudder=rudder,
        wind=wind * np.cos(direction),
    )
    return ShipRun(path.stem.removeprefix("random_"), surge, inputs)


def free_running(run: ShipRun) -> ShipRun:
    """The run up to where propeller and rudder are at zero until the end.

    From there on people tow the model back at up to 0.2 m/s, or stop it at the bank; the commands
    do not contain that. Raises `InputError` if less than a minute is left.
    """
    steered = np.flatnonzero((run.inputs.rpm != 0.0) | (run.inputs.rudder != 0.0))
    end = int(steered.max(initial=-1)) + 1
    if end < SHORTEST:
        got = f"{end} samples until nobody steers"
        raise refusal(f"run {run.name}", got, f"from {SHORTEST}", "leave the file out")
    return ShipRun(run.name, run.speed[:end], run.inputs.at(slice(0, end)))
