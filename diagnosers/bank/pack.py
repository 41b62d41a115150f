"""Packs of lanes: the memory in which a bank's kernel works.

A column is one filter of one lane: a small bank too has long loops. The columns of a subsystem are
a range, lane after lane, so that those of each lane are a range too, beside one another as in the
state.
"""

import math
import threading
from collections import namedtuple
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from auv_fault_env.compiling import part, scalar
from auv_fault_env.faults import classes
from auv_fault_env.light import Memory, light
from diagnosers.bank.algebra import N_STATES, moments_of
from diagnosers.bank.hypotheses import N_PARAMETER_ROWS, HypothesisTable, of_catalogue

# of a pack, at most if a lane has fewer: enough to hide what starting a loop costs, few enough for
# the cache. An odd multiple of 8, so that the same column of many rows does not compete for the
# same place in the cache.
ROW_LENGTH = 264


def table_rows(n_states: int) -> dict[str, int]:
    """Rows of the tables (n_rows, n_columns) by name that the memory of every bank has."""
    return {
        "filters": moments_of(n_states),
        "normal": moments_of(n_states),  # the lane's normal filter, with a severity that begins
        "healthy": N_PARAMETER_ROWS,  # the vehicle without deviations and without fault
        "parameters": N_PARAMETER_ROWS,  # at the means of the filter
        "by_severity": N_PARAMETER_ROWS,  # their derivatives
        "perturbed_parameters": N_PARAMETER_ROWS,
        "gradient": n_states,
        "current_gradient": n_states,
        "covariance": n_states,  # of the states with a measurement
        "port": 4,  # see `bank.surge.RPM_NOW`
        "starboard": 4,
        "readings": 3,
        "predicted": 3,  # see `bank.motor.predict`
        "perturbed": 3,
        "available": 3,
        "thrust": 3,  # see `bank.surge.THRUST`
        "severity": 2,  # mean and variance
    }


# single rows (n_columns,) of the memory of every bank
SINGLE_ROWS = (
    "innovation",  # of a measurement, and the next three
    "variance",  # of the noise
    "is_available",  # 1 or 0
    "variance_by_states",
    "gain",
    "current_innovation",  # of the current, which is measured after the rpm
    "current_variance",
    "unperturbed",
    "evidence",
    "mixing_probability",
    "added",  # variance that a state gains in a sample
    "shaft_speed_before",
    "surge_speed",
    "deflection",
    "shaft_speed",
    "shaft_speed_slope",
    "shaft_speed_noise",
)
# of the Gaussian bank's memory
N_ROWS = table_rows(N_STATES) | {"by_voltage": 2}
OWN_SINGLE_ROWS = (*SINGLE_ROWS, "ratio", "rpm_variance")
EFFECTS = ("slope", "offset")  # of the severity on the parameters: tables of the hypotheses
# of a `Memory`, what is no table of rows: by hypothesis `share`, by class `total`. `states` are
# their indices, a tuple so that loops over them have a constant length.
Parts = light(namedtuple("Parts", ("switch_probability", "share", "total", "states")))
_of_thread = threading.local()


def workspace(table: HypothesisTable, n_lanes: int) -> Memory:
    """Memory for one step of a pack, the thread's own; nothing in it outlives the step."""
    return kept_workspace(new_workspace, table, n_lanes)


def kept_workspace(
    make: Callable[[NamedTuple, int], Memory], table: NamedTuple, n_lanes: int
) -> Memory:
    """What ``make(table, n_lanes)`` gave in this thread; made anew for another table or size."""
    kept = _of_thread.__dict__.setdefault("workspaces", {})
    slope, size, work = kept.get(make, (None, 0, None))
    if slope is not table.slope or size != n_lanes:
        work = make(table, n_lanes)
        kept[make] = table.slope, n_lanes, work
    return work


def new_workspace(table: HypothesisTable, n_lanes: int) -> Memory:
    """Memory for a pack: the table's effects of severity, all else zero."""
    n_hypotheses = table.log_hazard.size
    parts = Parts(
        switch_probability=np.zeros((n_lanes, n_hypotheses)),
        share=np.zeros(n_hypotheses),
        total=np.zeros(len(of_catalogue(classes))),
        states=tuple(range(N_STATES)),
    )
    return memory_of(N_ROWS, OWN_SINGLE_ROWS, EFFECTS, table, n_lanes, parts)


def memory_of(
    n_rows: Mapping[str, int],
    single_rows: Sequence[str],
    of_table: Sequence[str],
    table: NamedTuple,
    n_lanes: int,
    parts: NamedTuple,
) -> Memory:
    """Memory for a pack with tables of rows by name, single rows, and these of the hypotheses."""
    repeats = {name: repeated(getattr(table, name), table, n_lanes) for name in of_table}
    of_hypotheses = {name: len(rows) if rows.ndim == 2 else None for name, rows in repeats.items()}
    rows = {**n_rows, **dict.fromkeys(single_rows), **of_hypotheses}
    memory = new_memory(rows, table.hypothesis.size * n_lanes, parts)
    for name, values in repeats.items():
        memory.tables[name][:] = values
    return memory


def new_memory(n_rows: Mapping[str, int | None], n_columns: int, parts: NamedTuple) -> Memory:
    """Memory of zeros with these tables, see `auv_fault_env.light.Memory`."""
    return Memory(n_rows, n_columns, row_length(n_columns), parts)


def row_length(n_columns: int) -> int:
    """Length of the rows of a memory: few different ones, because each is compiled for itself."""
    doublings = max(0, math.ceil(math.log2(n_columns / ROW_LENGTH)))
    return ROW_LENGTH << doublings


def repeated(of_filters: np.ndarray, table: NamedTuple, n_lanes: int) -> np.ndarray:
    """What is said of each filter (..., n_filters), of each column of a pack (..., n_columns)."""
    of_subsystems = np.split(of_filters, table.first_filter[1:-1].astype(np.int64), axis=-1)
    repeats = (*[1] * (of_filters.ndim - 1), n_lanes)
    return np.concatenate([np.tile(one, repeats) for one in of_subsystems], axis=-1)


def pack_size(n_lanes: int, n_filters: int) -> int:
    """Lanes of a pack, the same for all packs of a share: at least 1, at most `n_lanes` if any."""
    n_packs = max(1, math.ceil(n_lanes / max(1, ROW_LENGTH // n_filters)))
    return max(1, math.ceil(n_lanes / n_packs))


@scalar
def filters_of(subsystem, table):
    """Range of the filters of a subsystem, (first, before which)."""
    return table.first_filter[subsystem], table.first_filter[subsystem + 1]


@scalar
def columns_of(subsystem, table, n_lanes):
    """Range of the columns of a subsystem."""
    first, last = filters_of(subsystem, table)
    lanes = np.uint64(n_lanes)
    return first * lanes, last * lanes


@scalar
def columns_of_lane(lane, columns, n_lanes):
    """Range of a lane's columns among those of a subsystem."""
    first, last = columns
    n_filters = (last - first) // np.uint64(n_lanes)
    begin = first + np.uint64(lane) * n_filters
    return begin, begin + n_filters


@scalar
def column_shift(lane, subsystem, table, n_lanes):
    """What to add to a filter of a subsystem, as counted among all, for its column on a lane."""
    first, last = filters_of(subsystem, table)
    return first * (np.uint64(n_lanes) - np.uint64(1)) + np.uint64(lane) * (last - first)


@part
def broadcast(of_lane, columns, out):
    """Copy the value of each lane (n_lanes,) to all its columns of a range of out (n_columns,)."""
    n_lanes = of_lane.size
    for lane in range(n_lanes):
        first, last = columns_of_lane(lane, columns, n_lanes)
        for c in range(first, last):
            out[c] = of_lane[lane]


@part
def gather(subsystem, old, table, work):
    """Fill the columns of a subsystem from the lanes' filters and healthy vehicles."""
    n_lanes = old.age.size
    first, last = filters_of(subsystem, table)
    columns = columns_of(subsystem, table, n_lanes)
    for i in range(old.filters.shape[1]):
        for lane in range(n_lanes):
            shift = column_shift(lane, subsystem, table, n_lanes)
            for f in range(first, last):
                work.filters[i, f + shift] = old.filters[lane, i, f]
        broadcast(old.filters[:, i, first], columns, work.normal[i])
    for r in range(N_PARAMETER_ROWS):
        parameter = table.parameter[subsystem, r]
        broadcast(old.healthy[:, parameter], columns, work.healthy[r])


@part
def scatter(subsystem, new, table, work):
    """Fill the lanes' filters and shaft speeds of a subsystem; 0 is that of surge filters."""
    n_lanes = new.age.size
    first, last = filters_of(subsystem, table)
    for lane in range(n_lanes):
        shift = column_shift(lane, subsystem, table, n_lanes)
        for f in range(first, last):
            new.shaft_speed[lane, f] = work.shaft_speed[f + shift]
        for i in range(new.filters.shape[1]):
            for f in range(first, last):
                new.filters[lane, i, f] = work.filters[i, f + shift]
