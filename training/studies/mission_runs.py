"""Missions simulated to their end on the plant, with advice ignored or followed, and their ends."""

from collections.abc import Sequence
from itertools import count
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from auv_fault_env.channels import INDEX
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
# what is done with the advice, as the results name it
IGNORED, FOLLOWED, TRUTH_KNOWN = ARMS = ("ignored", "followed", "truth told")
# samples with diagnosis: until 60 s after the last onset
N_DIAGNOSED = round((ONE_FAULT.onset[1] + 60.0) * SAMPLE_RATE)
# samples from one advice to the next, during diagnosis and later
ADVICE_INTERVAL = round(SAMPLE_RATE)
LATER_ADVICE_INTERVAL = round(60.0 * SAMPLE_RATE)
# 1/s and m/s, of the guidance that holds the advised speed
TRIM_RATE = 0.05
LARGEST_TRIM = 0.3
SPEED_READING = INDEX["speed"]
# log probability of a class that is known to be false
EXCLUDED = -100.0


class MissionPlan(NamedTuple):
    """Missions at the start of the simulation.

    Attributes
    ----------
    seeds, schedules
        One per mission.
    situation
        Where they stand; fields (n_lanes,).
    """

    seeds: Sequence[int]
    schedules: Sequence[Schedule]
    situation: Situation


class MissionRuns:
    """Missions in progress, one per lane.

    Attributes
    ----------
    situation
        Where they stand now.
    advice
        The last advice, None before the first.
    outcome
        Index in `OUTCOMES`, `UNDERWAY` before the end, (n_lanes,).
    energy_used, duration
        Energy [J] and time [s] until now or the end, (n_lanes,).
    action_changes
        How often the advised action has changed, (n_lanes,).
    """

    def __init__(self, situation: Situation):
        n_lanes = len(situation.speed)
        self.situation = situation
        self.advice = None
        self.outcome = np.full(n_lanes, UNDERWAY)
        self.action_changes = np.zeros(n_lanes, np.int64)
        self.energy_used = np.zeros(n_lanes)
        self.duration = np.zeros(n_lanes)
        self._direction = np.ones(n_lanes)
        self._target_speed = situation.speed
        self._trim = np.zeros(n_lanes)
        self._ignores_speed_reading = np.zeros(n_lanes, bool)

    @property
    def is_underway(self) -> np.ndarray:
        """Whether each mission has not ended yet, (n_lanes,) bool."""
        return self.outcome == UNDERWAY

    def follow(self, advice: Advice) -> None:
        """Adopt new advice; an abort ends the mission at once."""
        if self.advice is not None:
            has_changed = advice.level != self.advice.level
            self.action_changes += self.is_underway & has_changed
        self.outcome[self.is_underway & (advice.level == ABORT)] = ABORTED
        self._direction = np.where(advice.level == RETURN, -1.0, 1.0)
        self._target_speed = advice.speed
        self._ignores_speed_reading = advice.distrusted == SPEED_SENSOR
        self.advice = advice

    def command(self, speed_reading: np.ndarray) -> np.ndarray:
        """Actions (n_lanes, 3) that hold the advised speed by its reading [m/s], if trusted."""
        error = self._target_speed - speed_reading
        trim = np.clip(self._trim + SAMPLE_TIME * TRIM_RATE * error, -LARGEST_TRIM, LARGEST_TRIM)
        self._trim = np.where(self._ignores_speed_reading, 0.0, trim)
        return (self._target_speed + self._trim)[:, None] * [1.0, 0.0, 0.0]

    def advance(self, speed: np.ndarray, motor_energy: np.ndarray) -> None:
        """Move by one sample.

        Parameters
        ----------
        speed
            Speed through the water [m/s], (n_lanes,).
        motor_energy
            Energy of the motors in this sample [J], (n_lanes,).
        """
        before = self.situation
        underway = self.is_underway
        speed_over_ground = self._direction * speed - before.current
        way = np.where(underway, SAMPLE_TIME * speed_over_ground, 0.0)
        energy = np.where(underway, motor_energy + SAMPLE_TIME * before.hotel_load, 0.0)
        distance_to_go = before.distance_to_go - way
        distance_home = before.distance_home + way
        energy_left = before.energy_left - energy
        is_home = (self._direction < 0.0) & (distance_home <= 0.0)
        conditions = [distance_to_go <= 0.0, is_home, energy_left <= 0.0]
        outcome = np.select(conditions, [GOAL, HOME, STRANDED], UNDERWAY)
        self.outcome = np.where(underway, outcome, self.outcome)
        self.energy_used = self.energy_used + energy
        self.duration = self.duration + SAMPLE_TIME * underway
        self.situation = before._replace(
            distance_to_go=np.maximum(distance_to_go, 0.0),
            distance_home=np.maximum(distance_home, 0.0),
            energy_left=np.maximum(energy_left, 0.0),
        )


def run_missions(
    plan: MissionPlan, vehicle: Vehicle, arm: str, diagnoser: Diagnoser
) -> MissionRuns:
    """Simulate the missions until each has ended.

    Vehicles, faults and noise are the same for every arm. Advice comes once a second while the
    diagnoser runs, and once a minute later, for the energy left and the distance to go. In the arm
    `FOLLOWED` it rests on the belief of the diagnoser, later on its last belief; in the arm
    `TRUTH_KNOWN` on the truth.
    """
    fleet = Fleet(len(plan.seeds), vehicle)
    runs = MissionRuns(plan.situation)
    speeds = plan.situation.speed.tolist()
    observation = fleet.reset(plan.seeds, schedules=plan.schedules, missions=speeds)
    diagnoser.reset(fleet.n_lanes)
    with tqdm(total=fleet.n_lanes, unit="mission", desc=arm) as bar:
        for k in count():
            is_diagnosed = k < N_DIAGNOSED
            interval = ADVICE_INTERVAL if is_diagnosed else LATER_ADVICE_INTERVAL
            if arm == FOLLOWED and is_diagnosed:
                last_belief = diagnoser.update(observation)
            if arm != IGNORED and k % interval == 0:
                belief = true_belief(fleet) if arm == TRUTH_KNOWN else last_belief
                runs.follow(advise(belief, runs.situation, vehicle, previous=runs.advice))
            observation = fleet.step(runs.command(observation[:, SPEED_READING]))
            runs.advance(FleetTruth(fleet)["state"]["speed"], fleet.outcomes[1])
            n_ended = int((~runs.is_underway).sum())
            bar.update(n_ended - bar.n)
            if not runs.is_underway.any():
                break
    fleet.close()
    return runs


def true_belief(fleet: Fleet) -> Belief:
    """The belief that knows class and severity of the present fault, but not the vehicle."""
    truth = FleetTruth(fleet)
    is_true = truth["label"][:, None] == np.array(classes())
    normal_severity = np.zeros(fleet.n_lanes)
    severity = np.column_stack([normal_severity, *truth["severity"].values()])
    log_probability = np.where(is_true, 0.0, EXCLUDED)
    return Belief(log_probability, severity, np.zeros_like(severity))


def normal_belief(n_lanes: int) -> Belief:
    """The belief that all vehicles are healthy."""
    log_probability = np.where(np.array(classes()) == NORMAL, 0.0, EXCLUDED)
    zeros = np.zeros((n_lanes, log_probability.size))
    return Belief(np.tile(log_probability, (n_lanes, 1)), zeros, zeros)
