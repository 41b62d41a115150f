"""Logs of simulated vehicles."""

from functools import cache
from pathlib import Path

import numpy as np

from auv_fault_env.channels import CHANNELS
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS
from auv_fault_env.parameters import PRESETS, SAMPLE_TIME
from auv_fault_env.schedules import FaultEvent
from training.field.logs.log import Log
from training.field.vehicle_file import Column, VehicleFile
from training.rollouts import roll_out

NAMES = list(CHANNELS)
VEHICLE = VehicleFile(
    vehicle=PRESETS["thesis1992"],
    columns={name: Column(name) for name in CHANNELS},
    time=Column("time"),
)


@cache
def episode(
    fault: str | None = None, severity: float = 0.9, n_samples: int = 200, seed: int = 11
) -> np.ndarray:
    """Observations (n_samples, n_channels) of a vehicle on the thesis' stimulus; the fault begins
    at 5 s.
    """
    schedule = (FaultEvent(fault, onset=5.0, severity=severity),) if fault else ()
    rolled = roll_out(
        Fleet(1), [seed], n_samples, schedules=[schedule], missions=[MISSIONS["thesis"]]
    )
    observations = rolled.observations[:, 0].astype(np.float64)
    observations.setflags(write=False)
    return observations


def log_of(observations: np.ndarray, segments: tuple[slice, ...] | None = None) -> Log:
    """The log of an episode, in one segment if none are given."""
    time = np.arange(len(observations)) * SAMPLE_TIME
    return Log("log.csv", time, observations, segments or (slice(0, len(observations)),), ())


def write_log(path: Path, observations: np.ndarray) -> Path:
    """The log as the CSV that `VEHICLE` describes."""
    path.write_bytes(csv_lines(observations))
    return path


def csv_lines(observations: np.ndarray, first: float = 100.0) -> bytes:
    """A header and a line per sample."""
    rows = [[first + k * SAMPLE_TIME, *row] for k, row in enumerate(observations.tolist())]
    return "\n".join(
        [",".join(["time", *NAMES]), *(",".join(map(repr, row)) for row in rows), ""]
    ).encode()
