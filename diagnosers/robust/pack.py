"""The memory in which the filter bank's kernel works on a pack of lanes, see `bank.pack`."""

from collections import namedtuple

import numpy as np

from auv_fault_env.channels import CHANNELS
from auv_fault_env.faults import classes
from auv_fault_env.light import Memory, light
from diagnosers.bank.hypotheses import of_catalogue
from diagnosers.bank.pack import (
    EFFECTS,
    SINGLE_ROWS,
    kept_workspace,
    memory_of,
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
    "rpm_by_voltage",  # derivative of the predicted reading
    "voltage_std",
    "expected",  # reading
    "expected_std",
    "evidence_before",  # the last reading
    "evidence_of_zero",
)
CHANGES = ("spread", "water")  # of the states, when a hypothesis begins and while it lasts
PROBABILITIES = ("switch_probability", "return_probability")  # (n_lanes, n_hypotheses)
OF_LANES = ("aligned", "best_column")  # see `alignment.align` and `alignment.compare_latencies`
Parts = light(namedtuple("Parts", (*PROBABILITIES, *OF_LANES, "share", "total", "states")))


def workspace(table: HypothesisTable, n_lanes: int) -> Memory:
    """Memory for one step of a pack, the thread's own; nothing in it outlives the step."""
    return kept_workspace(new_workspace, table, n_lanes)


def new_workspace(table: HypothesisTable, n_lanes: int) -> Memory:
    """Memory for a pack: the table's effects and changes, all else zero."""
    shape = n_lanes, table.log_hazard.size
    parts = Parts(
        share=np.zeros(table.log_hazard.size),
        total=np.zeros(len(of_catalogue(classes))),
        **{name: np.zeros(shape) for name in PROBABILITIES},
        aligned=np.zeros((n_lanes, len(CHANNELS))),
        best_column=np.zeros(n_lanes, np.uint64),
        states=tuple(range(N_STATES)),
    )
    return memory_of(N_ROWS, OWN_SINGLE_ROWS, (*EFFECTS, *CHANGES), table, n_lanes, parts)
