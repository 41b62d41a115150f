"""Two-sided CUSUM (Page 1954) on the residuals; the class by the pattern of the statistics.

Source: Page, "Continuous inspection schemes", Biometrika 41, 1954; as charts of residuals:
Basseville & Nikiforov, "Detection of Abrupt Changes", Prentice Hall 1993.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.distance import cdist

from auv_fault_env.channels import CHANNELS
from auv_fault_env.errors import whole_number
from auv_fault_env.faults import CATALOGUE, Fault
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import follow_mission
from auv_fault_env.parameters import SAMPLE_RATE
from auv_fault_env.schedules import FaultEvent
from diagnosers.diagnoser import (
    Belief,
    ModelBased,
    join_odds,
    with_impossible_unknown,
)
from diagnosers.kalman import Estimate, SurgeFilter
from diagnosers.symptoms.residuals import RESIDUALS, healthy_band, residuals

Arrays = tuple[np.ndarray, ...]
SIGNALS = (*RESIDUALS, "innovation")
SLACK = 0.25  # standard deviations, of the drift term beyond the healthy band
# of the squared differences, relative to their healthy mean
SCATTER_UP_SLACK = 1.5
SCATTER_DOWN_SLACK = 0.75
DISTURBANCE_SLACK = 0.6  # standard deviations of the disturbance in the drift term
# statistics of mean, scatter up and scatter down that a healthy vehicle reaches once an hour
LIMIT = {
    "voltage": (12.0, 31.0, 2.8),
    "torque": (9.0, 31.0, 4.2),
    "surge": (57.0, 31.0, 2.9),
    "innovation": (8.7, 31.0, 2.6),
}
OF_SIGNALS = np.array([LIMIT[name.split("_")[-1]] for name in SIGNALS])
# by chart, mean up and down and scatter up and down, then by signal
LIMITS = OF_SIGNALS[:, [0, 0, 1, 2]].T.ravel()
GAIN = 4.0  # log odds of a fault per limit
LARGEST_LOG_ODDS = 100.0  # of a fault
# of the signatures: missions, names or speeds [m/s]; onset and ages of the faults [s]
MISSIONS = ("thesis", ((0.0, 0.2),), ((0.0, 0.45),))
ONSET = 5.0
AGES = (2.0, 6.0, 14.0, 24.0)
SEVERITIES = (0.3, 0.6, 1.0)
SEVERITY_STD = 0.15  # half the distance between the severities
WIDTH = 0.5  # of a signature, in logarithms of statistics
LANES_IN_CACHE = 32  # whose distances to all signatures a processor's cache holds


class CusumState(NamedTuple):
    """What the charts remember of every lane."""

    previous: np.ndarray  # (n_lanes, n_channels), the last observation
    signals: np.ndarray  # (n_lanes, 6)
    statistics: np.ndarray  # (n_lanes, 24)
    surge: Estimate
    later: np.ndarray  # (n_lanes, 1), 0 before the first sample, then 1


class Signatures(NamedTuple):
    """Statistics that faults leave, sorted by class and severity."""

    pattern: np.ndarray  # (n, 24)
    label: np.ndarray  # (n,), index of the class
    log_weight: np.ndarray  # (n,), in its class
    class_starts: np.ndarray  # (n_faults,), first row of every class but normal
    severity_starts: np.ndarray  # (n_faults * 3,), first row of every severity in every class


@dataclass(frozen=True)
class Cusum(ModelBased):
    """Page's two-sided CUSUM on residuals, the speed innovation, and their squared differences.

    A statistic grows by the normalised signal less a drift term: the shift that the healthy band
    can cause at this operating point (parameter by parameter, added) and `SLACK`. The largest
    statistic, relative to `LIMITS`, gives the log odds of a fault: `GAIN` each, 0 at the limit.
    Signatures isolate the class: the statistics that each fault leaves on the nominal vehicle in
    simulation, at three severities, four ages and three missions; their kernel density by class and
    the weighted severity. Limits, slacks and width are calibrated on
    ``training.seeds.seeds("calibration", ...)``.

    Misleads: statistics never forget, so after a repair the belief in a fault stays for as long as
    the fault lasted; a shift within the healthy band is never detected; at rest most signals are
    zero. `seed` is that of the noise in the signatures.
    """

    seed: int = 0

    name = "cusum"

    def __post_init__(self):
        super().__post_init__()
        whole_number("seed", self.seed, 0)

    @cached_property
    def _filter(self) -> SurgeFilter:
        return SurgeFilter(self._nominal)

    def initial(self, n_lanes: int) -> CusumState:
        """The state with all statistics at zero."""
        widths = (len(CHANNELS), len(SIGNALS), len(LIMITS))
        zeros = [np.zeros((n_lanes, width)) for width in widths]
        return CusumState(*zeros, self._filter.initial(n_lanes), np.zeros((n_lanes, 1)))

    def step(self, state: CusumState, observation: np.ndarray) -> tuple[CusumState, Belief]:
        """The next state, and the belief by its statistics."""
        state = self._next_state(state, observation)
        blocks = np.split(state.statistics, range(LANES_IN_CACHE, len(observation), LANES_IN_CACHE))
        beliefs = map(self._belief, blocks)
        return state, Belief(*map(np.concatenate, zip(*beliefs, strict=True)))

    def _next_state(self, state: CusumState, observation: np.ndarray) -> CusumState:
        surge = self._filter.update(state.surge, observation)
        previous = np.where(state.later > 0.0, state.previous, observation)
        signals, drift = self._signals(previous, observation, surge)
        scatter = 0.5 * (signals - state.signals) ** 2
        scatter_up = scatter - 1.0 - SCATTER_UP_SLACK
        scatter_down = 1.0 - scatter - SCATTER_DOWN_SLACK
        # the signals of a standing shaft are zero without a fault
        scatter_down = np.where(signals == 0.0, 0.0, scatter_down)
        growth = np.hstack([signals - drift, -signals - drift, scatter_up, scatter_down])
        statistics = np.maximum(state.statistics + growth, 0.0) * state.later
        return CusumState(observation, signals, statistics, surge, np.ones_like(state.later))

    def _signals(self, previous: np.ndarray, observation: np.ndarray, surge: Estimate) -> Arrays:
        """Normalised signals and their drift terms, each (n_lanes, 6)."""
        values, std = residuals(previous, observation, self._nominal)
        band = healthy_band(previous, observation, self._nominal)
        band[:, RESIDUALS.index("surge")] += DISTURBANCE_SLACK * self._nominal.disturbance_std
        innovation = surge.innovation / np.sqrt(surge.innovation_variance)
        drift = np.column_stack([band / std, np.full(len(std), SLACK)])
        return np.column_stack([values / std, innovation]), drift + SLACK

    def _belief(self, statistics: np.ndarray) -> Belief:
        relative = statistics / LIMITS
        excess = relative.max(axis=1, keepdims=True) - 1.0
        log_odds = np.minimum(GAIN * excess, LARGEST_LOG_ODDS)
        log_density, mean, std = self._by_signatures(np.log1p(relative))
        scores = log_density - log_density.max(axis=1, keepdims=True)
        with_normal = ((0, 0), (1, 0))
        severity = np.pad(np.minimum(mean, 1.0), with_normal)
        log_probability = join_odds(log_odds, scores)
        known = Belief(log_probability, severity, np.pad(std, with_normal))
        return with_impossible_unknown(known)

    def _by_signatures(self, pattern: np.ndarray) -> Arrays:
        """Log density of patterns, severity mean and std by fault, (n_lanes, n_faults) each."""
        signatures = self._signatures
        kernel = cdist(pattern, signatures.pattern, "sqeuclidean")
        kernel *= -0.5 / WIDTH**2
        kernel += signatures.log_weight
        nearest = np.maximum.reduceat(kernel, signatures.class_starts, axis=1)
        kernel -= nearest[:, signatures.label - 1]
        np.exp(kernel, out=kernel)
        of_severity = np.add.reduceat(kernel, signatures.severity_starts, axis=1)
        of_severity = of_severity.reshape(len(pattern), -1, len(SEVERITIES))
        moments = of_severity @ np.vander(SEVERITIES, 3, increasing=True)
        total, first, second = np.moveaxis(moments, 2, 0)
        mean = first / total
        variance = np.maximum(second / total - mean**2, 0.0)
        return nearest + np.log(total), mean, np.sqrt(variance + SEVERITY_STD**2)

    @cached_property
    def _signatures(self) -> Signatures:
        """The signatures of every fault of the catalogue, simulated on the nominal vehicle."""
        faults = [fault for fault in CATALOGUE.values() if fault.diagnosis in self.classes]
        cases = list(product(faults, SEVERITIES, MISSIONS))
        patterns = np.concatenate(self._patterns(cases))
        groups = [
            self.classes.index(fault.diagnosis) * len(SEVERITIES) + SEVERITIES.index(severity)
            for fault, severity, _ in cases
        ]
        group = np.array(groups * len(AGES))
        order = np.argsort(group, kind="stable")
        label = group[order] // len(SEVERITIES)
        log_weight = -np.log(np.bincount(label)[label])
        starts = [np.unique(key, return_index=True)[1] for key in (label, group[order])]
        return Signatures(patterns[order], label, log_weight, *starts)

    def _patterns(self, cases: Sequence[tuple[Fault, float, Any]]) -> list[np.ndarray]:
        """Patterns (n_cases, 24) of cases of fault, severity and mission, at each age."""
        fleet = Fleet(len(cases), self._nominal, healthy_band=0.0, parallel=False)
        schedules = [(FaultEvent(fault.name, ONSET, severity),) for fault, severity, _ in cases]
        missions = [mission for _, _, mission in cases]
        instants = [int(SAMPLE_RATE * (ONSET + age)) for age in AGES]
        observation = fleet.reset([self.seed] * len(cases), schedules=schedules, missions=missions)
        state = self.initial(len(cases))
        patterns = []
        for k in range(instants[-1] + 1):
            state = self._next_state(state, observation.astype(np.float64))
            if k in instants:
                patterns.append(np.log1p(state.statistics / LIMITS))
            observation = fleet.step(follow_mission(observation))
        return patterns
