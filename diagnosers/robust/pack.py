"""The memory in which the filter bank's kernel works on a pack of lanes, see `bank.pack`."""

from collections import namedtuple

import numpy as np

from diagnosers.bank.hypotheses import N_PARAMETER_ROWS
from diagnosers.bank.pack import EFFECTS, kept_workspace, new_rows, repeated_effects
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
CHANGES = ("spread", "water")  # of the states, when a hypothesis begins and while it lasts
PROBABILITIES = ("switch_probability", "return_probability")  # (n_lanes, n_hypotheses)
Work = namedtuple("Work", (*N_ROWS, *SINGLE_ROWS, *EFFECTS, *CHANGES, *PROBABILITIES))


def workspace(table: HypothesisTable, n_lanes: int) -> Work:
    """Memory for a pack, the thread's own."""
    return kept_workspace(new_workspace, table, n_lanes)


def new_workspace(table: HypothesisTable, n_lanes: int) -> Work:
    """Memory for a pack: the table's effects of severity, all else zero."""
    shape = n_lanes, table.log_hazard.size
    return Work(
        **new_rows(N_ROWS, SINGLE_ROWS, table.hypothesis.size * n_lanes),
        **repeated_effects(table, n_lanes),
        **{name: np.repeat(getattr(table, name), n_lanes) for name in CHANGES},
        **{name: np.zeros(shape) for name in PROBABILITIES},
    )
