"""The arguments of every command, one dataclass each: configuration, help text and logged settings in one."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal


@dataclass(frozen=True)
class Reproduce:
    """Run the thesis' test runs and show our figures beside the thesis'."""

    output: Path = Path("runs/reproduce")
    """Folder of the report; an earlier report there is replaced."""
    seed: int = 0
    """First seed of the noisy runs."""
    seeds: int = 20
    """Number of noisy runs of each test."""


@dataclass(frozen=True)
class Simulate:
    """Simulate vehicles with faults and write every sample to CSV and Parquet."""

    output: Path = Path("runs/simulate")
    """Folder of the files; an earlier run there is replaced."""
    vehicles: int = 8
    """Number of vehicles, one episode each."""
    duration: float = 60.0
    """Length of an episode [s]."""
    seed: int = 0
    """Seed of the first vehicle; vehicle k has seed + k."""
    schedule: Path | None = None
    """JSON file with the fault schedule of every vehicle; sampled anew for each if not given. [] is healthy."""
    mission: str | None = None
    """thesis, acceleration, cruise or a constant speed in m/s; sampled anew for each vehicle if not given."""
    preset: str = "thesis1992"
    """Vehicle: thesis1992 or npsnet1995."""
    sensor_noise: float = 1.0
    """Factor on the readings' noise, 0 for none."""
    disturbance: float = 1.0
    """Factor on the disturbing acceleration, 0 for none."""
    healthy_band: float = 1.0
    """Factor on the spread of healthy vehicles, 0 for none."""
    formats: tuple[Literal["csv", "parquet"], ...] = ("csv", "parquet")
    """Files to write."""


COMMANDS: dict[str, type] = {"reproduce": Reproduce, "simulate": Simulate}
