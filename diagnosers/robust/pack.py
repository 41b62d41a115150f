"""The memory in which the filter bank's kernel works on a pack of lanes, see `bank.pack`."""

import threading
from collections import namedtuple
from itertools import accumulate

import numpy as np

from diagnosers.bank.hypotheses import N_PARAMETER_ROWS
from diagnosers.robust.algebra import N_MOMENTS, N_STATES
from diagnosers.robust.hypotheses import HypothesisTable

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
    "rounding": 3,  # variance of the readings by their rounding
    "thrust": 3,  # see `bank.surge.THRUST`
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
    "weight",  # of the last innovation
    "rpm_weight",
    "unperturbed",
    "evidence",
    "mixing_probability",
    "shaft_speed_before",
    "surge_speed",
    "expected",  # reading
    "expected_std",
    "evidence_of_zero",
    "added",  # variance that a state gains in a sample
    "deflection",
    "shaft_speed",
    "shaft_speed_slope",
    "shaft_speed_noise",
)
EFFECTS = ("slope", "offset")  # of the severity on the parameters: tables of the hypotheses
CHANGES = ("spread", "water")  # of the states, when a hypothesis begins and while it lasts
LAST_ROWS = list(accumulate(N_ROWS.values()))
N_ALL_ROWS = LAST_ROWS[-1] + len(SINGLE_ROWS)

# memory of one step of a pack; nothing in it outlives the step
PROBABILITIES = ("switch_probability", "return_probability")  # (n_lanes, n_hypotheses)
Work = namedtuple("Work", (*N_ROWS, *SINGLE_ROWS, *EFFECTS, *CHANGES, *PROBABILITIES))
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
    changes = {name: np.repeat(getattr(table, name), n_lanes) for name in CHANGES}
    shape = n_lanes, table.log_hazard.size
    probabilities = {name: np.zeros(shape) for name in PROBABILITIES}
    return Work(**rows, **effects, **changes, **probabilities)
