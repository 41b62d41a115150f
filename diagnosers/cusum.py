"""Two-sided CUSUM (Page 1954) on the physical residuals; the class by the pattern of the statistics.

Source: Page, "Continuous inspection schemes", Biometrika 41, 1954; as charts of residuals:
Basseville & Nikiforov, "Detection of Abrupt Changes", Prentice Hall 1993.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.spatial.distance import cdist

from auv_fault_env.channels import CHANNELS
from auv_fault_env.errors import whole_number
from auv_fault_env.faults import CATALOGUE
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import follow_mission
from auv_fault_env.parameters import SAMPLE_RATE, Vehicle, vehicle_of
from auv_fault_env.schedules import FaultEvent
from diagnosers.diagnoser import Belief, Recursive
from diagnosers.kalman import Estimate, SurgeFilter
from diagnosers.symptoms.residuals import RESIDUALS, healthy_band, residuals

SIGNALS = (*RESIDUALS, "innovation")
# of each signal: mean up, mean down, scatter up, scatter down
CHARTS = ("above", "below", "rough", "smooth")
SLACK = 0.25  # standard deviations, of the drift term beyond the healthy band
# the same, relative, of the squared differences
ROUGH_SLACK = 1.5
SMOOTH_SLACK = 0.75
DISTURBED = 0.6  # standard deviations of the disturbance in the drift term
# of the charts of a signal (mean, rough, smooth): what healthy vehicles reach about once an hour
LIMIT = {
    "voltage": (12.0, 31.0, 2.8),
    "torque": (9.0, 31.0, 4.2),
    "surge": (57.0, 31.0, 2.9),
    "innovation": (8.7, 31.0, 2.6),
}
MEAN, ROUGH, SMOOTH = np.array([LIMIT[name.split("_")[-1]] for name in SIGNALS]).T
LIMITS = np.concatenate([MEAN, MEAN, ROUGH, SMOOTH])
GAIN = 4.0  # log odds of a fault per limit
DEEPEST = 100.0  # largest log odds of a fault
MISSIONS = ("thesis", 0.2, 0.45)  # of the signatures: a name or a speed [m/s]
# s, of the faults of the signatures, and how old they are
ONSET = 5.0
AGES = (2.0, 6.0, 14.0, 24.0)
SEVERITIES = (0.3, 0.6, 1.0)
WIDTH = 0.5  # of a signature, in logarithms of statistics
IN_CACHE = 32  # lanes whose distances to all signatures a processor's cache holds
SEVERITY_STD = 0.15  # half the distance between the severities of the signatures


class CusumState(NamedTuple):
    """Lane first: last observation and signals (6), statistics (24), filter; 0 before the first sample, then 1."""

    previous: np.ndarray
    signals: np.ndarray
    charts: np.ndarray
    surge: Estimate
    begun: np.ndarray


class Signatures(NamedTuple):
    """Statistics that faults leave, sorted by class and severity.

    pattern (n, 24), class index (n,), log weight (n,) in its class; starts (n_classes - 1,): first
    row of every class but normal; grades ((n_classes - 1) * 3,): first row of every severity in
    every class.
    """

    pattern: np.ndarray
    label: np.ndarray
    weight: np.ndarray
    starts: np.ndarray
    grades: np.ndarray


@dataclass(frozen=True)
class Cusum(Recursive):
    """Page's CUSUM, two-sided, on every residual and the speed filter's innovation; and on their squared differences.

    A statistic grows by the normalised signal less a drift term: the shift that the healthy band
    can cause at this operating point (parameter by parameter, added) and `SLACK`. Squared
    differences catch noise and held readings. The largest statistic, relative to `LIMITS`, gives
    the log odds of a fault: `GAIN` each, 0 at the limit. A class is named by its signatures: the
    statistics that each fault of the catalogue leaves on the nominal vehicle in simulation, at
    three severities, ages and missions; their kernel density by class and the weighted severity.
    Limits, slacks and width are calibrated on ``training.seeds.seeds("calibration", ...)``.

    Misleads: statistics never forget, so a fault that is repaired stays for as long as it lasted; a
    shift within the healthy band is never found; at rest most signals are silent.
    """

    vehicle: str | Vehicle = "thesis1992"
    seed: int = 0  # of the signatures' noise

    name = "cusum"

    def __post_init__(self):
        vehicle_of(self.vehicle)
        whole_number("seed", self.seed, 0)

    @cached_property
    def _nominal(self) -> Vehicle:
        return vehicle_of(self.vehicle)

    @cached_property
    def _filter(self) -> SurgeFilter:
        return SurgeFilter(self._nominal)

    def initial(self, n_lanes: int) -> CusumState:
        """All statistics at zero."""
        charts = np.zeros((n_lanes, len(CHARTS) * len(SIGNALS)))
        previous = np.zeros((n_lanes, len(CHANNELS)))
        signals = np.zeros((n_lanes, len(SIGNALS)))
        return CusumState(
            previous, signals, charts, self._filter.initial(n_lanes), np.zeros((n_lanes, 1))
        )

    def step(self, state: CusumState, observation: np.ndarray) -> tuple[CusumState, Belief]:
        """One step of the charts, and what they say."""
        state = self._advance(state, observation)
        shares = range(0, len(observation), IN_CACHE)
        beliefs = [self._belief(state.charts[first : first + IN_CACHE]) for first in shares]
        return state, Belief(*map(np.concatenate, zip(*beliefs, strict=True)))

    def _advance(self, state: CusumState, observation: np.ndarray) -> CusumState:
        surge = self._filter.update(state.surge, observation)
        previous = np.where(state.begun > 0.0, state.previous, observation)
        signals, drift = self._signals(previous, observation, surge)
        scatter = 0.5 * (signals - state.signals) ** 2
        # a standing shaft is not stuck
        smooth = np.where(signals == 0.0, 0.0, 1.0 - scatter - SMOOTH_SLACK)
        steps = np.hstack([signals - drift, -signals - drift, scatter - 1.0 - ROUGH_SLACK, smooth])
        charts = np.maximum(state.charts + steps, 0.0) * state.begun
        return CusumState(observation, signals, charts, surge, np.ones_like(state.begun))

    def _signals(
        self, previous: np.ndarray, observation: np.ndarray, surge: Estimate
    ) -> tuple[np.ndarray, np.ndarray]:
        """Normalised signals (n_lanes, 6) and their drift terms."""
        values, std = residuals(previous, observation, self._nominal)
        band = healthy_band(previous, observation, self._nominal)
        band[:, RESIDUALS.index("surge")] += DISTURBED * self._nominal.disturbance_std
        innovation = surge.innovation / np.sqrt(surge.innovation_variance)
        drift = np.column_stack([band / std, np.full(len(std), SLACK)])
        return np.column_stack([values / std, innovation]), drift + SLACK

    def _belief(self, charts: np.ndarray) -> Belief:
        odds = np.minimum(GAIN * ((charts / LIMITS).max(axis=1, keepdims=True) - 1.0), DEEPEST)
        bank = self._signatures
        pattern = np.log1p(charts / LIMITS)
        share = cdist(pattern, bank.pattern, "sqeuclidean")
        share *= -0.5 / WIDTH**2
        share += bank.weight
        nearest = np.maximum.reduceat(share, bank.starts, axis=1)
        share -= nearest[:, bank.label - 1]
        np.exp(share, out=share)
        by_grade = np.add.reduceat(share, bank.grades, axis=1).reshape(
            len(charts), -1, len(SEVERITIES)
        )
        total, first, second = np.moveaxis(
            by_grade @ np.vander(SEVERITIES, 3, increasing=True), 2, 0
        )
        mean = first / total
        none = np.zeros((len(charts), 1))
        std = np.sqrt(np.maximum(second / total - mean**2, 0.0) + SEVERITY_STD**2)
        fault = nearest + np.log(total)
        fault -= fault.max(axis=1, keepdims=True)
        fault -= np.log(np.exp(fault).sum(axis=1, keepdims=True)) + np.logaddexp(0.0, -odds)
        chances = np.hstack([-np.logaddexp(0.0, odds), fault])
        return Belief(chances, np.hstack([none, np.minimum(mean, 1.0)]), np.hstack([none, std]))

    @cached_property
    def _signatures(self) -> Signatures:
        """Simulate every fault of the catalogue on the nominal vehicle."""
        faults = list(CATALOGUE.values())
        cases = list(product(faults, SEVERITIES, MISSIONS))
        fleet = Fleet(len(cases), self._nominal, healthy_band=0.0, parallel=False)
        schedules = [(FaultEvent(fault.name, ONSET, severity),) for fault, severity, _ in cases]
        missions = [
            mission if isinstance(mission, str) else [(0.0, mission)] for _, _, mission in cases
        ]
        observation = fleet.reset([self.seed] * len(cases), schedules=schedules, missions=missions)
        state = self._advance(self.initial(len(cases)), observation.astype(np.float64))
        patterns = []
        for k in range(1, int(SAMPLE_RATE * (ONSET + AGES[-1])) + 1):
            observation = fleet.step(follow_mission(observation))
            state = self._advance(state, observation.astype(np.float64))
            if k in [int(SAMPLE_RATE * (ONSET + age)) for age in AGES]:
                patterns.append(np.log1p(state.charts / LIMITS))
        label = np.array([self.classes.index(fault.diagnosis) for fault, _, _ in cases] * len(AGES))
        grade = np.array([SEVERITIES.index(severity) for _, severity, _ in cases] * len(AGES))
        order = np.lexsort((grade, label))
        label = label[order]
        grade = grade[order]
        starts = np.unique(label, return_index=True)[1]
        grades = np.unique(label * len(SEVERITIES) + grade, return_index=True)[1]
        return Signatures(
            np.concatenate(patterns)[order],
            label,
            -np.log(np.bincount(label)[label]),
            starts,
            grades,
        )
