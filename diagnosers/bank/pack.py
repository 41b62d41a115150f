"""Packs of lanes: the memory in which a bank's kernel works.

A column is one filter of one lane, ``f * n_lanes + lane``: a small bank too has long loops, and the
columns of a subsystem are a range.
"""

import math
import threading
from collections import namedtuple
from collections.abc import Callable, Mapping, Sequence
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from auv_fault_env.compiling import part, scalar
from auv_fault_env.light import light
from diagnosers.bank.algebra import N_STATES, moments_of
from diagnosers.bank.hypotheses import N_PARAMETER_ROWS, HypothesisTable

# of a pack, about: enough to hide what starting a loop costs, few enough for the cache
COLUMNS = 512


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
        "innovation": 2,
        "variance": 2,
        "severity": 2,  # mean and variance
    }


# single rows (n_columns,) of the memory of every bank
SINGLE_ROWS = (
    "severity_shift",
    "variance_growth",
    "variance_by_states",  # of a measurement
    "gain",
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
# memory of one step of a pack; nothing in it outlives the step. `states` are their indices, a tuple
# so that loops over them have a constant length.
Work = namedtuple("Work", (*N_ROWS, *OWN_SINGLE_ROWS, *EFFECTS, "switch_probability", "states"))
light(Work)
_of_thread = threading.local()


def workspace(table: HypothesisTable, n_lanes: int) -> Work:
    """Memory for a pack, the thread's own."""
    return kept_workspace(new_workspace, table, n_lanes)


def kept_workspace(
    make: Callable[[NamedTuple, int], NamedTuple], table: NamedTuple, n_lanes: int
) -> NamedTuple:
    """What ``make(table, n_lanes)`` gave in this thread; made anew for another table or size."""
    kept = _of_thread.__dict__.setdefault("workspaces", {})
    slope, size, work = kept.get(make, (None, 0, None))
    if slope is not table.slope or size != n_lanes:
        work = make(table, n_lanes)
        kept[make] = table.slope, n_lanes, work
    return work


def new_workspace(table: HypothesisTable, n_lanes: int) -> Work:
    """Memory for a pack: the table's effects of severity, all else zero."""
    return Work(
        **new_rows(N_ROWS, OWN_SINGLE_ROWS, table.hypothesis.size * n_lanes),
        **repeated_effects(table, n_lanes),
        switch_probability=np.zeros((n_lanes, table.log_hazard.size)),
        states=tuple(range(N_STATES)),
    )


def new_rows(
    n_rows: Mapping[str, int], single_rows: Sequence[str], n_columns: int
) -> dict[str, np.ndarray]:
    """Tables (n_rows, n_columns) and single rows (n_columns,) by name, zeros side by side."""
    last_rows = list(accumulate(n_rows.values()))
    memory = np.zeros((last_rows[-1] + len(single_rows), n_columns))
    tables = zip(n_rows.items(), last_rows, strict=True)
    rows = {name: memory[last - n : last] for (name, n), last in tables}
    return rows | {name: memory[row] for row, name in enumerate(single_rows, last_rows[-1])}


def repeated_effects(table: NamedTuple, n_lanes: int) -> dict[str, np.ndarray]:
    """The tables `EFFECTS` of the hypotheses, (n_rows, n_columns)."""
    return {name: np.repeat(getattr(table, name), n_lanes, axis=1) for name in EFFECTS}


def pack_size(n_lanes: int, n_filters: int) -> int:
    """Lanes of a pack, the same for all packs of a share: at least 1, at most `n_lanes` if any."""
    n_packs = max(1, math.ceil(n_lanes / max(1, COLUMNS // n_filters)))
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


@part
def broadcast(of_lane, columns, out):
    """Copy the value of each lane (n_lanes,) to all its columns of a range of out (n_columns,)."""
    first, last = columns
    n_lanes = np.uint64(of_lane.size)
    n_filters = (last - first) // n_lanes
    for lane in range(n_lanes):
        for f in range(n_filters):
            c = first + f * n_lanes + lane
            out[c] = of_lane[lane]


@part
def gather(subsystem, old, table, work):
    """Fill the columns of a subsystem from the lanes' filters and healthy vehicles."""
    n_lanes = np.uint64(old.age.size)
    first, last = filters_of(subsystem, table)
    columns = columns_of(subsystem, table, n_lanes)
    for i in range(old.filters.shape[1]):
        for lane in range(n_lanes):
            for f in range(first, last):
                c = f * n_lanes + lane
                work.filters[i, c] = old.filters[lane, i, f]
        broadcast(old.filters[:, i, first], columns, work.normal[i])
    for r in range(N_PARAMETER_ROWS):
        parameter = table.parameter[subsystem, r]
        broadcast(old.healthy[:, parameter], columns, work.healthy[r])


@part
def scatter(new, work):
    """Fill the lanes' filters and shaft speeds from all columns; 0 is that of surge filters."""
    n_lanes = np.uint64(new.age.size)
    n_filters = np.uint64(new.shaft_speed.shape[1])
    for lane in range(n_lanes):
        for f in range(n_filters):
            c = f * n_lanes + lane
            new.shaft_speed[lane, f] = work.shaft_speed[c]
        for i in range(new.filters.shape[1]):
            for f in range(n_filters):
                c = f * n_lanes + lane
                new.filters[lane, i, f] = work.filters[i, c]
