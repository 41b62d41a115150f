"""A trial: one diagnoser under one stimulus on some lanes of a suite, simulated and diagnosed sample by sample.

Trials depend on nothing but what they are made from, so any process on any machine runs them, in
any order.
"""

import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS
from auv_fault_env.fleet import Fleet
from auv_fault_env.noise import uniforms
from auv_fault_env.schedules import PROFILE, events_of
from diagnosers import Diagnoser
from training.benchmark.suites import (
    INSTANTS,
    LAST_STAND_IN_ONSET,
    STAND_IN_ONSET,
    Conditions,
    Episode,
    keys,
)
from training.benchmark.validation import (
    N_RANDOM,
    SEVERITY_AT,
    TOLD_ON_HEALTHY,
    Contestant,
    started,
)
from training.metrics import sample_at
from training.metrics.records import HealthyOutcome, Record, Recorder, Truth, healthy_outcome
from training.rollouts import label_and_severity
from training.stimuli import Stimulus

FAULTY, THRESHOLD, COUNTING = PARTS = ("faulty", "threshold", "counting")
LANES_PER_TRIAL = 256  # lanes of a trial: the fewest at which most diagnosers are at their quickest
# alarms of the lanes of a threshold trial that are kept: no threshold of a benchmark allows as many
MOST_ALARMS_KEPT = 1000
MISSION_SPEED = list(CHANNELS).index("mission_speed")
FIRST_STAND_IN_ONSET = 5.0  # s, earliest instant that stands for an onset on healthy lanes


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
    """What is so on some lanes: the truth at the instants (n_instants, n_lanes), and the label over time.

    full_severity (n_lanes,), as the oracle is told it; label (n_samples, n_lanes).
    """

    at_instants: Truth
    instants: np.ndarray
    full_severity: np.ndarray
    label: np.ndarray


class FaultyOutcome(NamedTuple):
    """What faulty lanes leave behind.

    The belief as in `Record`; and what the mission paid, (n_lanes,): energy [J], and the root mean
    square of the true speed's deviation from the mission's [m/s].
    """

    log_normal: np.ndarray
    fault: np.ndarray
    log_probability: np.ndarray
    severity_mean: np.ndarray
    severity_std: np.ndarray
    energy: np.ndarray
    speed_rms: np.ndarray

    @property
    def record(self) -> Record:
        """The belief."""
        return Record(*self[: len(Record._fields)])


def lane_truth(conditions: Conditions, episodes: Sequence[Episode]) -> LaneTruth:
    """The truth of these lanes: of several faults the worst is the one to be found, from the first one's onset on."""
    events = events_of([episode.schedule for episode in episodes])
    lanes = np.arange(len(episodes))
    key = keys([episode.seed for episode in episodes])
    label, severity = label_and_severity(events, conditions.n_samples)
    first = events.profile[:, :, PROFILE.index("onset")].min(axis=1, initial=np.inf)
    calm_onset = (
        FIRST_STAND_IN_ONSET
        + (LAST_STAND_IN_ONSET - FIRST_STAND_IN_ONSET) * uniforms(key, STAND_IN_ONSET, 1)[:, 0]
    )
    onset = np.where(np.isfinite(first), first, calm_onset)
    random = (uniforms(key, INSTANTS, N_RANDOM).T * conditions.n_samples).astype(np.int64)
    instants = np.vstack([sample_at(onset + SEVERITY_AT), random])
    worst = severity.max(axis=0)
    truth = Truth(
        label[severity.argmax(axis=0), lanes],
        onset,
        label[instants, lanes],
        severity[instants, lanes],
    )
    return LaneTruth(truth, instants, np.where(worst > 0.0, worst, TOLD_ON_HEALTHY), label)


def run_trial(trial: Trial) -> FaultyOutcome | HealthyOutcome:
    """Run a trial and keep what scores are made from; whatever its diagnoser raises, `ValueError` for a bad belief."""
    _, record, energy, speed_rms = simulate_trial(trial)
    if trial.part == FAULTY:
        return FaultyOutcome(*record, energy, speed_rms)
    onset = lane_truth(trial.conditions, trial.episodes).at_instants.onset
    return healthy_outcome(record, onset, MOST_ALARMS_KEPT if trial.part == THRESHOLD else None)


def simulate_trial(trial: Trial) -> tuple[np.ndarray, Record, np.ndarray, np.ndarray]:
    """Observations (n_samples, n_lanes, n_channels), what was believed; energy and speed deviation as in `FaultyOutcome`."""
    conditions = trial.conditions
    truth = lane_truth(trial.conditions, trial.episodes)
    fleet = Fleet(len(trial.episodes), parallel=False, **conditions.plant)
    seeds, schedules, missions = zip(*trial.episodes, strict=True)
    observation = fleet.reset(seeds, schedules=schedules, missions=missions)
    diagnoser = started(
        Contestant(trial.entrant.make()), fleet.plan.healthy.copy(), truth.full_severity
    )
    _use_one_thread()
    recorder = Recorder(diagnoser.classes, conditions.n_samples, truth.instants)
    stimulus = replace(trial.stimulus)  # one of its own, for it may remember the episode
    deflections = conditions.deflections(seeds)
    spent = np.zeros_like(fleet.outcomes)
    observations = np.empty((conditions.n_samples, *observation.shape), np.float32)
    for k in range(conditions.n_samples):
        observations[k] = observation
        # it must not steer by what it is given
        belief = recorder.note(k, diagnoser.update(observation.copy()))
        speed = observation[:, MISSION_SPEED] + stimulus.offset(k, observation, belief)
        observation = fleet.step(np.column_stack([speed, deflections[k]]))
        spent += fleet.outcomes
    _, energy, cost, _ = spent
    return observations, recorder.record, energy, np.sqrt(cost / conditions.n_samples)


def _use_one_thread() -> None:
    """Keep torch, where a diagnoser has loaded it, to one thread: trials run side by side, and sums stay the same."""
    if "torch" in sys.modules:
        sys.modules["torch"].set_num_threads(1)
