"""A vehicle's log as the channels of an observation, sample by sample, with remarks on repairs."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS, COMMANDS
from auv_fault_env.errors import known_name, refusal
from auv_fault_env.parameters import SAMPLE_TIME
from auv_fault_env.printable import printable
from diagnosers.diagnoser import last_values
from training.field.logs.clock import TimeAxis, time_axis
from training.field.logs.files import read_table
from training.field.logs.plausible import plausible_values
from training.field.logs.table import Table
from training.field.units import UNITS, spelt
from training.field.vehicle_file import Column, VehicleFile, unit_of
from training.logged_vehicle import observations_of

SHORTEST = 10.0  # s: a shorter segment is left out
LONGEST = 5_000_000  # samples, 139 h


class Log(NamedTuple):
    """The recording of one mission."""

    name: str  # of the file, as it can be shown
    # (n_samples,) [s] from the first sample; after the clock was set it goes on one sample later
    time: np.ndarray
    # (n_samples, n_channels), every `SAMPLE_TIME` within a segment. A reading is NaN where none
    # arrived: a log of 1 Hz has nine such rows between two. A command stays until the next one.
    observation: np.ndarray
    segments: tuple[slice, ...]  # the unbroken parts of at least 10 s
    remarks: tuple[str, ...]  # what was repaired, one line each


def read_log(path: Path, vehicle: VehicleFile) -> Log:
    """Read a log as the vehicle file describes it.

    A sample is the row nearest to it within half a `SAMPLE_TIME`: a faster log is thinned, a slower
    one has gaps, and no reading is interpolated. A log whose readings are wrong but possible is
    accepted, because a fault may have made them wrong. `InputError` if a column is missing, a unit
    cannot be right, or less than 10 s are left.
    """
    path = Path(path)
    name = printable(path.name)
    table = read_table(path)
    remarks = list(table.remarks)
    columns = {
        channel: _scaled_column(table, channel, column)
        for channel, column in vehicle.columns.items()
    }
    remarks += _unit_remarks(table, vehicle)
    rows = _rows_with_numbers(columns)
    axis = time_axis(_stamps(table, vehicle, remarks)[rows], vehicle.sample_rate, remarks)
    rows = rows[axis.rows]
    values = {channel: column[rows] for channel, column in columns.items()}
    values = plausible_values(values, vehicle, remarks)
    long_segments = _long_segments(axis, name, remarks)
    _remark_if_thinned(axis, remarks)
    observations = observations_of(values)
    grids = [_on_grid(axis.time[segment], observations[segment]) for segment in long_segments]
    time = np.concatenate([time for time, _ in grids])
    observation = np.concatenate([grid for _, grid in grids])
    segments = _consecutive_slices([len(grid) for _, grid in grids])
    return Log(name, time - time[0], observation, segments, tuple(remarks))


def _scaled_column(table: Table, thing: str, column: Column) -> np.ndarray:
    for name in column.names:
        known_name(f"column of {thing}", name, table.columns)
        if name in table.refusals:
            raise table.refusals[name]
    with np.errstate(over="ignore"):
        values = column.scale * table.columns[column.name] + column.offset
        return values if column.times is None else values * table.columns[column.times]


def _unit_remarks(table: Table, vehicle: VehicleFile) -> Iterator[str]:
    """Remarks on the channels whose unit in the log is not that of the vehicle file."""
    for channel, column in vehicle.columns.items():
        kind = CHANNELS[channel].unit
        stated = spelt(table.units.get(column.name, ""), kind)
        used = unit_of(column, kind)
        is_other = stated and used != stated and UNITS[kind][used] == abs(column.scale)
        if is_other and column.times is None:
            yield f"{channel}: in {stated} by the log, read in {used} by the vehicle file"


def _rows_with_numbers(columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """The rows in which any channel has a number; all rows if none has."""
    has_number = np.any([np.isfinite(column) for column in columns.values()], axis=0)
    return np.flatnonzero(has_number) if has_number.any() else np.arange(has_number.size)


def _stamps(table: Table, vehicle: VehicleFile, remarks: list[str]) -> np.ndarray:
    """Seconds of each row; the unit of the vehicle file is that of numbers, not of time stamps."""
    if vehicle.time is None:
        step = 1.0 / vehicle.sample_rate
        remarks.append(f"time: the vehicle file names no column; rows are taken {step:g} s apart")
        return step * np.arange(len(next(iter(table.columns.values()))))
    if vehicle.time.name in table.stamps:
        return _scaled_column(table, "time", Column(vehicle.time.name))
    return _scaled_column(table, "time", vehicle.time)


def _long_segments(axis: TimeAxis, log: str, remarks: list[str]) -> list[slice]:
    length = axis.time[axis.ends - 1] - axis.time[axis.starts] + SAMPLE_TIME
    long_ones = np.flatnonzero(length > SHORTEST - 0.5 * SAMPLE_TIME)
    if not long_ones.size:
        allowed = f"at least {SHORTEST:g} s without a break"
        got = f"{log}: {length.max():.3g} s"
        raise refusal("log", got, allowed, "name a longer one, or correct [time]")
    total = length[long_ones].sum()
    if total > LONGEST * SAMPLE_TIME:
        got = f"{log}: {total / SAMPLE_TIME:.3g} samples"
        raise refusal("log", got, f"at most {LONGEST}", "split it")
    n_short = length.size - long_ones.size
    if n_short:
        remarks.append(f"time: segments shorter than {SHORTEST:g} s left out ({n_short})")
    return [slice(int(axis.starts[k]), int(axis.ends[k])) for k in long_ones]


def _remark_if_thinned(axis: TimeAxis, remarks: list[str]) -> None:
    step = float(np.median(np.diff(axis.time)))
    if step < 0.7 * SAMPLE_TIME:
        choice = f"the nearest to each {SAMPLE_TIME:g} s is kept"
        remarks.append(f"time: rows come every {step:.3g} s; {choice}")


def _on_grid(time: np.ndarray, observations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """One segment, sample by sample: the nearest reading within half a sample, the last command."""
    elapsed = (time - time[0]) / SAMPLE_TIME
    sample = np.rint(elapsed).astype(int)
    nearest_last = np.argsort(-abs(elapsed - sample), kind="stable")
    grid = np.full((sample[-1] + 1, len(CHANNELS)), np.nan)
    for k, channel in enumerate(CHANNELS):
        is_available = np.isfinite(observations[nearest_last, k])
        rows = nearest_last[is_available]
        grid[sample[rows], k] = observations[rows, k]
        if channel in COMMANDS:
            grid[:, k : k + 1] = last_values(grid[:, k : k + 1])
    return time[0] + SAMPLE_TIME * np.arange(len(grid)), grid


def _consecutive_slices(lengths: list[int]) -> tuple[slice, ...]:
    ends = np.cumsum(lengths).tolist()
    return tuple(slice(end - length, end) for end, length in zip(ends, lengths, strict=True))
