"""Evidence: how fast readings distinguish a fault from a healthy vehicle and from other faults.

The likelihoods are those of the Gaussian bank, which has the equations of the plant. The likelihood
of a class is the mean over its faults, and over severities where these are unknown. They come from
extended Kalman filters and are therefore approximations; `training.benchmark.bounds` measures how
good these are.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS
from auv_fault_env.faults import CATALOGUE, fault_classes, known_classes
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
from training.stimuli.base import with_shift

# within the seeds of tests, beyond those of the suites and the timing
FIRST_SEED = 960_000_000
# onset [s], severity and mission speed [m/s] as in the suites
ONSET = (5.0, 30.0)
SEVERITY = (0.2, 1.0)
SPEED = (0.2, 0.5)


class Lanes(NamedTuple):
    """Simulated vehicles, each with one abrupt and lasting fault.

    Attributes
    ----------
    fault
        Row of each lane's fault in the catalogue, (n_lanes,).
    severity
        Severity of each fault, (n_lanes,).
    first_faulty_sample
        The first sample that a fault changes, one after its onset, (n_lanes,).
    observations
        (n_samples, n_lanes, n_channels).
    healthy
        Parameters of the vehicles without their faults, (n_lanes, n_parameters).
    """

    fault: np.ndarray
    severity: np.ndarray
    first_faulty_sample: np.ndarray
    observations: np.ndarray
    healthy: np.ndarray

    @property
    def diagnosis(self) -> np.ndarray:
        """Index of each lane's class in `known_classes()`, (n_lanes,)."""
        names = list(known_classes())
        of_fault = [names.index(fault.diagnosis) for fault in CATALOGUE.values()]
        return np.array(of_fault)[self.fault]


@dataclass(frozen=True)
class KnownOnset(Oracle):
    """The Gaussian bank with known onsets: hypotheses do not switch, severities do not change.

    Once `set_truth` has set healthy vehicle and severity as well, its beliefs are likelihoods
    without unknown quantities. Otherwise it knows the healthy band, and the severity by grades.
    Call `start_fault` after `set_truth`.
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

    def start_fault(self, lanes: np.ndarray) -> None:
        """Declare the next sample of these lanes (indices) the first that a fault may change."""
        self.running.require_reset("start_fault")
        self.running.state = self.state_at_onset(self.running.state, lanes)


def log_likelihoods(bank: KnownOnset, lanes: Lanes, n_samples: int) -> np.ndarray:
    """Log-likelihood ratios of the classes to normal, (n_samples, n_lanes, n_known), from onset.

    The bank has been reset and has been given the truth that it may know.
    """
    n_lanes = len(lanes.first_faulty_sample)
    bank.start_fault(np.arange(n_lanes))
    ratios = np.empty((n_samples, n_lanes, len(known_classes())), np.float32)
    for k, observation in enumerate(lanes.observations):
        starting = np.flatnonzero(lanes.first_faulty_sample == k)
        if starting.size:
            bank.start_fault(starting)
        log_probability = bank.update(observation).log_probability[:, : ratios.shape[2]]
        since_onset = k - lanes.first_faulty_sample
        recorded = np.flatnonzero((since_onset >= 0) & (since_onset < n_samples))
        ratio = log_probability[recorded] - log_probability[recorded, :1]
        ratios[since_onset[recorded], recorded] = ratio
    return ratios


def log_likelihoods_known_severity(lanes: Lanes) -> np.ndarray:
    """`log_likelihoods` up to `HORIZON`; the bank knows healthy vehicles and severities."""
    bank = _reset_bank(lanes)
    bank.set_truth(lanes.healthy, lanes.severity)
    return log_likelihoods(bank, lanes, round(HORIZON * SAMPLE_RATE))


def log_likelihoods_unknown_severity(lanes: Lanes, knows_vehicle: bool = True) -> np.ndarray:
    """`log_likelihoods` up to `HORIZON`; the bank knows no severities."""
    bank = _reset_bank(lanes)
    if knows_vehicle:
        bank.set_truth(lanes.healthy)
    return log_likelihoods(bank, lanes, round(HORIZON * SAMPLE_RATE))


def _reset_bank(lanes: Lanes) -> KnownOnset:
    bank = KnownOnset()
    bank.reset(len(lanes.first_faulty_sample))
    return bank


def simulate_lanes(
    stimulus: Stimulus,
    events: Sequence[FaultEvent],
    missions: Sequence[Mission],
    lane_seeds: Sequence[int],
    deflections: np.ndarray | None = None,
    fleet: Fleet | None = None,
) -> Lanes:
    """Simulate vehicles until `HORIZON` after the last onset.

    Parameters
    ----------
    stimulus
        Chooses the speed offsets from the readings; it gets the belief of the `null` diagnoser.
    events
        The fault of each lane, abrupt and lasting, with its onset on a sample.
    missions, lane_seeds
        One per lane.
    deflections
        Rudder and stern plane [rad], (n_samples or more, n_lanes, 2); zero if not given.
    fleet
        The vehicles; a fleet with the defaults if not given.
    """
    n_lanes = len(events)
    onset = [round(event.onset * SAMPLE_RATE) for event in events]
    first_faulty_sample = np.array(onset) + 1
    n_samples = first_faulty_sample.max() + round(HORIZON * SAMPLE_RATE)
    if deflections is None:
        deflections = np.zeros((n_samples, n_lanes, 2))
    fleet = fleet or Fleet(n_lanes)
    schedules = [(event,) for event in events]
    observation = fleet.reset(lane_seeds, schedules=schedules, missions=missions)
    diagnoser = make("null")
    diagnoser.reset(n_lanes)
    observations = np.empty((n_samples, n_lanes, len(CHANNELS)), np.float32)
    for k in range(n_samples):
        observations[k] = observation
        belief = diagnoser.update(observation)
        offset = stimulus.offset(k, observation, belief)
        command = np.column_stack([observation[:, 0] + offset, deflections[k]])
        shift = stimulus.thrust_shift(k, observation, belief)
        observation = fleet.step(with_shift(command, shift))
    rows = list(CATALOGUE)
    fault = np.array([rows.index(event.fault) for event in events])
    severity = np.array([event.severity for event in events])
    healthy = fleet.plan.healthy.copy()
    return Lanes(fault, severity, first_faulty_sample, observations, healthy)


def simulate_suite_lanes(
    stimulus: Stimulus, seed: int, n_lanes: int, healthy: bool = False
) -> Lanes:
    """Simulate lanes as in the standard suite, but with abrupt faults only.

    Every class is as frequent as any other, and every fault within a class. Half of the lanes have
    a constant mission speed, half change it leg by leg; some use rudder and stern plane. With
    `healthy` the same vehicles run without their faults.
    """
    random = np.random.default_rng([FIRST_SEED, seed])
    lane_seeds = seeds("test", n_lanes, FIRST_SEED + seed)
    onset = random.uniform(*ONSET, n_lanes).round(1)
    names = _fault_of_each_lane(n_lanes)
    least = [CATALOGUE[name].least_severity for name in names]
    severity = np.maximum(random.uniform(*SEVERITY, n_lanes), least)
    simulated = 0.0 * severity if healthy else severity
    faults = zip(names, onset, simulated, strict=True)
    events = [FaultEvent(*fault) for fault in faults]
    fleet = Fleet(n_lanes)
    missions = _missions(fleet, lane_seeds, random.uniform(*SPEED, n_lanes))
    n_samples = round((ONSET[1] + HORIZON) * SAMPLE_RATE) + 1
    deflections = manoeuvres(lane_seeds.start, n_samples, n_lanes)[:, :, 1:]
    lanes = simulate_lanes(stimulus, events, missions, lane_seeds, deflections, fleet)
    return lanes._replace(severity=severity)


def _missions(fleet: Fleet, lane_seeds: range, constant_speed: np.ndarray) -> list[Mission]:
    """A constant mission speed on every other lane, and the fleet's random legs between."""
    n_lanes = fleet.n_lanes
    keys = episode_keys(np.array(lane_seeds, np.uint64), np.zeros(n_lanes, np.uint64))
    legs, starts = fleet.missions.sample_legs(keys)
    return [
        Mission(((0.0, constant_speed[k]),))
        if k % 2
        else Mission(tuple(map(tuple, legs[k])), starts[k])
        for k in range(n_lanes)
    ]


def _fault_of_each_lane(n_lanes: int) -> list[str]:
    """The classes in turn, two lanes of each, and within a class its faults in turn."""
    faults = faults_by_class()
    names = list(faults)
    lane_faults = []
    for lane in range(n_lanes):
        of_class = faults[names[lane // 2 % len(names)]]
        turn = lane // 2 // len(names) * 2 + lane % 2
        lane_faults.append(of_class[turn % len(of_class)])
    return lane_faults


def faults_by_class() -> dict[str, list[str]]:
    """The faults of each diagnosis class but `normal`, in the order of the catalogue."""
    return {
        name: [fault.name for fault in CATALOGUE.values() if fault.diagnosis == name]
        for name in fault_classes()
    }
