"""Packs of lanes: the memory in which a bank's kernel works.

A column is one filter of one lane, ``f * n_lanes + lane``: a small bank too has long loops, and the
columns of a subsystem are a range.
"""

import math
import threading
from collections import namedtuple
from itertools import accumulate

import numpy as np

from auv_fault_env.compiling import inlined, scalar
from diagnosers.bank.algebra import N_MOMENTS, N_STATES
from diagnosers.bank.hypotheses import N_PARAMETER_ROWS, HypothesisTable

# of a pack, about: enough to hide what starting a loop costs, few enough for the cache
COLUMNS = 512
# tables (n_rows, n_columns) of the memory by name
N_ROWS = {
    "filters": N_MOMENTS,
    "normal": N_MOMENTS,  # the normal filter of the lane
    "healthy": N_PARAMETER_ROWS,  # the vehicle without deviations and without fault
    "parameters": N_PARAMETER_ROWS,  # at the means of the filter
    "by_severity": N_PARAMETER_ROWS,  # their derivatives
    "perturbed_parameters": N_PARAMETER_ROWS,
    "gradient": N_STATES,
    "current_gradient": N_STATES,
    "covariance": N_STATES,  # of the states with a measurement
    "port": 4,  # see `bank.surge.RPM_NOW`
    "starboard": 4,
    "readings": 3,
    "predicted": 3,  # see `bank.motor.predict`
    "perturbed": 3,
    "available": 3,
    "thrust": 3,  # see `bank.surge.THRUST`
    "by_voltage": 2,
    "innovation": 2,
    "variance": 2,
    "prior": 2,  # mean and variance of the severity
    "severity": 2,
}
# single rows (n_columns,) of the memory
SINGLE_ROWS = (
    "severity_shift",
    "variance_growth",
    "gain",
    "ratio",
    "unperturbed",
    "evidence",
    "mixing_probability",
    "shaft_speed_before",
    "surge_speed",
    "rpm_variance",
    "deflection",
    "shaft_speed",
    "shaft_speed_slope",
    "shaft_speed_noise",
)
EFFECTS = (
    "slope",
    "offset",
)  # of the severity on the parameters: tables of the hypotheses
LAST_ROWS = list(accumulate(N_ROWS.values()))
N_ALL_ROWS = LAST_ROWS[-1] + len(SINGLE_ROWS)

# memory of one step of a pack; nothing in it outlives the step
Work = namedtuple("Work", (*N_ROWS, *SINGLE_ROWS, *EFFECTS, "switch_probability"))
_of_thread = threading.local()


def workspace(table: HypothesisTable, n_lanes: int) -> Work:
    """Memory for a pack, the thread's own; allocated anew only for another table or size."""
    key, work = getattr(_of_thread, "workspace", (None, None))
    if key is None or key[0] is not table.slope or key[1] != n_lanes:
        work = new_workspace(table, n_lanes)
        _of_thread.workspace = (table.slope, n_lanes), work
    return work


def new_workspace(table: HypothesisTable, n_lanes: int) -> Work:
    """Memory for a pack: the table's effects of severity, all else zero."""
    memory = np.zeros((N_ALL_ROWS, table.hypothesis.size * n_lanes))
    rows = {
        name: memory[last - n_rows : last]
        for (name, n_rows), last in zip(N_ROWS.items(), LAST_ROWS, strict=True)
    }
    rows |= {name: memory[row] for row, name in enumerate(SINGLE_ROWS, LAST_ROWS[-1])}
    effects = {name: np.repeat(getattr(table, name), n_lanes, axis=1) for name in EFFECTS}
    return Work(
        **rows,
        **effects,
        switch_probability=np.zeros((n_lanes, table.log_hazard.size)),
    )


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


@inlined
def broadcast(of_lane, columns, out):
    """Copy the value of each lane (n_lanes,) to all its columns of a range of out (n_columns,)."""
    first, last = columns
    n_lanes = np.uint64(of_lane.size)
    n_filters = (last - first) // n_lanes
    for lane in range(n_lanes):
        for f in range(n_filters):
            c = first + f * n_lanes + lane
            out[c] = of_lane[lane]
