"""A trial: one diagnoser under one stimulus on some lanes of a suite, sample by sample.

A trial depends only on what it is made from, so any process on any machine runs it, in any order.
"""

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from auv_fault_env.faults import CATALOGUE
from auv_fault_env.fleet import Fleet
from auv_fault_env.noise import STREAMS, uniforms
from auv_fault_env.parameters import SAMPLE_TIME
from auv_fault_env.schedules import Schedule, events_of, first_onset
from auv_fault_env.truth import FleetTruth
from auv_fault_env.unmodelled import plant_fault
from diagnosers import Belief, Diagnoser
from training.benchmark.suites import (
    AFTER_STAND_IN_ONSET,
    Conditions,
    Episode,
    noise_keys,
)
from training.metrics import naming, sample_at
from training.metrics.records import (
    SEVERITY_AT,
    HealthyOutcome,
    Record,
    Recorder,
    Truth,
    healthy_outcome,
    ordered_belief,
)
from training.rollouts import label_and_severity
from training.stimuli import Stimulus
from training.stimuli.base import MISSION_SPEED, with_shift

FAULTY = "faulty"
THRESHOLD = "threshold"
COUNTING = "counting"
PARTS = (FAULTY, THRESHOLD, COUNTING)
LANES_PER_TRIAL = 256  # the fewest at which most diagnosers are at their quickest
# alarms of the lanes of a threshold trial that are recorded: no benchmark allows as many
MOST_ALARMS = 1000
FIRST_STAND_IN_ONSET = 5.0  # s, earliest instant that stands for an onset on healthy lanes
N_RANDOM = 4  # instants of an episode, anywhere in it, at which calibration is judged
DEFLECTION_SAMPLES = 1000  # that are computed together
SEVERITY_IF_HEALTHY = 0.6  # severity that the oracle knows where there is no fault


class Entrant(NamedTuple):
    """A diagnoser of the benchmark: its name, and what makes one, in any process."""

    name: str
    make: Callable[[], Diagnoser]


class Trial(NamedTuple):
    """What is to be run; `part` is one of `PARTS`."""

    entrant: Entrant
    stimulus: Stimulus
    part: str
    conditions: Conditions
    episodes: Sequence[Episode]


class LaneTruth(NamedTuple):
    """What is true of some lanes."""

    at_instants: Truth
    instants: np.ndarray  # (n_instants, n_lanes) samples at which whole beliefs are judged
    full_severity: np.ndarray  # (n_lanes,) greatest severity
    # (n_samples, n_lanes) that of the moment as the oracle knows it, `full_severity` without fault
    severity: np.ndarray
    label: np.ndarray  # (n_samples, n_lanes) class
    abrupt: np.ndarray  # (n_lanes,) whether all of its faults come at once
    right_classes: np.ndarray  # (n_lanes, n_classes) right names for the lane's faults
    explained: np.ndarray  # (n_lanes,) whether one fault of the catalogue explains the readings


class LoopSample(NamedTuple):
    """One sample of a closed loop; shapes (n_lanes,) unless another is named."""

    observation: np.ndarray  # (n_lanes, n_channels)
    belief: Belief  # after this observation, classes in the order of `classes()`
    mission_speed: np.ndarray  # m/s
    offset: np.ndarray  # m/s
    true_speed: np.ndarray  # m/s
    energy: np.ndarray  # J in the step that follows
    squared_deviation: np.ndarray  # of its true speed from the mission's [m²/s²]


class TrialHistory(NamedTuple):
    """What happened in a trial."""

    observations: np.ndarray  # (n_samples, n_lanes, n_channels)
    record: Record
    energy: np.ndarray  # as in `FaultyOutcome`
    speed_rms: np.ndarray


class FaultyOutcome(NamedTuple):
    """What scores need of faulty lanes: the belief as in `Record`, and what the mission paid."""

    log_normal: np.ndarray
    fault: np.ndarray
    log_fault: np.ndarray
    log_probability: np.ndarray
    severity_mean: np.ndarray
    severity_std: np.ndarray
    energy: np.ndarray  # (n_lanes,) [J]
    speed_rms: np.ndarray  # (n_lanes,) RMS deviation of the true speed from the mission's [m/s]

    @property
    def record(self) -> Record:
        """What the diagnoser believed."""
        return Record(*self[: len(Record._fields)])


def lane_truth(conditions: Conditions, episodes: Sequence[Episode]) -> LaneTruth:
    """The truth of these lanes: of several faults the worst counts, from the onset of the first."""
    lengths = conditions.lengths(episodes)
    schedules = [episode.schedule for episode in episodes]
    events = events_of(schedules)
    lanes = np.arange(len(episodes))
    key = noise_keys([episode.seed for episode in episodes])
    label, severity = label_and_severity(events, int(lengths.max()))
    onset = first_onset(events)
    width = lengths * SAMPLE_TIME - AFTER_STAND_IN_ONSET - FIRST_STAND_IN_ONSET
    stand_in = FIRST_STAND_IN_ONSET + width * uniforms(key, STREAMS["stand_in_onset"], 1)[:, 0]
    onset = np.where(np.isfinite(onset), onset, stand_in)
    fraction = uniforms(key, STREAMS["random_instants"], N_RANDOM).T
    random = (fraction * lengths).astype(np.int64)
    instants = np.vstack([sample_at(onset + SEVERITY_AT), random])
    worst = severity.max(axis=0)
    at_instants = Truth(
        fault=label[severity.argmax(axis=0), lanes],
        onset=onset,
        label=label[instants, lanes],
        severity=severity[instants, lanes],
    )
    full_severity = np.where(worst > 0.0, worst, SEVERITY_IF_HEALTHY)
    of_moment = np.where(severity > 0.0, severity, full_severity).astype(np.float32)
    abrupt = np.array([_is_abrupt(schedule) for schedule in schedules])
    explained = np.array([_is_explained(schedule) for schedule in schedules])
    components = [{plant_fault(event.fault).component for event in one} for one in schedules]
    right_classes = naming.right_classes(at_instants.fault, components, explained)
    return LaneTruth(
        at_instants=at_instants,
        instants=instants,
        full_severity=full_severity,
        severity=of_moment,
        label=label,
        abrupt=abrupt,
        right_classes=right_classes,
        explained=explained,
    )


def _is_abrupt(schedule: Schedule) -> bool:
    return all(event.ramp == 0.0 for event in schedule)


def _is_explained(schedule: Schedule) -> bool:
    return len(schedule) < 2 and all(event.fault in CATALOGUE for event in schedule)


def run_closed_loop(
    diagnoser: Diagnoser,
    stimulus: Stimulus,
    conditions: Conditions,
    episodes: Sequence[Episode],
) -> Iterator[LoopSample]:
    """Simulate the episodes with diagnoser and stimulus in the loop, and yield every sample.

    A diagnoser with a method `set_truth` receives the vehicles and severities at the start. Raises
    `ValueError` if it returns no belief; what the diagnoser raises passes through.
    """
    n_lanes = len(episodes)
    seeds, schedules, missions, _ = zip(*episodes, strict=True)
    fleet = Fleet(n_lanes, parallel=False, **conditions.plant)
    observation = fleet.reset(seeds, schedules=schedules, missions=missions)
    diagnoser.reset(n_lanes)
    if hasattr(diagnoser, "set_truth"):
        severity = lane_truth(conditions, episodes).severity
        diagnoser.set_truth(fleet.plan.healthy.copy(), severity)
    if "torch" in sys.modules:
        # one thread: trials run in parallel, and sums stay equal
        sys.modules["torch"].set_num_threads(1)
    stimulus = replace(stimulus)  # a copy, for it may remember the episode
    for k in range(conditions.lengths(episodes).max()):
        if k % DEFLECTION_SAMPLES == 0:
            deflections = conditions.deflections(seeds, np.arange(k, k + DEFLECTION_SAMPLES))
        # a copy, so that a diagnoser cannot change what the stimulus reads
        update = diagnoser.update(observation.copy())
        belief = ordered_belief(update, diagnoser.classes, n_lanes, k)
        mission_speed = observation[:, MISSION_SPEED].astype(np.float64)
        # a vehicle that is to rest is not disturbed
        offset = np.where(mission_speed > 0.0, stimulus.offset(k, observation, belief), 0.0)
        true_speed = FleetTruth(fleet)["state"]["speed"]
        command = np.column_stack([mission_speed + offset, deflections[k % DEFLECTION_SAMPLES]])
        shift = stimulus.thrust_shift(k, observation, belief)
        next_observation = fleet.step(with_shift(command, shift))
        _, energy, squared_deviation, _ = fleet.outcomes
        yield LoopSample(
            observation,
            belief,
            mission_speed,
            offset,
            true_speed,
            energy,
            squared_deviation,
        )
        observation = next_observation


def simulate_trial(trial: Trial) -> TrialHistory:
    """Run a trial and keep the observations; raises what `run_closed_loop` raises."""
    observations: list[np.ndarray] = []
    outcome, _ = _followed(trial, observations.append)
    return TrialHistory(np.array(observations, np.float32), *outcome)


def run_trial(trial: Trial) -> FaultyOutcome | HealthyOutcome:
    """Run a trial and return what scores need of it; raises what `run_closed_loop` raises."""
    (record, energy, speed_rms), truth = _followed(trial, lambda observation: None)
    if trial.part == FAULTY:
        return FaultyOutcome(*record, energy, speed_rms)
    most_alarms = MOST_ALARMS if trial.part == THRESHOLD else None
    return healthy_outcome(record, truth.at_instants.onset, most_alarms)


def _followed(
    trial: Trial, keep: Callable[[np.ndarray], None]
) -> tuple[tuple[Record, np.ndarray, np.ndarray], LaneTruth]:
    """Record, energy and RMS speed deviation of a trial, and its truth; keeps the observations."""
    lengths = trial.conditions.lengths(trial.episodes)
    truth = lane_truth(trial.conditions, trial.episodes)
    recorder = Recorder(lengths, truth.instants)
    energy = np.zeros(len(trial.episodes))
    squared_deviation = np.zeros(len(trial.episodes))
    loop = run_closed_loop(trial.entrant.make(), trial.stimulus, trial.conditions, trial.episodes)
    for k, sample in enumerate(loop):
        recorder.add(k, sample.belief)
        keep(sample.observation)
        lasts = k < lengths
        energy += np.where(lasts, sample.energy, 0.0)
        squared_deviation += np.where(lasts, sample.squared_deviation, 0.0)
    speed_rms = np.sqrt(squared_deviation / lengths)
    return (recorder.record, energy, speed_rms), truth
