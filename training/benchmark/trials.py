"""A trial: one diagnoser under one stimulus on some lanes of a suite, sample by sample.

A trial depends only on what it is made from, so any process on any machine runs it, in any order.
"""

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from auv_fault_env.fleet import Fleet
from auv_fault_env.noise import STREAMS, uniforms
from auv_fault_env.schedules import events_of, first_onset
from auv_fault_env.truth import FleetTruth
from diagnosers import Belief, Diagnoser
from training.benchmark.suites import (
    LAST_STAND_IN_ONSET,
    Conditions,
    Episode,
    noise_keys,
)
from training.metrics import sample_at
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
from training.stimuli.base import MISSION_SPEED

FAULTY, THRESHOLD, COUNTING = PARTS = ("faulty", "threshold", "counting")
LANES_PER_TRIAL = 256  # the fewest at which most diagnosers are at their quickest
# alarms of the lanes of a threshold trial that are recorded: no benchmark allows as many
MOST_ALARMS = 1000
FIRST_STAND_IN_ONSET = 5.0  # s, earliest instant that stands for an onset on healthy lanes
N_RANDOM = 4  # instants of an episode, anywhere in it, at which calibration is judged
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
    full_severity: np.ndarray  # (n_lanes,) greatest severity, as the oracle knows it
    label: np.ndarray  # (n_samples, n_lanes) class


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
    n_samples = conditions.n_samples
    events = events_of([episode.schedule for episode in episodes])
    lanes = np.arange(len(episodes))
    key = noise_keys([episode.seed for episode in episodes])
    label, severity = label_and_severity(events, n_samples)
    onset = first_onset(events)
    width = LAST_STAND_IN_ONSET - FIRST_STAND_IN_ONSET
    stand_in = FIRST_STAND_IN_ONSET + width * uniforms(key, STREAMS["stand_in_onset"], 1)[:, 0]
    onset = np.where(np.isfinite(onset), onset, stand_in)
    fraction = uniforms(key, STREAMS["random_instants"], N_RANDOM).T
    random = (fraction * n_samples).astype(np.int64)
    instants = np.vstack([sample_at(onset + SEVERITY_AT), random])
    worst = severity.max(axis=0)
    at_instants = Truth(
        fault=label[severity.argmax(axis=0), lanes],
        onset=onset,
        label=label[instants, lanes],
        severity=severity[instants, lanes],
    )
    full_severity = np.where(worst > 0.0, worst, SEVERITY_IF_HEALTHY)
    return LaneTruth(at_instants, instants, full_severity, label)


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
    seeds, schedules, missions = zip(*episodes, strict=True)
    fleet = Fleet(n_lanes, parallel=False, **conditions.plant)
    observation = fleet.reset(seeds, schedules=schedules, missions=missions)
    diagnoser.reset(n_lanes)
    if hasattr(diagnoser, "set_truth"):
        full_severity = lane_truth(conditions, episodes).full_severity
        diagnoser.set_truth(fleet.plan.healthy.copy(), full_severity)
    if "torch" in sys.modules:
        # one thread: trials run in parallel, and sums stay equal
        sys.modules["torch"].set_num_threads(1)
    stimulus = replace(stimulus)  # a copy, for it may remember the episode
    deflections = conditions.deflections(seeds)
    for k in range(conditions.n_samples):
        # a copy, so that a diagnoser cannot change what the stimulus reads
        update = diagnoser.update(observation.copy())
        belief = ordered_belief(update, diagnoser.classes, n_lanes, k)
        mission_speed = observation[:, MISSION_SPEED].astype(np.float64)
        offset = stimulus.offset(k, observation, belief)
        true_speed = FleetTruth(fleet)["state"]["speed"]
        command = np.column_stack([mission_speed + offset, deflections[k]])
        next_observation = fleet.step(command)
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
    """Run a trial; raises what `run_closed_loop` raises."""
    n_samples = trial.conditions.n_samples
    truth = lane_truth(trial.conditions, trial.episodes)
    recorder = Recorder(n_samples, truth.instants)
    energy = np.zeros(len(trial.episodes))
    squared_deviation = np.zeros(len(trial.episodes))
    observations = []
    loop = run_closed_loop(trial.entrant.make(), trial.stimulus, trial.conditions, trial.episodes)
    for k, sample in enumerate(loop):
        recorder.add(k, sample.belief)
        observations.append(sample.observation)
        energy += sample.energy
        squared_deviation += sample.squared_deviation
    speed_rms = np.sqrt(squared_deviation / n_samples)
    return TrialHistory(np.array(observations, np.float32), recorder.record, energy, speed_rms)


def run_trial(trial: Trial) -> FaultyOutcome | HealthyOutcome:
    """Run a trial and return what scores need of it; raises what `run_closed_loop` raises."""
    history = simulate_trial(trial)
    if trial.part == FAULTY:
        return FaultyOutcome(*history.record, history.energy, history.speed_rms)
    onset = lane_truth(trial.conditions, trial.episodes).at_instants.onset
    most_alarms = MOST_ALARMS if trial.part == THRESHOLD else None
    return healthy_outcome(history.record, onset, most_alarms)
