"""The vehicle behind the live page, and what a diagnoser makes of it while a person breaks it. No web here."""

from collections import deque
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import MAXIMUM_COMMAND
from auv_fault_env.errors import finite_in_range, known_name, whole_number
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import Mission
from auv_fault_env.parameters import FOOT, PARAMETERS, SAMPLE_RATE, SAMPLE_TIME
from auv_fault_env.schedules import FaultEvent, ScheduleSampler
from auv_fault_env.truth import SingleLaneTruth
from diagnosers import Belief, make
from diagnosers.advisory import Advice, Situation, advise
from training.benchmark.thresholds import ONE_PER_HOUR
from training.live.history import WINDOW, History, Mark
from training.metrics import alarms
from training.metrics.records import PERSISTENCE
from training.stimuli import STIMULI
from training.stimuli.base import MISSION_SPEED, N_SAMPLES

DIAGNOSERS = tuple(
    name for name in ONE_PER_HOUR if name != "oracle"
)  # which would have to be told what a person is up to
SLOWEST = 0.1  # m/s, least mission speed
ADVISED = round(SAMPLE_RATE)  # samples between two advices
WAY = 2000.0  # m from home to the goal
BATTERY = 36e3  # J, a quarter more than a healthy vehicle needs for the way at its first speed
HOTEL_LOAD = 3.0  # W of all but the motors
ANY_FAULT = ScheduleSampler(
    healthy=0.0, compound=0.0, incipient=0.5, intermittent=0.0, repaired=0.0
)


class Sample(NamedTuple):
    """A sample: time [s], observation (1, n_channels), what is believed after it, and the true speed [m/s]."""

    time: float
    observation: np.ndarray
    belief: Belief
    true_speed: float


class Truth(NamedTuple):
    """What is so: class of the worst fault, severities in force by class, changed parameters' healthy and new value."""

    label: str
    severity: dict[str, float]
    parameters: dict[str, tuple[float, float]]


class Session:
    """A vehicle under way, sample by sample; faults, mission speed, diagnoser and stimulus may change at any time.

    Attributes
    ----------
    diagnoser, stimulus
        At work now.
    mission_speed
        Speed [m/s] that the mission asks for.
    faults
        What is wrong with the vehicle, by name of the fault.
    advice
        The last one, once a second.
    travelled, energy_left
        Way made good [m], and what is left in the battery [J].
    """

    def __init__(self, seed: int = 0):
        self._fleet = Fleet(1)
        self._seed = whole_number("seed", seed, 0)
        self._truth, self._random = SingleLaneTruth(self._fleet), np.random.default_rng(self._seed)
        self._samples: deque[Sample] = deque(maxlen=round(WINDOW * SAMPLE_RATE) + 1)
        self.mission_speed = FOOT
        self.diagnoser = make("filter_bank")
        self.stimulus = STIMULI["cruise"]()
        self.reset()

    def reset(self) -> None:
        """Set out with a healthy vehicle: at first that of the seed, then another one of the healthy band each time."""
        seeds = None if self._fleet.changes else [self._seed]
        observation = self._fleet.reset(seeds, schedules=[()], missions=[self._mission()])
        self.faults: dict[str, FaultEvent] = {}
        self._marks: list[Mark] = []
        self.travelled = 0.0
        self.energy_left = BATTERY
        self._steps = 0
        self.diagnoser.reset(1)
        self.stimulus = STIMULI[self.stimulus.name]()
        self._stirred = 0
        self._samples.clear()
        self.advice: Advice | None = None
        self._note(observation)

    def step(self) -> None:
        """Let 0.1 s pass."""
        last = self._samples[-1]
        # the budget of a stimulus begins anew with every episode
        sample = (self._steps - self._stirred) % N_SAMPLES
        speed = last.observation[:, MISSION_SPEED] + self.stimulus.offset(
            sample, last.observation, last.belief
        )
        observation = self._fleet.step(np.column_stack([speed, np.zeros((1, 2))]))
        self._steps += 1
        self._note(observation)

    def _note(self, observation: np.ndarray) -> None:
        true_speed = self._truth.read()["state"]["speed"]
        belief = self.diagnoser.update(observation)
        self._samples.append(Sample(self.time, observation, belief, true_speed))
        self.travelled += true_speed * SAMPLE_TIME
        self.energy_left = max(
            0.0, self.energy_left - self._fleet.outcomes[1, 0] - HOTEL_LOAD * SAMPLE_TIME
        )
        if self._steps % ADVISED == 0:
            to_go = max(0.0, WAY - self.travelled)
            situation = Situation(
                self.mission_speed, to_go, self.travelled, self.energy_left, HOTEL_LOAD
            )
            self.advice = advise(belief, situation, self._fleet.vehicle, previous=self.advice)

    @property
    def time(self) -> float:
        """Since the vehicle has set out [s]."""
        return float(self._fleet.time[0])

    def inject(self, fault: str, severity: float = 1.0, ramp: float = 0.0) -> None:
        """Break something from now on, abruptly or growing over a ramp [s]; the same fault again replaces the first."""
        self._break(FaultEvent(fault, self.time, severity, ramp))

    def surprise(self) -> None:
        """Break something that nobody has chosen, every class being as likely."""
        event = ANY_FAULT.sample(int(self._random.integers(2**62)))[0]
        self._break(replace(event, onset=self.time))

    def _break(self, event: FaultEvent) -> None:
        self.faults[event.fault] = event
        self._fleet.replan(schedules=[tuple(self.faults.values())])
        self._marks.append(Mark(self.time, "fault"))

    def repair(self) -> None:
        """Make the vehicle whole again."""
        self.faults = {}
        self._fleet.replan(schedules=[()])
        self._marks.append(Mark(self.time, "repair"))

    def set_mission_speed(self, speed: float) -> None:
        """Ask for another speed [m/s] from now on."""
        self.mission_speed = finite_in_range("mission speed", speed, SLOWEST, MAXIMUM_COMMAND)
        self._fleet.replan(missions=[self._mission()])

    def _mission(self) -> Mission:
        return Mission(((0.0, self.mission_speed),))

    def choose_stimulus(self, name: str) -> None:
        """Another stimulus from now on."""
        stimulus = STIMULI[known_name("stimulus", name, STIMULI)]()
        last = self._samples[-1]
        # what it has to load or to work out does not keep a step
        stimulus.offset(0, last.observation, last.belief)
        self.stimulus = stimulus
        self._stirred = self._steps

    def choose_diagnoser(self, name: str) -> None:
        """Another diagnoser; it first reads what is remembered, so that its belief can be seen from there on."""
        diagnoser = make(known_name("diagnoser", name, DIAGNOSERS))
        diagnoser.reset(1)
        for k, sample in enumerate(self._samples):
            self._samples[k] = sample._replace(belief=diagnoser.update(sample.observation))
        self.diagnoser = diagnoser

    def truth(self) -> Truth:
        """What is so."""
        so = self._truth.read()
        healthy = dict(zip(PARAMETERS, self._fleet.plan.healthy[0].tolist(), strict=True))
        return Truth(
            so["label"],
            {name: severity for name, severity in so["severity"].items() if severity},
            {
                name: (healthy[name], value)
                for name, value in so["parameters"].items()
                if value != healthy[name]
            },
        )

    def history(self) -> History:
        """What is remembered."""
        time, observation, beliefs, true_speed = zip(*self._samples, strict=True)
        belief = Belief(*map(np.concatenate, zip(*beliefs, strict=True)))
        threshold = ONE_PER_HOUR[self.diagnoser.name]
        return History(
            np.array(time),
            np.concatenate(observation),
            belief,
            alarms(belief.log_probability[:, :1], threshold, PERSISTENCE)[:, 0],
            np.array(true_speed),
            tuple(mark for mark in self._marks if mark.time >= time[0]),
        )
