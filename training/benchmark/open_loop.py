"""Episodes whose commands do not depend on beliefs: simulated once for several diagnosers.

Half of the lanes run the thesis' stimulus, half random missions with random manoeuvres. A faulty
lane has one permanent fault, every class equally likely.
"""

import math
from typing import NamedTuple

import numpy as np

from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS
from auv_fault_env.parameters import SAMPLE_TIME, Vehicle
from auv_fault_env.schedules import ScheduleSampler
from diagnosers import Diagnoser
from training.benchmark.assessment import Assessment, assess
from training.benchmark.scores import RANKED_AT, thresholds
from training.benchmark.suites import ONE_FAULT
from training.benchmark.trials import N_RANDOM
from training.metrics import sample_at
from training.metrics.records import (
    SEVERITY_AT,
    Record,
    Recorder,
    Truth,
    concatenate_lanes,
    healthy_outcome,
    ordered_belief,
)
from training.rollouts import manoeuvres, roll_out

N_SAMPLES = 650  # 65 s: 30 s after the last onset always exist


class OpenLoopEpisodes(NamedTuple):
    """Episodes of some lanes."""

    observations: np.ndarray  # (n_samples, n_lanes, n_channels)
    truth: Truth
    instants: np.ndarray  # (n_instants, n_lanes) samples at which whole beliefs are judged


Halves = tuple[OpenLoopEpisodes, OpenLoopEpisodes]


class OpenLoopSample(NamedTuple):
    """Faulty episodes, and healthy ones that set the threshold and that count false alarms."""

    faulty: Halves
    threshold: Halves
    counting: Halves


def lanes_of(hours: float) -> int:
    """How many healthy lanes have so many hours of operation together."""
    return math.ceil(hours * 3600.0 / (N_SAMPLES * SAMPLE_TIME))


def both_halves(
    seeds: range,
    faulty: bool,
    vehicle: str | Vehicle = "thesis1992",
    healthy_band: float = 1.0,
    faults: ScheduleSampler = ONE_FAULT,
    realism: float = 0.0,
) -> Halves:
    """The lanes with the thesis' stimulus, and those with random missions and manoeuvres.

    Vehicles are sampled from so many times the healthy band around `vehicle`, one per seed.
    """
    n_first = -(-len(seeds) // 2)

    def fleet(n_lanes: int) -> Fleet:
        return Fleet(n_lanes, vehicle, healthy_band=healthy_band, schedules=faults, realism=realism)

    first = _episodes(seeds[:n_first], True, faulty, fleet(n_first))
    return first, _episodes(seeds[n_first:], False, faulty, fleet(len(seeds) - n_first))


def _episodes(seeds: range, thesis_stimulus: bool, faulty: bool, fleet: Fleet) -> OpenLoopEpisodes:
    n_lanes = len(seeds)
    schedules = None if faulty else [()] * n_lanes
    if thesis_stimulus:
        missions = [MISSIONS["thesis"]] * n_lanes
        rollout = roll_out(fleet, seeds, N_SAMPLES, schedules=schedules, missions=missions)
    else:
        actions = manoeuvres(seeds.start, N_SAMPLES, n_lanes)
        rollout = roll_out(fleet, seeds, N_SAMPLES, actions, schedules)
    # another stream than that of the manoeuvres
    random = np.random.default_rng([seeds.start, 1])
    stand_in_onset = random.uniform(*ONE_FAULT.onset, n_lanes)
    onset = np.where(np.isfinite(rollout.onset), rollout.onset, stand_in_onset)
    random_instants = random.integers(0, N_SAMPLES, (N_RANDOM, n_lanes))
    instants = np.vstack([sample_at(onset + SEVERITY_AT), random_instants])
    at_instants = instants, np.arange(n_lanes)
    truth = Truth(
        fault=rollout.label.max(axis=0),
        onset=onset,
        label=rollout.label[at_instants],
        severity=rollout.severity[at_instants],
    )
    return OpenLoopEpisodes(rollout.observations, truth, instants)


def believed(diagnoser: Diagnoser, halves: Halves) -> Record:
    """What a diagnoser believes along the episodes; `ValueError` if it returns no belief."""
    records = []
    for episodes in halves:
        n_samples, n_lanes, _ = episodes.observations.shape
        diagnoser.reset(n_lanes)
        recorder = Recorder(n_samples, episodes.instants)
        for k, observation in enumerate(episodes.observations):
            belief = diagnoser.update(observation)
            recorder.add(k, ordered_belief(belief, diagnoser.classes, n_lanes, k))
        records.append(recorder.record)
    return concatenate_lanes(records)


def true_of(halves: Halves) -> Truth:
    """The truth of both halves as one."""
    return concatenate_lanes([episodes.truth for episodes in halves])


def assessed(diagnoser: Diagnoser, sample: OpenLoopSample) -> Assessment:
    """What a diagnoser does on the sample at the threshold for one false alarm per hour."""
    healthy = {}
    for part in ("threshold", "counting"):
        halves = getattr(sample, part)
        healthy[part] = healthy_outcome(believed(diagnoser, halves), true_of(halves).onset)
    threshold = thresholds(healthy["threshold"])[RANKED_AT]
    faulty = believed(diagnoser, sample.faulty)
    return assess(threshold, faulty, true_of(sample.faulty), healthy["counting"])
