"""The simulated vehicle behind the live page, with diagnoser, stimulus and advice; no web here."""

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
from training.stimuli.base import MISSION_SPEED, N_SAMPLES, with_shift

# the oracle would need the faults that a person is going to inject
DIAGNOSERS = tuple(name for name in ONE_PER_HOUR if name != "oracle")
SLOWEST = 0.1  # m/s, least mission speed
ADVICE_INTERVAL = round(SAMPLE_RATE)  # samples
DISTANCE_TO_GOAL = 2000.0  # m, from home
# J, a quarter more than a healthy vehicle needs to the goal at its first speed
BATTERY = 36e3
HOTEL_LOAD = 3.0  # W of all but the motors
ANY_FAULT = ScheduleSampler(
    healthy=0.0, compound=0.0, incipient=0.5, intermittent=0.0, repaired=0.0
)


class Sample(NamedTuple):
    """Time since the start [s], observation (1, n_channels), belief after it, true speed [m/s]."""

    time: float
    observation: np.ndarray
    belief: Belief
    true_speed: float


class Truth(NamedTuple):
    """The truth about the vehicle now: class of the worst fault, and what the faults have changed.

    `severity` is by class; `parameters` are healthy and faulty values by name.
    """

    label: str
    severity: dict[str, float]
    parameters: dict[str, tuple[float, float]]


class Session:
    """A vehicle under way, which a person changes at any time.

    `faults` are the injected faults by name, `advice` the last advice (a new one comes every
    second), `travelled` the distance since the start [m], `energy_left` that of the battery [J].
    """

    def __init__(self, seed: int = 0):
        self._fleet = Fleet(1)
        self._seed = whole_number("seed", seed, 0)
        self._truth = SingleLaneTruth(self._fleet)
        self._random = np.random.default_rng(self._seed)
        self._samples: deque[Sample] = deque(maxlen=round(WINDOW * SAMPLE_RATE) + 1)
        self.mission_speed = FOOT
        self.diagnoser = make("filter_bank")
        self.stimulus = STIMULI["cruise"]()
        self.reset()

    def reset(self) -> None:
        """Start again with a healthy vehicle, each time another one of the healthy band."""
        seeds = None if self._fleet.changes else [self._seed]
        observation = self._fleet.reset(seeds, schedules=[()], missions=[self._mission()])
        self.faults: dict[str, FaultEvent] = {}
        self._marks: list[Mark] = []
        self.travelled = 0.0
        self.energy_left = BATTERY
        self._steps = 0
        self.diagnoser.reset(1)
        self.stimulus = STIMULI[self.stimulus.name]()
        self._stimulus_start = 0
        self._samples.clear()
        self.advice: Advice | None = None
        self._record(observation)

    def step(self) -> None:
        """Simulate 0.1 s."""
        last = self._samples[-1]
        # a stimulus has a new budget every episode
        sample = (self._steps - self._stimulus_start) % N_SAMPLES
        offset = self.stimulus.offset(sample, last.observation, last.belief)
        speed = last.observation[:, MISSION_SPEED] + offset
        shift = self.stimulus.thrust_shift(sample, last.observation, last.belief)
        command = np.column_stack([speed, np.zeros((1, 2))])
        observation = self._fleet.step(with_shift(command, shift))
        self._steps += 1
        self._record(observation)

    def _record(self, observation: np.ndarray) -> None:
        true_speed = self._truth.read()["state"]["speed"]
        belief = self.diagnoser.update(observation)
        self._samples.append(Sample(self.time, observation, belief, true_speed))
        self.travelled += true_speed * SAMPLE_TIME
        energy_left = self.energy_left - self._fleet.outcomes[1, 0] - HOTEL_LOAD * SAMPLE_TIME
        self.energy_left = max(0.0, energy_left)
        if self._steps % ADVICE_INTERVAL == 0:
            self.advice = self._advise(belief)

    def _advise(self, belief: Belief) -> Advice:
        situation = Situation(
            speed=self.mission_speed,
            distance_to_go=max(0.0, DISTANCE_TO_GOAL - self.travelled),
            distance_home=self.travelled,
            energy_left=self.energy_left,
            hotel_load=HOTEL_LOAD,
        )
        return advise(belief, situation, self._fleet.vehicle, previous=self.advice)

    @property
    def time(self) -> float:
        """Time since the start [s]."""
        return float(self._fleet.time[0])

    def inject(self, fault: str, severity: float = 1.0, ramp: float = 0.0) -> None:
        """Begin a fault of the catalogue now, growing to its severity (0 to 1) in `ramp` [s].

        The same fault again replaces the first.
        """
        self._add_fault(FaultEvent(fault, self.time, severity, ramp))

    def inject_random_fault(self) -> None:
        """Begin a random fault now, every class with the same probability."""
        event = ANY_FAULT.sample(int(self._random.integers(2**62)))[0]
        self._add_fault(replace(event, onset=self.time))

    def _add_fault(self, event: FaultEvent) -> None:
        self.faults[event.fault] = event
        self._fleet.replan(schedules=[tuple(self.faults.values())])
        self._marks.append(Mark(self.time, "fault"))

    def repair(self) -> None:
        """End all faults."""
        self.faults = {}
        self._fleet.replan(schedules=[()])
        self._marks.append(Mark(self.time, "repair"))

    def set_mission_speed(self, speed: float) -> None:
        """Set another mission speed [m/s] from now on."""
        self.mission_speed = finite_in_range("mission speed", speed, SLOWEST, MAXIMUM_COMMAND)
        self._fleet.replan(missions=[self._mission()])

    def _mission(self) -> Mission:
        return Mission(((0.0, self.mission_speed),))

    def choose_stimulus(self, name: str) -> None:
        """Use another stimulus from now on."""
        stimulus = STIMULI[known_name("stimulus", name, STIMULI)]()
        last = self._samples[-1]
        # load or compute now what the first offset needs, so that the next step is not late
        stimulus.offset(0, last.observation, last.belief)
        self.stimulus = stimulus
        self._stimulus_start = self._steps

    def choose_diagnoser(self, name: str) -> None:
        """Use another diagnoser, which first processes the recorded samples."""
        diagnoser = make(known_name("diagnoser", name, DIAGNOSERS))
        diagnoser.reset(1)
        for k, sample in enumerate(self._samples):
            self._samples[k] = sample._replace(belief=diagnoser.update(sample.observation))
        self.diagnoser = diagnoser

    def truth(self) -> Truth:
        """The truth about the vehicle now."""
        truth = self._truth.read()
        healthy = self._fleet.plan.healthy[0].tolist()
        severity = {name: value for name, value in truth["severity"].items() if value}
        parameters = {}
        for name, healthy_value in zip(PARAMETERS, healthy, strict=True):
            value = truth["parameters"][name]
            if value != healthy_value:
                parameters[name] = (healthy_value, value)
        return Truth(truth["label"], severity, parameters)

    def history(self) -> History:
        """The recorded samples, with the alarm at one false alarm per hour."""
        time, observation, beliefs, true_speed = zip(*self._samples, strict=True)
        belief = Belief(*map(np.concatenate, zip(*beliefs, strict=True)))
        threshold = ONE_PER_HOUR[self.diagnoser.name]
        alarm = alarms(belief.log_probability[:, :1], threshold, PERSISTENCE)[:, 0]
        marks = tuple(mark for mark in self._marks if mark.time >= time[0])
        return History(
            np.array(time),
            np.concatenate(observation),
            belief,
            alarm,
            np.array(true_speed),
            marks,
        )
