"""The Esso Osaka free-running model tests: runs of a healthy 3 m model ship under random propeller and rudder.

NAOE-5thLab/FRT-DS-ESSO (Osaka University), CC BY-NC-SA 4.0: ten samples a second of position,
speeds, heading, yaw rate, propeller, rudder and wind on an open pond. Nobody broke anything: what
varies from run to run is the healthy band.
"""

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
    """What drives the surge speed, (n_samples,) each, or all of it at other instants.

    sway [m/s], to starboard amidships; yaw_rate [rad/s]; rpm of the one propeller, negative astern;
    rudder [rad]; wind [m/s], the relative wind along the ship.
    """

    sway: np.ndarray
    yaw_rate: np.ndarray
    rpm: np.ndarray
    rudder: np.ndarray
    wind: np.ndarray

    def between(self) -> "Inputs":
        """The means over each sample, (n_samples - 1,)."""
        return Inputs(*(0.5 * (values[1:] + values[:-1]) for values in self))

    def part(self, which: slice) -> "Inputs":
        """The same at some of the instants."""
        return Inputs(*(values[which] for values in self))


class ShipRun(NamedTuple):
    """One run: its name, the surge speed amidships [m/s], (n_samples,), and what drives it."""

    name: str
    speed: np.ndarray
    inputs: Inputs


def load(folder: Path) -> list[ShipRun]:
    """The runs of random manoeuvres in ``folder/random/*.csv``, whole; `InputError` if one is broken or missing."""
    return [
        read_run(path)
        for path in tqdm(data_files(folder, PATTERN, SOURCE), desc="runs", unit="run", leave=False)
    ]


def read_run(path: Path) -> ShipRun:
    """One run, in the units of this project: rev/s become rpm, relative wind its part along the ship."""
    time, surge, sway, yaw_rate, propeller, rudder, wind, direction = read_columns(
        path, COLUMNS, SHORTEST
    ).T
    late = np.flatnonzero(np.abs(np.diff(time) - SAMPLE_TIME) > JITTER)
    if late.size:
        allowed = f"a row every {SAMPLE_TIME:g} s"
        remedy = "cut the file there"
        raise refusal(
            f"file {path.name}",
            f"t = {time[late[0]]:g} s, then {time[late[0] + 1]:g} s",
            allowed,
            remedy,
        )
    name = path.stem.removeprefix("random_")
    return ShipRun(
        name, surge, Inputs(sway, yaw_rate, 60.0 * propeller, rudder, wind * np.cos(direction))
    )


def free_running(run: ShipRun) -> ShipRun:
    """The run up to where propeller and rudder are at zero for good: from there on people bring the model back.

    The commands tell nothing of that: with the propeller at rest it is towed at up to 0.2 m/s, or
    stopped at the bank. Raises `InputError` if less than a minute is left.
    """
    steered = np.flatnonzero((run.inputs.rpm != 0.0) | (run.inputs.rudder != 0.0))
    end = int(steered.max(initial=-1)) + 1
    if end < SHORTEST:
        raise refusal(
            f"run {run.name}",
            f"{end} samples until nobody steers",
            f"from {SHORTEST}",
            "leave the file out",
        )
    return ShipRun(run.name, run.speed[:end], run.inputs.part(slice(0, end)))
