"""Evidence: how fast the readings tell a fault from a healthy vehicle and from other faults, once it has begun.

The likelihoods are those of the filter bank, which knows the plant's own model: a class' likelihood
is the mean over its kinds, and over severities where they are not told. They come from extended
Kalman filters, so they are nearly, not exactly, the plant's; `training.benchmark.bounds` measures
how nearly.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS
from auv_fault_env.faults import CATALOGUE, classes
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import Mission
from auv_fault_env.noise import episode_keys
from auv_fault_env.parameters import SAMPLE_RATE
from auv_fault_env.schedules import FaultEvent
from diagnosers import make
from diagnosers.bank.hypotheses import HypothesisTable
from diagnosers.oracle import Oracle
from training.metrics.records import HORIZON
from training.rollouts import manoeuvres
from training.seeds import seeds
from training.stimuli import Stimulus

FIRST_SEED = 960_000_000  # within those of tests, beyond those of the suites and the timing
# as in the suites
ONSET = (5.0, 30.0)
SEVERITY = (0.2, 1.0)
SPEED = (0.2, 0.5)


class Lanes(NamedTuple):
    """Vehicles, each with one abrupt and lasting fault.

    fault (n_lanes,): row of the catalogue. severity (n_lanes,). first (n_lanes,): the sample in
    which the fault shows first, one after its onset. observations (n_samples, n_lanes, n_channels).
    healthy (n_lanes, n_parameters).
    """

    fault: np.ndarray
    severity: np.ndarray
    first: np.ndarray
    observations: np.ndarray
    healthy: np.ndarray

    @property
    def diagnosis(self) -> np.ndarray:
        """Index of each lane's class in `classes()`, (n_lanes,)."""
        names = list(classes())
        return np.array([names.index(fault.diagnosis) for fault in CATALOGUE.values()])[self.fault]


@dataclass(frozen=True)
class KnownOnset(Oracle):
    """The filter bank that is told when a fault begins, if one does: nothing switches, and severities do not walk.

    Told the healthy vehicle and the severity as well, its beliefs are the likelihoods of classes
    that leave nothing else unknown; without `set_truth` it knows the healthy band, and the severity by
    grades. Call `begin` after these.
    """

    name = "known_onset"
    hazard: float = 1e-12
    walk_std: float = 0.0

    def hypotheses(self, n_grades: int | None = None) -> HypothesisTable:
        """The hypotheses of the catalogue, none of which turns into another."""
        table = super().hypotheses(n_grades)
        never = np.full_like(table.log_hazard, -np.inf)
        never[0] = 0.0
        return table._replace(log_hazard=never)

    def begin(self, lanes: np.ndarray) -> None:
        """Say that on these lanes (indices) the next sample is the first with a fault, if there is one."""
        self.running.require_reset("begin")
        self.running.state = self.state_at_onset(self.running.state, lanes)


def log_likelihoods(bank: KnownOnset, lanes: Lanes, n_samples: int) -> np.ndarray:
    """Log-likelihoods of the classes over the samples since onset, (n_samples, n_lanes, n_classes); normal has 0.

    The bank has been reset, and told what it is to know.
    """
    n_lanes = len(lanes.first)
    bank.begin(np.arange(n_lanes))
    paths = np.empty((n_samples, n_lanes, len(classes())), np.float32)
    for k, observation in enumerate(lanes.observations):
        begins = np.flatnonzero(lanes.first == k)
        if begins.size:
            bank.begin(begins)
        belief = bank.update(observation).log_probability
        since = k - lanes.first
        seen = np.flatnonzero((since >= 0) & (since < n_samples))
        paths[since[seen], seen] = belief[seen] - belief[seen, :1]
    return paths


def told(lanes: Lanes) -> np.ndarray:
    """`log_likelihoods` over `HORIZON` of a bank told everything: healthy vehicle and severity."""
    bank = _reset(lanes)
    bank.set_truth(lanes.healthy, lanes.severity)
    return log_likelihoods(bank, lanes, round(HORIZON * SAMPLE_RATE))


def untold(lanes: Lanes, knows_vehicle: bool = True) -> np.ndarray:
    """`log_likelihoods` over `HORIZON` of a bank that does not know severities, and the vehicle only if it is told."""
    bank = _reset(lanes)
    if knows_vehicle:
        bank.set_truth(lanes.healthy)
    return log_likelihoods(bank, lanes, round(HORIZON * SAMPLE_RATE))


def _reset(lanes: Lanes) -> KnownOnset:
    bank = KnownOnset()
    bank.reset(len(lanes.first))
    return bank


def run(
    stimulus: Stimulus,
    events: Sequence[FaultEvent],
    missions: Sequence[Mission],
    lane_seeds: Sequence[int],
    deflections: np.ndarray | None = None,
    fleet: Fleet | None = None,
) -> Lanes:
    """Run vehicles until `HORIZON` after the last onset.

    Parameters
    ----------
    stimulus
        How the speed command departs from the mission; it sees readings, but no belief.
    events
        The fault of each lane, abrupt and lasting, with its onset on a sample.
    missions, lane_seeds
        One per lane.
    deflections
        (n_samples or more, n_lanes, 2) of rudder and stern plane [rad]; none if not given.
    fleet
        The vehicles; a fleet with the defaults if not given.
    """
    n_lanes = len(events)
    rows = list(CATALOGUE)
    first = np.array([round(event.onset * SAMPLE_RATE) for event in events]) + 1
    fleet = fleet or Fleet(n_lanes)
    nobody = make("null")
    observation = fleet.reset(
        lane_seeds, schedules=[(event,) for event in events], missions=missions
    )
    nobody.reset(n_lanes)
    observations = np.empty(
        (first.max() + round(HORIZON * SAMPLE_RATE), n_lanes, len(CHANNELS)), np.float32
    )
    deflections = np.zeros((len(observations), n_lanes, 2)) if deflections is None else deflections
    for k in range(len(observations)):
        observations[k] = observation
        offset = stimulus.offset(k, observation, nobody.update(observation))
        observation = fleet.step(np.column_stack([observation[:, 0] + offset, deflections[k]]))
    fault = np.array([rows.index(event.fault) for event in events])
    severity = [event.severity for event in events]
    return Lanes(fault, np.array(severity), first, observations, fleet.plan.healthy.copy())


def suite_like(stimulus: Stimulus, seed: int, n_lanes: int, healthy: bool = False) -> Lanes:
    """Lanes as in the standard suite, but all abrupt: every class as often, and every kind within a class.

    Half keep a constant mission speed, half change it leg by leg; some use rudder and stern plane.
    With `healthy` the same vehicles run without their faults.
    """
    random = np.random.default_rng([FIRST_SEED, seed])
    lane_seeds = seeds("test", n_lanes, FIRST_SEED + seed)
    onset = random.uniform(*ONSET, n_lanes).round(1)
    severity = random.uniform(*SEVERITY, n_lanes)
    present = 0.0 * severity if healthy else severity
    events = [FaultEvent(*one) for one in zip(_faults(n_lanes), onset, present, strict=True)]
    fleet = Fleet(n_lanes)
    keys = episode_keys(np.array(lane_seeds, np.uint64), np.zeros(n_lanes, np.uint64))
    legs, starts = fleet.missions.sample_legs(keys)
    steady = random.uniform(*SPEED, n_lanes)
    missions = [
        Mission(((0.0, steady[k]),)) if k % 2 else Mission(tuple(map(tuple, legs[k])), starts[k])
        for k in range(n_lanes)
    ]
    n_samples = round((ONSET[1] + HORIZON) * SAMPLE_RATE) + 1
    deflections = manoeuvres(lane_seeds.start, n_samples, n_lanes)[:, :, 1:]
    return run(stimulus, events, missions, lane_seeds, deflections, fleet)._replace(
        severity=severity
    )


def _faults(n_lanes: int) -> list[str]:
    """A fault for every lane: the classes in turn, two lanes of each, and within a class its kinds in turn."""
    kinds = {
        name: [f.name for f in CATALOGUE.values() if f.diagnosis == name] for name in classes()[1:]
    }
    names = list(kinds)
    of_lane = [
        (names[k // 2 % len(names)], k // 2 // len(names) * 2 + k % 2) for k in range(n_lanes)
    ]
    return [kinds[name][turn % len(kinds[name])] for name, turn in of_lane]
