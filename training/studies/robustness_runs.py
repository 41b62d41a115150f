"""Runs of one diagnoser: healthy hours, faulty lanes, and given readings."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
from joblib import Parallel, delayed

from auv_fault_env.missions import Mission
from auv_fault_env.schedules import Schedule
from diagnosers import Belief, Diagnoser, make
from training.benchmark import plan, suites
from training.benchmark.scores import thresholds
from training.benchmark.suites import Conditions, Episode
from training.benchmark.trials import (
    COUNTING,
    FAULTY,
    THRESHOLD,
    Entrant,
    LaneTruth,
    Trial,
    lane_truth,
    run_trial,
)
from training.benchmark.whole_missions import WholeMissionSampler
from training.metrics.records import HealthyOutcome, Record, concatenate_lanes
from training.seeds import seeds
from training.stimuli import Cruise, Stimulus, Thesis

FIRST_SEED = 500_000_000  # within those of the purpose
ROW_BLOCK = 4_000_000  # seeds of a row
RUN_BLOCK = 200_000  # of these, seeds of a run of the study
MOST_RUNS = ROW_BLOCK // RUN_BLOCK
FIRST_ROW = 1  # row 0 has the hours of the thresholds


@dataclass(frozen=True)
class EveryOther(Thesis):
    """The thesis' stimulus on every other lane, none on the others."""

    name = "every_other"

    def offset(self, sample: int, observation: np.ndarray, belief: Belief) -> np.ndarray:
        """That of the thesis, or zero."""
        offset = super().offset(sample, observation, belief)
        offset[::2] = 0.0
        return offset


class FaultyLanes(NamedTuple):
    """What a diagnoser believed of faulty lanes, and the truth."""

    record: Record
    truth: LaneTruth


def conditions(whole: WholeMissionSampler | None = None, **plant: Any) -> Conditions:
    """The standard conditions with another plant, healthy lanes with these missions."""
    standard = suites.load(suites.STANDARD).conditions
    whole = whole or standard.whole_missions
    return replace(standard, plant=dict(standard.plant) | plant, whole_missions=whole)


@dataclass(frozen=True)
class Runs:
    """All runs of one diagnoser in one study.

    Attributes
    ----------
    diagnoser
        Name of the registry.
    purpose
        Of the seeds of all but the thresholds, whose seeds are those of calibration.
    hours
        Healthy operation on which the thresholds are set [h].
    workers
        Processes, as joblib has them.
    seed
        Number of the run, up to `MOST_RUNS`.
    """

    diagnoser: str
    purpose: str
    hours: float
    workers: int
    seed: int

    def seeds(self, row: int, count: int, purpose: str | None = None) -> range:
        """Seeds of a row of the study."""
        first = FIRST_SEED + row * ROW_BLOCK + self.seed * RUN_BLOCK
        return seeds(purpose or self.purpose, count, first)

    @cached_property
    def thresholds(self) -> Mapping[str, float]:
        """Thresholds by mean time between false alarms, set on hours of their own."""
        first = self.seeds(0, 1, "calibration")[0]
        return thresholds(self._healthy(conditions(realism=1.0), first, self.hours, THRESHOLD))

    @property
    def thresholds_if_set(self) -> Mapping[str, float]:
        """The thresholds if a row has needed them, else none."""
        return vars(self).get("thresholds", {})

    def healthy(self, of: Conditions, row: int, hours: float) -> HealthyOutcome:
        """Healthy operation under conditions, half of the vehicles with the thesis' stimulus."""
        return self._healthy(of, self.seeds(row, 1)[0], hours, COUNTING)

    def _healthy(self, of: Conditions, first: int, hours: float, part: str) -> HealthyOutcome:
        lanes = plan.enough_lanes(of, first, 3600.0 * hours)
        return self._run(self._trials(of, of.healthy_episodes(lanes), EveryOther(), part))

    def healthy_lanes(self, of: Conditions, episodes: Sequence[Episode]) -> HealthyOutcome:
        """These healthy lanes without a stimulus."""
        return self._run(self._trials(of, episodes, Cruise(), COUNTING))

    def faulty(self, of: Conditions, episodes: Sequence[Episode]) -> FaultyLanes:
        """These faulty lanes under the thesis' stimulus."""
        outcome = self._run(self._trials(of, episodes, Thesis(), FAULTY))
        return FaultyLanes(outcome.record, lane_truth(of, episodes))

    def episodes(
        self, of: Conditions, row: int, schedules: Sequence[Schedule]
    ) -> tuple[Episode, ...]:
        """Lanes with these faults, on missions of the conditions."""
        lanes = self.seeds(row, len(schedules))
        missions = of.sample_missions(lanes)
        return tuple(map(Episode, lanes, schedules, missions))

    def _trials(
        self, of: Conditions, episodes: Sequence[Episode], stimulus: Stimulus, part: str
    ) -> list[Trial]:
        entrant = Entrant(self.diagnoser, partial(make, self.diagnoser))
        chunks = plan.chunks(of, episodes)
        return [Trial(entrant, stimulus, part, of, chunk) for chunk in chunks]

    def _run(self, trials: Sequence[Trial]) -> Any:
        # the longest first, so that no process waits for the last one
        order = sorted(range(len(trials)), key=lambda k: -_samples(trials[k]))
        outcomes = Parallel(n_jobs=self.workers)(delayed(run_trial)(trials[k]) for k in order)
        in_order = sorted(zip(order, outcomes, strict=True), key=lambda pair: pair[0])
        return concatenate_lanes([outcome for _, outcome in in_order])


def _samples(trial: Trial) -> int:
    return int(trial.conditions.lengths(trial.episodes).max())


def constant_lanes(lanes: Sequence[int], speed: float, duration: float) -> list[Episode]:
    """Healthy lanes at one mission speed [m/s] for a duration [s]."""
    return [Episode(seed, (), Mission(((0.0, speed),)), duration) for seed in lanes]


def believed(diagnoser: Diagnoser, observations: Iterable[np.ndarray]) -> np.ndarray:
    """log p(normal) (n_samples, n_lanes) along observations (n_lanes, n_channels)."""
    log_normal = []
    for k, observation in enumerate(observations):
        if k == 0:
            diagnoser.reset(len(observation))
        log_normal.append(diagnoser.update(observation).log_probability[:, 0])
    return np.array(log_normal)
