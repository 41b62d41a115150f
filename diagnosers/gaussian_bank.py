"""The filter bank of an exact model: a Kalman filter per hypothesis, Bayes' rule, switching."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from auv_fault_env.parameters import PARAMETERS
from diagnosers.bank import algebra
from diagnosers.bank.algebra import N_STATES, SEVERITY
from diagnosers.bank.base import Bank, Machinery, prior_severity
from diagnosers.bank.hypotheses import (
    OWN_PARAMETERS,
    SURGE,
    HypothesisTable,
    hypothesis_table,
    of_catalogue,
)
from diagnosers.bank.kernel import BankState, step_lanes
from diagnosers.bank.motor import DEVIATIONS
from diagnosers.bank.pack import workspace
from diagnosers.bank.sensors import N_READINGS, new_sample
from diagnosers.kalman import START_SPEED_STD

# of a faulty hypothesis: below, it is the normal vehicle under another name
MIN_SEVERITY = 0.1


@dataclass(frozen=True)
class GaussianBank(Bank):
    """A bank of Kalman filters whose model of vehicle, sensors and noise is taken as exact.

    The reference of bounds and of `Oracle`, and what `diagnosers.filter_bank` pays for robustness
    is measured against it. A fault lasts once it has begun; the hazard is constant for a minute and
    then falls with the age of the vehicle. There is no evidence about a motor
    before its first voltage reading. Current and shaft speed imply a silent voltage; where one of
    them is silent too, the last voltage reading replaces it.

    When it misleads: at constant speed some faults look alike (drag and thrust), and the prior
    divides the belief between them; repairs, intermittent and double faults are no hypotheses; a
    vehicle outside the healthy band, or noisier than `CHANNELS` says, is called faulty; so is one
    with imperfections as in `auv_fault_env.realism`; readings without any noise look stuck.
    """

    name = "gaussian_bank"
    machinery: ClassVar[Machinery] = Machinery(workspace, new_sample, step_lanes)

    def hypotheses(self, n_grades: int | None = None) -> HypothesisTable:
        """The hypotheses of the catalogue as it is now, by default of the bank's grades."""
        n_grades = len(self.grades) if n_grades is None else n_grades
        return of_catalogue(hypothesis_table, n_grades, self.hazard, self.fault_names)

    def table_of(self, state: BankState) -> HypothesisTable:
        """The hypotheses of the catalogue as it is now, of as many grades as the state has."""
        return self.hypotheses(state.prior.shape[2])

    def initial(self, n_lanes: int) -> BankState:
        """The state before any observation: a normal vehicle, somewhere in the healthy band."""
        low, high = np.array(self.grades).T
        variance = (high - low) ** 2 / 12
        least = np.maximum(low, MIN_SEVERITY)
        prior = np.stack([(low + high) / 2, variance, least])
        healthy = np.tile(self.healthy, (n_lanes, 1))
        return self._state_around(healthy, np.tile(prior, (n_lanes, 1, 1)), 1.0)

    def _state_around(self, healthy: np.ndarray, prior: np.ndarray, band: float) -> BankState:
        """State of vehicles with parameters in a band, given in healthy bands, around `healthy`.

        healthy is (n_lanes, n_parameters), prior that of `BankState`.
        """
        n_lanes = len(healthy)
        table = self.hypotheses(prior.shape[2])
        n_filters = table.hypothesis.size
        n_hypotheses = table.log_hazard.size
        log_posterior = np.full((n_lanes, n_hypotheses), -np.inf)
        log_posterior[:, 0] = 0.0
        severity = prior_severity(prior, table)
        filters = np.zeros((n_lanes, algebra.N_MOMENTS, n_filters))
        variances = [algebra.covariance_row.py_func(i, i, N_STATES) for i in range(SEVERITY)]
        for subsystem in OWN_PARAMETERS:
            first = int(table.first_filter[subsystem])
            last = int(table.first_filter[subsystem + 1])
            std = self._prior_std(subsystem, band)
            filters[:, variances, first:last] = np.square(std)[:, None]
        filters[:, SEVERITY] = severity[:, 0, table.hypothesis]
        filters[:, algebra.SEVERITY_VARIANCE] = severity[:, 1, table.hypothesis]
        return BankState(
            log_posterior=log_posterior,
            severity=severity,
            filters=filters,
            shaft_speed=np.full((n_lanes, n_filters), np.nan),
            readings=np.full((n_lanes, N_READINGS), np.nan),
            healthy=healthy,
            prior=prior,
            age=np.zeros(n_lanes),
        )

    def _prior_std(self, subsystem: int, band: float) -> list[float]:
        """Standard deviations of a filter's states at the start, without the severity."""
        # of a uniform distribution
        std = {name: band * self._band_of(name) / math.sqrt(3.0) for name in PARAMETERS}
        if subsystem != SURGE:
            return [std[OWN_PARAMETERS[subsystem][row]] for row in DEVIATIONS]
        sides = self._nominal.sides
        of_sides = (std[f"{side}_beta"] for side in sides)
        disturbance_std = math.sqrt(self.constants.disturbance_variance)
        thrust_std = math.hypot(*of_sides) / len(sides)
        return [START_SPEED_STD, disturbance_std, std["alpha"], thrust_std]

    def state_at_onset(self, state: BankState, lanes: np.ndarray) -> BankState:
        """The state if on these lanes (indices) a fault, or none, begins with the next sample.

        All classes are equally likely. The filters of every fault continue from the normal ones,
        with the severities of the prior. Until a hypothesis switches, differences of the log
        beliefs are log-likelihood ratios of the classes.
        """
        table = self.hypotheses(state.prior.shape[2])
        first = table.first_filter.astype(np.int64)
        normal_filter = np.repeat(first[:-1], np.diff(first))
        severity = prior_severity(state.prior[lanes], table)
        filters = state.filters[lanes][:, :, normal_filter]
        of_severity = [
            algebra.covariance_row.py_func(SEVERITY, i, N_STATES) for i in range(SEVERITY)
        ]
        filters[:, of_severity] = 0.0
        filters[:, SEVERITY] = severity[:, 0, table.hypothesis]
        filters[:, algebra.SEVERITY_VARIANCE] = severity[:, 1, table.hypothesis]
        n_members = np.bincount(table.class_index)
        n_equal = n_members.size * n_members[table.class_index]
        new = BankState(*(values.copy() for values in state))
        new.log_posterior[lanes] = -np.log(n_equal)
        new.severity[lanes] = severity
        new.filters[lanes] = filters
        new.shaft_speed[lanes] = state.shaft_speed[lanes][:, normal_filter]
        return new
