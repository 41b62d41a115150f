"""From readings to the state of each component, without ROS."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

import diagnosers
from auv_fault_env.channels import CHANNELS, READINGS
from auv_fault_env.errors import finite_in_range, known_name, refusal
from auv_fault_env.faults import CATALOGUE
from auv_fault_env.parameters import SAMPLE_RATE, SIDES
from training.benchmark.thresholds import ONE_PER_HOUR
from training.field.diagnosis.diagnosis import THRESHOLDS, diagnoser_for, persistence
from training.field.vehicle_file import read_vehicle
from training.metrics.records import PERSISTENCE

# levels of diagnostic_msgs/DiagnosticStatus
OK = 0
WARN = 1
ERROR = 2
STALE = 3
WHOLE = "propulsion"
HULL = "hull"
SENSORS = "sensors"
LONGEST_GAP = 5.0  # s between two messages after which the diagnoser starts anew
DEFAULT_DIAGNOSER = "filter_bank"
LONGEST_TIME = 3600.0
READING_COLUMNS = [list(CHANNELS).index(name) for name in READINGS]


@dataclass(frozen=True)
class Settings:
    """What the parameters of the node say; `config/parameters.yaml` explains them."""

    vehicle_file: str = ""
    diagnoser: str = ""
    alarm_probability: float = 0.0
    declared_probability: float = 0.9
    declared_time: float = 1.0  # s
    stale_time: float = 2.0  # s

    def __post_init__(self):
        finite_in_range("alarm_probability", self.alarm_probability, 0.0, 1.0)
        finite_in_range("declared_probability", self.declared_probability, 0.5, 1.0)
        finite_in_range("declared_time", self.declared_time, 0.0, LONGEST_TIME)
        finite_in_range("stale_time", self.stale_time, 1.0 / SAMPLE_RATE, LONGEST_TIME)


class Status(NamedTuple):
    """The state of a component, as diagnostic_msgs/DiagnosticStatus has it."""

    level: int
    name: str
    message: str
    values: dict[str, str]


@dataclass
class Memory:
    """What is remembered from message to message."""

    start: float = 0.0  # s, when the diagnoser started
    index: int = -1  # of the last sample since then
    time: float | None = None  # s, of the last message
    belief: diagnosers.Belief | None = None
    n_low: int = 0  # samples in a row with p(normal) below the threshold
    n_sure: int = 0  # samples in a row with the same class declared probable
    sure: int = 0  # that class
    alarm_since: float | None = None  # s


@dataclass
class Monitor:
    """The state of every component after each message of readings.

    Parameters
    ----------
    diagnoser
        Of one lane; it is reset here.
    settings
        Probabilities and times.
    threshold
        Of log p(normal), for an alarm.
    n_alarm
        Samples in a row below it that make an alarm.
    sides
        Of the shafts that the vehicle has.
    """

    diagnoser: diagnosers.Diagnoser
    settings: Settings
    threshold: float
    n_alarm: int = PERSISTENCE
    sides: Sequence[str] = SIDES
    memory: Memory = field(default_factory=Memory)

    def update(self, readings: Sequence[float], time: float) -> None:
        """Take a message: a number per channel of `CHANNELS`, NaN without a reading, and a time.

        Messages come every 0.1 s; one that comes sooner is left out, and over those that are lost
        the vehicle is predicted. After `LONGEST_GAP` or a step back in time the diagnoser starts
        anew. Refused, as `InputError`, if the number of readings is another one.
        """
        observation = np.array([readings], np.float64)
        if observation.shape != (1, len(CHANNELS)):
            allowed = f"{len(CHANNELS)}, in the order of auv_fault_env.CHANNELS"
            raise refusal("number of readings", observation.size, allowed, "send them all")
        if np.isnan(observation[0, READING_COLUMNS]).all():
            return
        last = self.memory.time
        if last is None or not 0.0 <= time - last <= LONGEST_GAP:
            self.memory = Memory(start=time)
            self.diagnoser.reset(1)
        memory = self.memory
        memory.time = time
        index = round((time - memory.start) * SAMPLE_RATE)
        while memory.index < index:
            memory.index += 1
            is_lost = memory.index < index
            self._update(np.full_like(observation, np.nan) if is_lost else observation)

    def statuses(self, now: float) -> list[Status]:
        """Of the whole propulsion, of each motor with shaft and propeller, hull and sensors."""
        components = [*(f"{side} motor" for side in self.sides), HULL, SENSORS]
        memory = self.memory
        age = None if memory.time is None else max(now - memory.time, 0.0)
        if age is None or age > self.settings.stale_time:
            values = {} if age is None else {"delay [s]": f"{age:.2f}"}
            message = "no readings yet" if age is None else "no readings"
            return [Status(STALE, name, message, values) for name in (WHOLE, *components)]
        names = self.diagnoser.classes
        by_component = {name: self._classes_of(name) for name in components}
        by_component = {WHOLE: list(range(1, len(names)))} | by_component
        return [self._status(name, of, age) for name, of in by_component.items() if of]

    def _update(self, observation: np.ndarray) -> None:
        memory = self.memory
        memory.belief = self.diagnoser.update(observation)
        log_probability = memory.belief.log_probability[0]
        memory.n_low = memory.n_low + 1 if log_probability[0] < self.threshold else 0
        if memory.n_low < self.n_alarm:
            memory.alarm_since = None
        elif memory.alarm_since is None:
            memory.alarm_since = memory.time
        likely = int(log_probability.argmax())
        is_sure = log_probability[likely] >= np.log(self.settings.declared_probability)
        is_same = is_sure and likely == memory.sure
        memory.n_sure = memory.n_sure + 1 if is_same else int(is_sure)
        memory.sure = likely

    def _classes_of(self, component: str) -> list[int]:
        """Indices of the classes that belong to a component."""
        names = enumerate(self.diagnoser.classes)
        return [index for index, name in names if component_of(name) == component]

    def _status(self, name: str, of: Sequence[int], age: float) -> Status:
        memory = self.memory
        names = self.diagnoser.classes
        log_probability, mean, std = (values[0] for values in memory.belief)
        best = max(of, key=lambda index: log_probability[index])
        suspected = 1 + int(log_probability[1:].argmax())
        n_declared = max(1, round(self.settings.declared_time * SAMPLE_RATE))
        level = OK
        if memory.alarm_since is not None and suspected in of:
            is_declared = memory.n_sure >= n_declared and memory.sure == suspected
            level = ERROR if is_declared else WARN
        values = {
            "class": names[best],
            "probability": f"{np.exp(log_probability[best]):.3g}",
            "probability of the component": f"{np.exp(log_probability[list(of)]).sum():.3g}",
            "severity": f"{mean[best]:.3g}",
            "severity std": f"{std[best]:.3g}",
            "delay [s]": f"{age:.2f}",
        }
        if level != OK:
            values["alarm for [s]"] = f"{memory.time - memory.alarm_since:.1f}"
        return Status(level, name, names[suspected] if level != OK else "normal", values)


def component_of(diagnosis: str) -> str | None:
    """The component that a class belongs to; None for `normal` and `unknown`."""
    fault = next((one for one in CATALOGUE.values() if one.diagnosis == diagnosis), None)
    if fault is None:
        return None
    if fault.component.startswith("sensor"):
        return SENSORS
    side = next((side for side in SIDES if fault.component.endswith(f":{side}")), None)
    return HULL if side is None else f"{side} motor"


def monitor_of(settings: Settings) -> Monitor:
    """The monitor of these settings; `InputError` for a file or a name that cannot be used."""
    if not settings.vehicle_file:
        name = known_name("diagnoser", settings.diagnoser or DEFAULT_DIAGNOSER, ONE_PER_HOUR)
        threshold = _threshold(settings, ONE_PER_HOUR[name])
        return Monitor(diagnosers.make(name), settings, threshold)
    vehicle = read_vehicle(Path(settings.vehicle_file))
    name = known_name("diagnoser", settings.diagnoser or vehicle.diagnoser, THRESHOLDS)
    diagnoser = diagnoser_for(name, vehicle, {})
    threshold = _threshold(settings, THRESHOLDS[name])
    sides = SIDES[: vehicle.vehicle.shafts]
    return Monitor(diagnoser, settings, threshold, persistence(vehicle), sides)


def _threshold(settings: Settings, default: float) -> float:
    chosen = settings.alarm_probability
    return float(np.log(chosen)) if chosen > 0.0 else default
