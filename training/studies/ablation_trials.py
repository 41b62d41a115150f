"""The lanes that the ablation is scored on: features and truth of the trials of a benchmark."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from auv_fault_env.compiling import digest
from auv_fault_env.faults import NORMAL, classes
from diagnosers import make, storage
from diagnosers.references import Null
from training.benchmark import plan, trial_store
from training.benchmark.assessment import Assessment, assess
from training.benchmark.scores import RANKED_AT, thresholds
from training.benchmark.suites import Suite
from training.benchmark.trials import (
    COUNTING,
    FAULTY,
    PARTS,
    THRESHOLD,
    Entrant,
    Trial,
    lane_truth,
    run_trial,
    simulate_trial,
)
from training.metrics.records import (
    HealthyOutcome,
    Record,
    Truth,
    concatenate_lanes,
    healthy_outcome,
)
from training.stimuli import Stimulus
from training.studies.ablation_inputs import SAMPLES, by_half_seconds, read_features
from training.studies.ablation_network import AblationTraining

BEFORE = 1e-3  # probability of all faults together before the first half second
WITHOUT_DIAGNOSER = Entrant(Null.name, partial(make, Null.name))


class TrialFeatures(NamedTuple):
    """A trial without a diagnoser as features (n_halves, n_lanes, n_features) in a file."""

    part: str
    path: Path
    lengths: np.ndarray  # (n_lanes,) in samples
    instants: np.ndarray  # (n_instants, n_lanes) at which whole beliefs are judged
    truth: Truth


def simulated(cache: Path, trial: Trial) -> TrialFeatures:
    """The features of a trial, from their file or simulated."""
    path = trial_store.path_of(cache, trial, digest(Path(__file__))).with_suffix(".safetensors")
    if not path.exists():
        features = by_half_seconds(simulate_trial(trial).observations)
        storage.write(path, {"features": features}, {})
    truth = lane_truth(trial.conditions, trial.episodes)
    lengths = trial.conditions.lengths(trial.episodes)
    return TrialFeatures(trial.part, path, lengths, truth.instants, truth.at_instants)


def record_of(log_probability: np.ndarray, trial: TrialFeatures) -> Record:
    """The record of beliefs (n_halves, n_lanes, n_classes), each held until the next one.

    They have no severity: it is 0 with standard deviation 1.
    """
    n_lanes = len(trial.lengths)
    names = classes()
    first = np.full((1, n_lanes, len(names)), np.log(BEFORE / (len(names) - 1)), np.float32)
    first[:, :, names.index(NORMAL)] = np.log1p(-BEFORE)
    beliefs = np.concatenate([first, log_probability])
    sample = np.arange(trial.lengths.max())
    half = (sample + 1) // SAMPLES
    faults = beliefs[:, :, 1:]
    log_normal = np.where(sample[:, None] < trial.lengths, beliefs[half, :, 0], np.inf)
    whole = beliefs[half[trial.instants], np.arange(n_lanes)]
    return Record(
        log_normal=log_normal,
        fault=(1 + faults.argmax(axis=-1)).astype(np.int8)[half],
        log_fault=faults.max(axis=-1)[half],
        log_probability=whole,
        severity_mean=np.zeros_like(whole),
        severity_std=np.ones_like(whole),
    )


Outcome = Record | HealthyOutcome


def network_outcomes(training: AblationTraining, trials: Sequence[TrialFeatures]) -> list[Outcome]:
    """What scores need of each trial of a trained network."""
    outcomes: list[Outcome] = []
    for trial in trials:
        features = read_features([trial.path], training.columns)
        record = record_of(training.log_probability(features), trial)
        if trial.part != FAULTY:
            record = healthy_outcome(record, trial.truth.onset)
        outcomes.append(record)
    return outcomes


def diagnoser_outcome(trial: Trial) -> Outcome:
    """The same of a diagnoser of the registry, sample by sample."""
    outcome = run_trial(trial)
    return outcome.record if trial.part == FAULTY else outcome


def assessed(parts: Sequence[str], outcomes: Sequence[Outcome], truth: Truth) -> Assessment:
    """The assessment at one false alarm per hour, from the outcome of every trial and its part."""
    of_part = {
        part: concatenate_lanes(
            [one for own, one in zip(parts, outcomes, strict=True) if own == part]
        )
        for part in PARTS
    }
    threshold = thresholds(of_part[THRESHOLD])[RANKED_AT]
    return assess(threshold, of_part[FAULTY], truth, of_part[COUNTING])


def faulty_truth(trials: Sequence[TrialFeatures]) -> Truth:
    """The truth of the faulty lanes."""
    return concatenate_lanes([trial.truth for trial in trials if trial.part == FAULTY])


def faulty_trials(suite: Suite, stimulus: Stimulus) -> list[Trial]:
    """The trials of the faulty lanes of a suite without a diagnoser."""
    conditions = suite.conditions
    return [
        Trial(WITHOUT_DIAGNOSER, stimulus, FAULTY, conditions, lanes)
        for lanes in plan.chunks(conditions, suite.episodes)
    ]
