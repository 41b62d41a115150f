"""The memory in which the filter bank's kernel works on a pack of lanes, see `bank.pack`."""

from collections import namedtuple

import numpy as np

from auv_fault_env.channels import CHANNELS
from auv_fault_env.light import light
from diagnosers.bank.pack import (
    EFFECTS,
    SINGLE_ROWS,
    kept_workspace,
    new_rows,
    repeated_effects,
    table_rows,
)
from diagnosers.robust.algebra import N_STATES
from diagnosers.robust.hypotheses import HypothesisTable

N_ROWS = table_rows(N_STATES) | {
    "excess": 3,  # variance of the readings beyond their healthy noise
    "innovations": 3,  # standardised, of each reading
}
OWN_SINGLE_ROWS = (
    *SINGLE_ROWS,
    "weight",  # of the last innovation
    "standardised",  # the last innovation
    "rpm_share",  # of the measured shaft speed in the estimate
    "voltage_std",
    "expected",  # reading
    "expected_std",
    "evidence_before",  # the last reading
    "evidence_of_zero",
)
CHANGES = ("spread", "water")  # of the states, when a hypothesis begins and while it lasts
PROBABILITIES = ("switch_probability", "return_probability")  # (n_lanes, n_hypotheses)
OF_LANES = ("aligned", "best_column")  # see `alignment.align` and `alignment.compare_latencies`
Work = namedtuple(
    "Work",
    (*N_ROWS, *OWN_SINGLE_ROWS, *EFFECTS, *CHANGES, *PROBABILITIES, *OF_LANES, "states"),
)
light(Work)


def workspace(table: HypothesisTable, n_lanes: int) -> Work:
    """Memory for a pack, the thread's own."""
    return kept_workspace(new_workspace, table, n_lanes)


def new_workspace(table: HypothesisTable, n_lanes: int) -> Work:
    """Memory for a pack: the table's effects of severity, all else zero."""
    shape = n_lanes, table.log_hazard.size
    return Work(
        **new_rows(N_ROWS, OWN_SINGLE_ROWS, table.hypothesis.size * n_lanes),
        **repeated_effects(table, n_lanes),
        **{name: np.repeat(getattr(table, name), n_lanes) for name in CHANGES},
        **{name: np.zeros(shape) for name in PROBABILITIES},
        aligned=np.zeros((n_lanes, len(CHANNELS))),
        best_column=np.zeros(n_lanes, np.uint64),
        states=tuple(range(N_STATES)),
    )
