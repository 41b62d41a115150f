"""A vehicle's log as the channels of an observation, on a grid of samples, with every repair named."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS, COMMANDS
from auv_fault_env.errors import known_name, refusal
from auv_fault_env.parameters import SAMPLE_TIME
from training.field.logs.clock import Clock, clock_of
from training.field.logs.plausible import plausible
from training.field.logs.table import Table, read_table
from training.field.vehicle_file import Column, VehicleFile

SHORTEST = 10.0  # s without a break: a shorter stretch is left out
LONGEST = 5_000_000  # samples, 139 h


class Log(NamedTuple):
    """What a vehicle has logged.

    Attributes
    ----------
    name
        Of the file.
    time
        Seconds from the log's first sample, (n_samples,). After the clock was set it goes on one
        sample later.
    observation
        Channels in the order of `CHANNELS`, (n_samples, n_channels), every `SAMPLE_TIME` within a
        segment; a reading is NaN where none was taken (a log of 1 Hz has nine such rows between
        two), a command is held.
    segments
        Unbroken stretches of at least 10 s.
    repairs
        What was repaired, one line each.
    """

    name: str
    time: np.ndarray
    observation: np.ndarray
    segments: tuple[slice, ...]
    repairs: tuple[str, ...]


def read_log(path: Path, vehicle: VehicleFile) -> Log:
    """Read a log as the vehicle's file describes it.

    A sample is the row nearest to it within half a `SAMPLE_TIME`: a faster log is thinned, a slower
    one has gaps, and no reading is interpolated. `InputError` if a column is missing, if a unit
    cannot be right, or if less than 10 s are left; a log whose readings are wrong but possible
    passes, as it should: to tell is the diagnosers' task.
    """
    path = Path(path)
    table = read_table(path)
    repairs = list(table.repairs)
    columns = {
        channel: _values(table, channel, column) for channel, column in vehicle.columns.items()
    }
    heard = _heard(columns)
    clock = clock_of(_stamps(table, vehicle)[heard], vehicle.sample_rate, repairs)
    in_order = heard[clock.rows]
    values = plausible(
        {name: column[in_order] for name, column in columns.items()}, vehicle, repairs
    )
    stretches = _long_enough(clock, path.name, repairs)
    _say_if_thinned(clock, repairs)
    rows = channels_of(values)
    grids = [_on_grid(clock.time[stretch], rows[stretch]) for stretch in stretches]
    ends = np.cumsum([len(grid) for _, grid in grids])
    segments = tuple(
        slice(int(end) - len(grid), int(end)) for end, (_, grid) in zip(ends, grids, strict=True)
    )
    time, observation = (np.concatenate(parts) for parts in zip(*grids, strict=True))
    return Log(path.name, time - time[0], observation, segments, tuple(repairs))


def channels_of(values: Mapping[str, np.ndarray]) -> np.ndarray:
    """Rows of all channels, (n_rows, n_channels), from the values by channel (n_rows,); NaN for a channel without.

    A vehicle that logs one of mission speed and speed command has that for both; a fin that is not
    logged is amidships.
    """
    size = len(next(iter(values.values())))
    rows = np.full((size, len(CHANNELS)), np.nan)
    usual = {"rudder": np.zeros(size), "stern_plane": np.zeros(size)}
    for one, other in (("mission_speed", "speed_command"), ("speed_command", "mission_speed")):
        usual |= {one: values[other]} if other in values else {}
    for channel, column in (usual | dict(values)).items():
        rows[:, list(CHANNELS).index(channel)] = column
    return rows


def _values(table: Table, thing: str, column: Column) -> np.ndarray:
    name = known_name(f"column of {thing}", column.name, table.columns)
    with np.errstate(over="ignore"):
        return column.scale * table.columns[name] + column.offset


def _heard(columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """The rows in which any channel has a number; all, if none has."""
    heard = np.any([np.isfinite(column) for column in columns.values()], axis=0)
    return np.flatnonzero(heard) if heard.any() else np.arange(heard.size)


def _stamps(table: Table, vehicle: VehicleFile) -> np.ndarray:
    if vehicle.time is None:
        return np.arange(len(next(iter(table.columns.values())))) / vehicle.sample_rate
    return _values(table, "time", vehicle.time)


def _long_enough(clock: Clock, name: str, repairs: list[str]) -> list[slice]:
    ends = np.append(clock.starts[1:], clock.time.size)
    length = clock.time[ends - 1] - clock.time[clock.starts] + SAMPLE_TIME
    kept = np.flatnonzero(length > SHORTEST - 0.5 * SAMPLE_TIME)
    if not kept.size:
        allowed = f"at least {SHORTEST:g} s without a break"
        raise refusal(
            "log", f"{name}: {length.max():.3g} s", allowed, "give a longer one, or correct [time]"
        )
    if length[kept].sum() > LONGEST * SAMPLE_TIME:
        got = f"{name}: {length[kept].sum() / SAMPLE_TIME:.3g} samples"
        raise refusal("log", got, f"at most {LONGEST}", "split it")
    if kept.size < length.size:
        repairs.append(
            f"time: stretches shorter than {SHORTEST:g} s left out ({length.size - kept.size})"
        )
    return [slice(int(clock.starts[k]), int(ends[k])) for k in kept]


def _say_if_thinned(clock: Clock, repairs: list[str]) -> None:
    step = float(np.median(np.diff(clock.time)))
    if step < 0.7 * SAMPLE_TIME:
        repairs.append(
            f"time: rows come every {step:.3g} s; the nearest to each {SAMPLE_TIME:g} s is kept"
        )


def _on_grid(time: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """One stretch: the reading nearest to each sample, if it is within half a sample of it, and commands held."""
    elapsed = (time - time[0]) / SAMPLE_TIME
    sample = np.rint(elapsed).astype(int)
    nearest_last = np.argsort(-abs(elapsed - sample), kind="stable")
    grid = np.full((sample[-1] + 1, rows.shape[1]), np.nan)
    for k, channel in enumerate(CHANNELS):
        read = nearest_last[np.isfinite(rows[nearest_last, k])]
        grid[sample[read], k] = rows[read, k]
        if channel in COMMANDS:
            grid[:, k] = _held(grid[:, k])
    return time[0] + SAMPLE_TIME * np.arange(len(grid)), grid


def _held(values: np.ndarray) -> np.ndarray:
    """Each NaN replaced by the last value before it; those before the first stay."""
    last = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(values.size), 0))
    return values[last]
