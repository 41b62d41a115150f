"""Missions sailed to their end on the plant, with advice ignored or followed, and how each of them ended."""

from collections.abc import Sequence
from itertools import count
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from auv_fault_env.channels import CHANNELS
from auv_fault_env.faults import NORMAL, classes
from auv_fault_env.fleet import Fleet
from auv_fault_env.parameters import SAMPLE_RATE, SAMPLE_TIME, Vehicle
from auv_fault_env.schedules import Schedule
from auv_fault_env.truth import FleetTruth
from diagnosers import Belief, Diagnoser
from diagnosers.advisory import ABORT, RETURN, SPEED_SENSOR, Advice, Situation, advise
from training.benchmark.suites import ONE_FAULT

UNDERWAY, GOAL, HOME, ABORTED, STRANDED = range(-1, 4)
OUTCOMES = ("reached the goal", "came home", "aborted", "stranded")
IGNORED, FOLLOWED, TOLD = ARMS = ("ignored", "followed", "truth told")
# samples that are diagnosed: 60 s after the last onset
WATCHED = round((ONE_FAULT.onset[1] + 60.0) * SAMPLE_RATE)
# samples, while diagnosed and later
ADVISED_EVERY = round(SAMPLE_RATE)
REVIEWED_EVERY = round(60.0 * SAMPLE_RATE)
# 1/s and m/s, of the guidance that holds the speed asked for
TRIM_RATE = 0.05
MOST_TRIM = 0.3
SPEED_READING = list(CHANNELS).index("speed")
CERTAIN = -100.0  # log probability of what is known to be false


class Plan(NamedTuple):
    """Missions as they stand when the simulation begins: seed and schedule of each, the rest (n_lanes,), SI units."""

    seeds: Sequence[int]
    schedules: Sequence[Schedule]
    situation: Situation


class Voyages:
    """Missions under way, one per lane.

    Attributes
    ----------
    so
        Where they stand.
    advice
        The last, None before the first.
    outcome
        Index in `OUTCOMES`, `UNDERWAY` before it is settled, (n_lanes,).
    spent, lasted
        Energy used [J] and time [s], (n_lanes,).
    changes
        How often the advised action has changed, (n_lanes,).
    """

    def __init__(self, situation: Situation):
        self.so = situation
        self.advice = None
        n_lanes = len(situation.speed)
        self.outcome = np.full(n_lanes, UNDERWAY)
        self.changes = np.zeros(n_lanes, np.int64)
        self.spent = np.zeros(n_lanes)
        self.lasted = np.zeros(n_lanes)
        self._trim = np.zeros(n_lanes)
        self._heading = np.ones(n_lanes)
        self._asked = situation.speed
        self._blind = np.zeros(n_lanes, bool)

    @property
    def underway(self) -> np.ndarray:
        """Which have not ended, (n_lanes,) bool."""
        return self.outcome == UNDERWAY

    def obey(self, advice: Advice) -> None:
        """Take new advice; to abort ends the mission there and then."""
        if self.advice is not None:
            self.changes += self.underway & (advice.level != self.advice.level)
        self.outcome[self.underway & (advice.level == ABORT)] = ABORTED
        self._heading = np.where(advice.level == RETURN, -1.0, 1.0)
        self._asked = advice.speed
        self._blind = advice.distrusted == SPEED_SENSOR
        self.advice = advice

    def command(self, reading: np.ndarray) -> np.ndarray:
        """Actions (n_lanes, 3) that hold the speed asked for, from the speed read [m/s], unless that is distrusted."""
        trim = self._trim + SAMPLE_TIME * TRIM_RATE * (self._asked - reading)
        self._trim = np.where(self._blind, 0.0, np.clip(trim, -MOST_TRIM, MOST_TRIM))
        return (self._asked + self._trim)[:, None] * [1.0, 0.0, 0.0]

    def move(self, speed: np.ndarray, energy: np.ndarray) -> None:
        """One sample further, at a speed through the water [m/s] and with energy of the motors [J], (n_lanes,)."""
        so = self.so
        underway = self.underway
        way = np.where(underway, SAMPLE_TIME * (self._heading * speed - so.current), 0.0)
        used = np.where(underway, energy + SAMPLE_TIME * so.hotel_load, 0.0)
        to_go = so.distance_to_go - way
        home = so.distance_home + way
        left = so.energy_left - used
        returned = (self._heading < 0.0) & (home <= 0.0)
        ends = np.select([to_go <= 0.0, returned, left <= 0.0], [GOAL, HOME, STRANDED], UNDERWAY)
        self.outcome = np.where(underway, ends, self.outcome)
        self.spent = self.spent + used
        self.lasted = self.lasted + SAMPLE_TIME * underway
        self.so = so._replace(
            distance_to_go=np.maximum(to_go, 0.0),
            distance_home=np.maximum(home, 0.0),
            energy_left=np.maximum(left, 0.0),
        )


def sail(plan: Plan, vehicle: Vehicle, arm: str, diagnoser: Diagnoser) -> Voyages:
    """The missions sailed until each has ended: in the arm `FOLLOWED` by the diagnoser's belief, which is kept later.

    Every arm meets the same vehicles, faults and noise. Advice is given once a second while the
    diagnoser watches, and once a minute thereafter, for the energy left and the way to go.
    """
    fleet = Fleet(len(plan.seeds), vehicle)
    voyages = Voyages(plan.situation)
    observation = fleet.reset(
        plan.seeds, schedules=plan.schedules, missions=plan.situation.speed.tolist()
    )
    diagnoser.reset(fleet.n_lanes)
    with tqdm(total=fleet.n_lanes, unit="mission", desc=arm) as bar:
        for k in count():
            if arm == FOLLOWED and k < WATCHED:
                belief = diagnoser.update(observation)
            if arm != IGNORED and k % (ADVISED_EVERY if k < WATCHED else REVIEWED_EVERY) == 0:
                given = told(fleet) if arm == TOLD else belief
                voyages.obey(advise(given, voyages.so, vehicle, before=voyages.advice))
            observation = fleet.step(voyages.command(observation[:, SPEED_READING]))
            voyages.move(FleetTruth(fleet)["state"]["speed"], fleet.outcomes[1])
            bar.update(int((~voyages.underway).sum()) - bar.n)
            if not voyages.underway.any():
                break
    fleet.close()
    return voyages


def told(fleet: Fleet) -> Belief:
    """The belief of one who knows class and severity of the fault in force, not the vehicle within its band."""
    truth = FleetTruth(fleet)
    label = truth["label"]
    severity = truth["severity"]
    certain = np.where(label[:, None] == np.array(classes()), 0.0, CERTAIN)
    mean = np.column_stack([np.zeros(fleet.n_lanes), *severity.values()])
    return Belief(certain, mean, np.zeros_like(mean))


def normal(n_lanes: int) -> Belief:
    """The belief that all vehicles are healthy."""
    certain = np.where(np.array(classes()) == NORMAL, 0.0, CERTAIN)
    nothing = np.zeros((n_lanes, certain.size))
    return Belief(np.tile(certain, (n_lanes, 1)), nothing, nothing)
