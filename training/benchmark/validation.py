"""The validation suite: episodes that nothing was trained on, and what every diagnoser believes along them.

Default noise, disturbance and healthy band. Half of the lanes run the thesis' stimulus, half random
missions with random manoeuvres. A faulty lane has one permanent fault, every class equally likely
and every kind within a class, severity 0.2 to 1, onset 5 to 30 s, abrupt or ramped. Healthy lanes
come twice: to set the thresholds, and to count false alarms.
"""

import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS
from auv_fault_env.parameters import SAMPLE_TIME, Vehicle
from auv_fault_env.schedules import ScheduleSampler, profile_of
from diagnosers import Diagnoser, make
from training.metrics import sample_at
from training.metrics.records import Record, Recorder, Truth, concatenate_lanes, ordered_belief
from training.rollouts import Rollout, manoeuvres, roll_out
from training.seeds import seeds

N_SAMPLES = 650  # 65 s: 30 s after the last onset always exist
AT_ONCE = 512  # lanes held in memory
FAULTS = ScheduleSampler(healthy=0.0, compound=0.0, intermittent=0.0, repaired=0.0)
# the first ones are trainers'
FIRST_SEED = {"faulty": 100_000_000, "threshold": 200_000_000, "counting": 300_000_000}
SEVERITY_AT = 20.0  # s after onset
N_RANDOM = 4  # instants of an episode, anywhere in it, at which calibration is judged
TOLD_ON_HEALTHY = 0.6  # severity that the oracle is told where there is no fault
UNTOLD = ", severities unknown"


class Episodes(NamedTuple):
    """Lanes of the suite: the rollout, the truth, the instants (n_instants, n_lanes), the fault's full severity."""

    rollout: Rollout
    truth: Truth
    instants: np.ndarray
    full_severity: np.ndarray


class Contestant(NamedTuple):
    """A row of the comparison: a diagnoser, and whether it is told the severities if it can be told anything."""

    diagnoser: Diagnoser
    severities: bool = True


class Beliefs(NamedTuple):
    """By name of a contestant and part of the suite what it believed; the truth by part; why others failed."""

    records: dict[str, dict[str, Record]]
    truth: dict[str, Truth]
    failures: dict[str, str]


def contestants(names: Sequence[str]) -> tuple[dict[str, Contestant], dict[str, str]]:
    """The diagnosers by name, and why others could not be made; one that is told the truth also comes half-told."""
    made: dict[str, Contestant] = {}
    failures: dict[str, str] = {}
    for name in names:
        try:
            made[name] = Contestant(make(name))
            if hasattr(made[name].diagnoser, "set_truth"):
                made[name + UNTOLD] = Contestant(make(name), severities=False)
        except Exception as error:  # whatever ails one diagnoser, the others are compared
            note_failure(failures, name, error)
    return made, failures


def n_healthy(hours: float) -> int:
    """Healthy lanes that make up so many hours."""
    return math.ceil(hours * 3600.0 / (N_SAMPLES * SAMPLE_TIME))


def compare(entrants: Mapping[str, Contestant], lanes: int, hours: float, seed: int) -> Beliefs:
    """Run the suite past all contestants; one that fails is left out of the records from then on."""
    counts = {"faulty": lanes, "threshold": n_healthy(hours), "counting": n_healthy(hours)}
    records: dict[str, dict[str, Record]] = {name: {} for name in entrants}
    truth: dict[str, Truth] = {}
    failures: dict[str, str] = {}
    with tqdm(total=sum(counts.values()) * len(entrants), unit="lane", desc="validation") as bar:
        for part, count in counts.items():
            chunks = [
                (episodes.truth, watch_all(entrants, episodes, failures, bar))
                for episodes in suite(part, count, seed)
            ]
            truth[part] = concatenate_lanes([of_chunk for of_chunk, _ in chunks])
            for name in records.keys() - failures.keys():
                records[name][part] = concatenate_lanes([seen[name] for _, seen in chunks])
    return Beliefs(
        {name: records[name] for name in entrants if name not in failures}, truth, failures
    )


def watch_all(
    entrants: Mapping[str, Contestant], episodes: Episodes, failures: dict[str, str], bar: tqdm
) -> dict[str, Record]:
    """What every contestant that has not failed believes; those that fail now are added to the failures."""
    seen: dict[str, Record] = {}
    for name, contestant in entrants.items():
        bar.set_postfix_str(name)
        try:
            if name not in failures:
                seen[name] = watch(contestant, episodes)
        except Exception as error:  # whatever ails one diagnoser, the others are compared
            note_failure(failures, name, error)
        bar.update(episodes.truth.fault.size)
    return seen


def note_failure(failures: dict[str, str], name: str, error: Exception) -> None:
    """Note why a diagnoser is out of the comparison, and say so at once."""
    failures[name] = one_line(error)
    tqdm.write(f"{name} is left out: {failures[name]}", file=sys.stderr)


def one_line(error: Exception) -> str:
    """The kind of an exception and what it says, in one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())


def suite(part: str, count: int, seed: int) -> Iterator[Episodes]:
    """The lanes of a part of the suite, some at a time: the first half with the thesis' stimulus."""
    chosen = seeds("validation", count, FIRST_SEED[part] + seed)
    half = -(-count // 2)
    for thesis, lanes in ((True, chosen[:half]), (False, chosen[half:])):
        for first in range(0, len(lanes), AT_ONCE):
            yield run_lanes(lanes[first : first + AT_ONCE], part == "faulty", thesis)


def run_lanes(
    lanes: range,
    faulty: bool,
    thesis: bool,
    vehicle: str | Vehicle = "thesis1992",
    healthy_band: float = 1.0,
) -> Episodes:
    """Episodes of the lanes with these seeds, by vehicles in so many times the healthy band around the given one."""
    n = len(lanes)
    fleet = Fleet(n, vehicle, healthy_band=healthy_band, schedules=FAULTS)
    rollout = roll_out(
        fleet,
        lanes,
        N_SAMPLES,
        actions=None if thesis else manoeuvres(lanes.start, N_SAMPLES, n),
        schedules=None if faulty else [()] * n,
        missions=[MISSIONS["thesis"]] * n if thesis else None,
    )
    random = np.random.default_rng([lanes.start, 1])  # another stream than that of the manoeuvres
    onset = np.where(np.isfinite(rollout.onset), rollout.onset, random.uniform(*FAULTS.onset, n))
    instants = np.vstack(
        [sample_at(onset + SEVERITY_AT), random.integers(0, N_SAMPLES, (N_RANDOM, n))]
    )
    at = instants, np.arange(n)
    truth = Truth(rollout.label.max(axis=0), onset, rollout.label[at], rollout.severity[at])
    full = profile_of(fleet.plan).severity[:, 0] if faulty else np.full(n, TOLD_ON_HEALTHY)
    return Episodes(rollout, truth, instants, full)


def started(contestant: Contestant, healthy: np.ndarray, full_severity: np.ndarray) -> Diagnoser:
    """The diagnoser at the start of episodes; a reference that can be told the truth is told it.

    healthy (n_lanes, n_parameters): the vehicles without their faults; full_severity (n_lanes,) of
    the faults to come.
    """
    diagnoser = contestant.diagnoser
    diagnoser.reset(len(healthy))
    if hasattr(diagnoser, "set_truth"):
        diagnoser.set_truth(healthy, full_severity if contestant.severities else None)
    return diagnoser


def watch(contestant: Contestant, episodes: Episodes) -> Record:
    """What a contestant believes along the episodes; one whose belief is none is refused."""
    rollout = episodes.rollout
    diagnoser = started(contestant, rollout.healthy, episodes.full_severity)
    recorder = Recorder(len(rollout.observations), episodes.instants)
    for k, observation in enumerate(rollout.observations):
        recorder.add(
            k,
            ordered_belief(
                diagnoser.update(observation), diagnoser.classes, observation.shape[0], k
            ),
        )
    return recorder.record
