"""Packs of lanes: the memory in which the filter bank's kernel works, and how numbers of a lane come to its filters.

The lanes of a pack lie side by side along the filters, so that a small bank fills long loops too. A
column is one filter of one lane: that of filter f and lane p is ``f * n_lanes + p``. So those of a
subsystem are a range, a `part`.
"""

import math
import threading
from collections import namedtuple
from itertools import accumulate

import numpy as np

from auv_fault_env.compiling import inlined, scalar
from diagnosers.bank.algebra import N_PACKED, N_STATES
from diagnosers.bank.hypotheses import N_ROWS, HypothesisTable

# of a pack, about: enough to hide what starting a loop costs, few enough for the cache
COLUMNS = 512
TABLES = {  # rows by name, each of n_columns
    **dict.fromkeys(("filters", "normal"), N_PACKED),
    **dict.fromkeys(("base", "values", "by_severity", "nudged"), N_ROWS),
    **dict.fromkeys(("gradient", "second", "crossed"), N_STATES),
    **dict.fromkeys(("port", "starboard"), 4),
    **dict.fromkeys(("readings", "expected", "trial", "delivered", "pushed"), 3),
    **dict.fromkeys(("by_voltage", "innovation", "variance", "prior", "severity"), 2),
}
# each (n_columns,)
ROWS = ("shift", "growth", "evidence", "share", "start", "speed", "blur", "deflection")
BELIEVED = ("turning", "turning_slope", "turning_noise")  # of the motors, each (n_columns,)
EFFECTS = ("slope", "offset")  # of the severity on the parameters, each (N_ROWS, n_columns)
LAST = list(accumulate(TABLES.values()))
PLACES = {  # of all these in one table
    **{
        name: slice(last - n_rows, last)
        for (name, n_rows), last in zip(TABLES.items(), LAST, strict=True)
    },
    **{name: row for row, name in enumerate((*ROWS, *BELIEVED), LAST[-1])},
}

KEPT = threading.local()
# memory of a pack's update; does not outlive it
Work = namedtuple("Work", (*PLACES, *EFFECTS, "newcomers"))


def workspace(table: HypothesisTable, n_lanes: int) -> Work:
    """Room for a pack, the thread's own until it asks for another: to make it anew costs more than a single lane."""
    kept = getattr(KEPT, "work", None)
    if kept is None or kept[0] is not table.slope or kept[1] != n_lanes:
        KEPT.work = kept = table.slope, n_lanes, new_workspace(table, n_lanes)
    return kept[2]


def new_workspace(table: HypothesisTable, n_lanes: int) -> Work:
    """The table's effects of severity are already there, newcomers are (n_lanes, n_hypotheses), all else is zero."""
    memory = np.zeros((LAST[-1] + len(ROWS) + len(BELIEVED), table.hypothesis.size * n_lanes))
    effects = [np.repeat(getattr(table, name), n_lanes, axis=1) for name in EFFECTS]
    newcomers = np.zeros((n_lanes, table.log_hazard.size))
    return Work(*(memory[place] for place in PLACES.values()), *effects, newcomers)


def pack_size(n_lanes: int, n_filters: int) -> int:
    """Lanes of a pack, at least one and at most `n_lanes` if there are any; all packs of a share have as many."""
    n_packs = max(1, math.ceil(n_lanes / max(1, COLUMNS // n_filters)))
    return max(1, math.ceil(n_lanes / n_packs))


@scalar
def columns_of(m, table, n_lanes):
    """The columns of subsystem m, as a range."""
    return table.first[m] * np.uint64(n_lanes), table.first[m + 1] * np.uint64(n_lanes)


@inlined
def spread(of_lane, part, columns):
    """Copy the numbers of each lane (n_lanes,) to all its columns (n_columns,) of a subsystem."""
    n_lanes = np.uint64(of_lane.size)
    for p in range(n_lanes):
        for f in range((part[1] - part[0]) // n_lanes):
            columns[part[0] + f * n_lanes + p] = of_lane[p]
