"""When faults come and go: events, schedules, their JSON, and the sampler of schedules."""

import itertools
import json
import math
from collections import namedtuple
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from auv_fault_env.distributions import CHECKED_KEYS, Distribution, generators_of
from auv_fault_env.errors import (
    finite_in_range,
    known_name,
    pair_in_range,
    refusal,
    whole_number,
)
from auv_fault_env.faults import CATALOGUE
from auv_fault_env.layout import EpisodePlan, SeverityProfile
from auv_fault_env.noise import STREAMS, episode_keys, uniforms
from auv_fault_env.parameters import Vehicle
from auv_fault_env.text_files import text_of
from auv_fault_env.unmodelled import plant_fault, plant_faults

LONGEST = 1e12  # s
TWO_SHAFTS = Vehicle()  # a vehicle that can have every fault of the catalogue
# largest value of each column of a severity profile but its end
LIMITS = {
    "severity": 1.0,
    "duty": 1.0,
    "onset": LONGEST,
    "ramp": LONGEST,
    "period": LONGEST,
}


@dataclass(frozen=True)
class Event:
    """One fault of an episode: abrupt, incipient (ramp), intermittent (period), or repaired."""

    fault: str  # name
    onset: float  # s, from the beginning of the episode
    severity: float  # full, 0 to 1
    ramp: float = 0.0  # s, in which the severity grows from zero
    end: float = math.inf  # s
    period: float = 0.0  # s, of an intermittent fault; 0 if permanent
    duty: float = 1.0  # share of each period during which it is present

    def __post_init__(self):
        for name, high in {**LIMITS, "end": math.inf}.items():
            value = finite_in_range(f"{name} of {self.fault}", getattr(self, name), 0.0, high)
            object.__setattr__(self, name, value)
        if self.end <= self.onset:
            allowed = f"before its end at {self.end:g} s"
            raise refusal(f"onset of {self.fault}", self.onset, allowed, "correct one of them")


@dataclass(frozen=True)
class FaultEvent(Event):
    """An event with a fault of the catalogue or of `UNMODELLED`."""

    def __post_init__(self):
        plant_fault(self.fault)
        super().__post_init__()


Schedule = tuple[Event, ...]
# the uniform numbers in (0, 1) that decide one event
EventUniforms = namedtuple(
    "EventUniforms",
    "fault onset severity incipient ramp intermittent period duty repaired life",
)
PROFILE = SeverityProfile._fields
JSON_FORM = "a JSON list of fault events"


def event_of(value: Event | Mapping, kind: type[Event] = FaultEvent) -> Event:
    """An event, or the event of a mapping; unknown and missing fields are refused."""
    if isinstance(value, kind):
        return value
    if not isinstance(value, Mapping):
        allowed = "a mapping with fault, onset, severity"
        raise refusal("event of a schedule", value, allowed, "write one")
    names = [spec.name for spec in fields(kind)]
    for name in value:
        known_name("field of a fault event", name, names)
    for spec in fields(kind):
        if spec.default is MISSING and spec.name not in value:
            allowed = "fault, onset and severity given"
            raise refusal("fault event", dict(value), allowed, f"add {spec.name!r}")
    return kind(**value)


def schedule_of(
    value: Sequence[Event | Mapping] | str | Path, kind: type[Event] = FaultEvent
) -> Schedule:
    """A schedule from events, mappings, or the path of a JSON file; an empty one is healthy."""
    if isinstance(value, str | Path):
        return load_schedule(value, kind)
    if isinstance(value, Mapping | bytes | bytearray) or not isinstance(value, Sequence):
        allowed = "a sequence of events or a path"
        raise refusal("schedule", value, allowed, "put the event into a list")
    return tuple(event_of(item, kind) for item in value)


def plain_events(schedule: Schedule) -> list[dict[str, Any]]:
    """The events as mappings without default values, which JSON can have."""
    defaults = {spec.name: spec.default for spec in fields(Event)}
    events = []
    for row in map(asdict, schedule):
        not_default = {name: value for name, value in row.items() if value != defaults[name]}
        events.append(not_default)
    return events


def to_json(schedule: Schedule) -> str:
    """The schedule as JSON without default values; `from_json` returns it exactly."""
    return json.dumps(plain_events(schedule), indent=2)


def from_json(text: str, origin: str = "schedule", kind: type[Event] = FaultEvent) -> Schedule:
    """The schedule of a JSON text; broken JSON is refused with line and column."""
    try:
        events = json.loads(text)
    except json.JSONDecodeError as error:
        place = f"{origin}, line {error.lineno} column {error.colno}"
        raise refusal(place, error.msg, JSON_FORM, "correct that place") from None
    except (RecursionError, ValueError) as error:
        raise refusal(origin, str(error), JSON_FORM, "write plain events") from None
    if not isinstance(events, list):
        raise refusal(origin, type(events).__name__, JSON_FORM, "put the event into a list")
    return schedule_of(events, kind)


def load_schedule(path: str | Path, kind: type[Event] = FaultEvent) -> Schedule:
    """The schedule of a JSON file."""
    return from_json(text_of(path, "schedule file", "a readable JSON file"), str(path), kind)


class Events(NamedTuple):
    """The schedules of many lanes as arrays."""

    fault: np.ndarray  # (n_lanes, n_events) place among the faults' names, -1 for none
    profile: np.ndarray  # (n_lanes, n_events, 6), each a `SeverityProfile`


def profile_of(events: Events | EpisodePlan) -> SeverityProfile:
    """The profiles of all events as one `SeverityProfile` of arrays (n_lanes, n_events)."""
    return SeverityProfile(*np.moveaxis(events.profile, -1, 0))


def first_onset(events: Events | EpisodePlan) -> np.ndarray:
    """Onset [s] of the first event of each lane (n_lanes,), infinite for a healthy lane."""
    onset = np.where(events.fault >= 0, profile_of(events).onset, math.inf)
    return onset.min(axis=1, initial=math.inf)


def no_events(n_lanes: int, n_events: int) -> Events:
    """The events of healthy lanes: slots without a fault."""
    profile = np.zeros((n_lanes, n_events, len(PROFILE)))
    profile[:, :, PROFILE.index("onset")] = math.inf
    return Events(np.full((n_lanes, n_events), -1), profile)


def widened(columns: np.ndarray, blank: np.ndarray) -> np.ndarray:
    """The columns, followed by those of `blank` that they lack."""
    missing = blank[:, columns.shape[1] :]
    return np.concatenate([columns, missing], axis=1) if missing.size else columns


def with_events(present: Events, lanes: np.ndarray, events: Events) -> Events:
    """The present events of all lanes, but on `lanes` (m,) the given ones."""
    n_lanes = len(present.fault)
    n_events = events.fault.shape[1]
    empty = no_events(n_lanes, max(n_events, present.fault.shape[1]))
    fault = widened(present.fault, empty.fault)
    profile = widened(present.profile, empty.profile)
    fault[lanes] = empty.fault[lanes]
    fault[lanes, :n_events] = events.fault
    profile[lanes] = empty.profile[lanes]
    profile[lanes, :n_events] = events.profile
    return Events(fault, profile)


def events_of(schedules: Sequence[Schedule], names: Iterable[str] | None = None) -> Events:
    """The schedules (one per lane) as arrays, of faults with these names or of the plant's."""
    names = plant_faults() if names is None else names
    rows = {name: row for row, name in enumerate(names)}
    n_events = max(map(len, schedules), default=0)
    events = no_events(len(schedules), n_events)
    for lane, schedule in enumerate(schedules):
        for slot, event in enumerate(schedule):
            events.fault[lane, slot] = rows[event.fault]
            events.profile[lane, slot] = [getattr(event, name) for name in PROFILE]
    return events


def schedules_of(events: Events) -> list[Schedule]:
    """The schedule of every lane: the inverse of `events_of`."""
    names = list(plant_faults())
    schedules = []
    for faults, profiles in zip(*events, strict=True):
        present = faults >= 0
        rows = zip(faults[present], profiles[present].tolist(), strict=True)
        schedule = [FaultEvent(names[row], *profile) for row, profile in rows]
        schedules.append(tuple(schedule))
    return schedules


class ScheduleDistribution(Distribution):
    """A distribution of schedules; a subclass defines `schedule`, or the faster `sample_events`."""

    def schedule(self, random: np.random.Generator, vehicle: Vehicle) -> Schedule:
        """The schedule of one lane, of faults that the vehicle can have."""
        raise NotImplementedError

    def sample_events(self, key: np.ndarray, vehicle: Vehicle = TWO_SHAFTS) -> Events:
        """Events of many lanes at random, from their noise keys (n_lanes,)."""
        generators = generators_of(key, "fault_events")
        return events_of([schedule_of(self.schedule(random, vehicle)) for random in generators])

    def check(self, vehicle: Vehicle) -> None:
        """Refuse impossible schedules, and those of a lane that depend on other lanes."""
        schedules = schedules_of(self.sample_events(CHECKED_KEYS, vehicle))
        alone = [schedules_of(self.sample_events(key, vehicle))[0] for key in CHECKED_KEYS[:, None]]
        if schedules != alone:
            allowed = "the same schedule for a key whenever it is drawn"
            raise refusal("distribution", type(self).__name__, allowed, "use its generator only")
        for event in itertools.chain.from_iterable(schedules):
            if not plant_fault(event.fault).is_possible(vehicle):
                allowed = f"faults that {vehicle.name} can have"
                raise refusal("distribution", event.fault, allowed, "leave it out")


@dataclass(frozen=True)
class ScheduleSampler(ScheduleDistribution):
    """Random schedules, all quantities uniform within their ranges.

    A severity is at least the fault's own `least_severity`.

    Diagnosis classes are equally likely unless `prior` weighs them, as are the faults of a class.
    A vehicle has only faults of parts that it has.
    """

    prior: Mapping[str, float] = field(default_factory=dict)  # relative weight by class
    healthy: float = 0.2  # probability of a lane without a fault
    compound: float = 0.1  # probability of a second, different fault, if the prior allows for it
    severity: tuple[float, float] = (0.2, 1.0)
    onset: tuple[float, float] = (5.0, 30.0)  # s
    incipient: float = 0.25  # probability of a ramp
    ramp: tuple[float, float] = (2.0, 15.0)  # s
    intermittent: float = 0.1  # probability of `period` and `duty`
    period: tuple[float, float] = (2.0, 8.0)  # s
    duty: tuple[float, float] = (0.3, 0.7)
    repaired: float = 0.1  # probability of an end
    life: tuple[float, float] = (5.0, 20.0)  # s, from the onset to the end

    EVENTS = 2  # of a lane at most

    def __post_init__(self):
        for name in ("healthy", "compound", "incipient", "intermittent", "repaired"):
            finite_in_range(name, getattr(self, name), 0.0, 1.0)
        for name, high in {**LIMITS, "life": LONGEST}.items():
            pair_in_range(name, getattr(self, name), 0.0, high)
            object.__setattr__(self, name, tuple(getattr(self, name)))
        if self.life[0] <= 0.0:
            raise refusal("life", self.life, "a pair above 0", "let a fault last")
        if not isinstance(self.prior, Mapping):
            allowed = "a mapping of classes to weights"
            raise refusal("prior", self.prior, allowed, "write one, empty for equal weights")
        for name, weight in self.prior.items():
            known_name("class of the prior", name, _diagnoses())
            finite_in_range(f"prior of {name}", weight, 0.0, 1e12)
        if self.prior and not any(self.prior.values()):
            raise refusal(
                "prior",
                dict(self.prior),
                "some weight above 0",
                "give a class weight",
            )

    def weights(self, vehicle: Vehicle = TWO_SHAFTS) -> np.ndarray:
        """Probability of every fault of the catalogue on a vehicle, (n_faults,)."""
        diagnoses = _diagnoses()
        weight_of_others = 0.0 if self.prior else 1.0
        weights = np.array([self.prior.get(name, weight_of_others) for name in diagnoses])
        weights /= [diagnoses.count(name) for name in diagnoses]
        weights *= [fault.is_possible(vehicle) for fault in CATALOGUE.values()]
        if not weights.any():
            allowed = f"the weight of a fault that {vehicle.name} can have"
            remedy = f"weigh a class of {' or '.join(vehicle.sides)} or of the hull"
            raise refusal("prior", dict(self.prior), allowed, remedy)
        return weights / weights.sum()

    def sample_events(self, key: np.ndarray, vehicle: Vehicle = TWO_SHAFTS) -> Events:
        """Events of many lanes at random, from their noise keys (n_lanes,)."""
        least = np.array([one.least_severity for one in CATALOGUE.values()])
        return self.events_among(key, self.weights(vehicle), least)

    def events_among(self, key: np.ndarray, weights: np.ndarray, least: np.ndarray) -> Events:
        """Events of faults with these probabilities and least severities, both (n_faults,)."""
        n_columns = len(EventUniforms._fields)
        numbers = uniforms(key, STREAMS["fault_events"], self.EVENTS * n_columns)
        numbers = numbers.reshape(-1, self.EVENTS, n_columns)
        u = EventUniforms(*np.moveaxis(numbers, -1, 0))
        fault = _two_faults(u.fault, weights)
        severities = [np.maximum(end, least[fault]) for end in self.severity]
        onset = _within(self.onset, u.onset)
        is_intermittent = u.intermittent < self.intermittent
        ramp = _within(self.ramp, u.ramp)
        end = onset + _within(self.life, u.life)
        period = _within(self.period, u.period)
        duty = _within(self.duty, u.duty)
        profile = SeverityProfile(
            onset=onset,
            severity=_within(severities, u.severity),
            ramp=np.where(u.incipient < self.incipient, ramp, 0.0),
            end=np.where(u.repaired < self.repaired, end, math.inf),
            period=np.where(is_intermittent, period, 0.0),
            duty=np.where(is_intermittent, duty, 1.0),
        )
        is_present = self._presence(key, fault)
        events = no_events(*fault.shape)
        events.fault[is_present] = fault[is_present]
        events.profile[is_present] = np.stack(profile, axis=-1)[is_present]
        return events

    def _presence(self, key: np.ndarray, fault: np.ndarray) -> np.ndarray:
        """Whether each of two candidate faults (n_lanes, 2) strikes."""
        u = uniforms(key, STREAMS["number_of_faults"], 2)
        is_faulty = u[:, 0] >= self.healthy
        is_compound = (u > [self.healthy, 1 - self.compound]).all(axis=1)
        differs = fault[:, 1] != fault[:, 0]
        return np.stack([is_faulty, is_compound & differs], axis=1)

    def sample(self, seed: int) -> Schedule:
        """The schedule of the first episode of an environment with this seed."""
        whole_number("seed", seed, 0)
        seeds = np.array([seed % 2**64], np.uint64)
        key = episode_keys(seeds, np.zeros(1, np.uint64))
        events = self.sample_events(key)
        return schedules_of(events)[0]


def _diagnoses() -> list[str]:
    """Diagnosis class of every fault of the catalogue."""
    return [fault.diagnosis for fault in CATALOGUE.values()]


def _two_faults(chance: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Rows of two candidates, from uniform chances, both (n_lanes, 2), and weights (n_faults,).

    The second comes from what the first one leaves of the probability.
    """
    edges = np.cumsum(weights)
    first = np.searchsorted(edges[:-1], chance[:, 0], side="right")
    from_first = chance[:, 1] * (1.0 - weights[first])
    without_first = (edges[first] + from_first) % 1.0
    second = np.searchsorted(edges[:-1], without_first, side="right")
    return np.stack([first, second], axis=1)


def _within(limits: Sequence[float | np.ndarray], uniform: np.ndarray) -> np.ndarray:
    """Uniform numbers in (0, 1) moved to a range."""
    return limits[0] + (limits[1] - limits[0]) * uniform
