"""Training episodes: vehicles as they should be and as they are, on thesis' and random missions.

Half of the lanes has the thesis' stimulus, a quarter random missions, a quarter such missions with
rests; the last two have manoeuvres. Half of each has realism 1, the others one that is drawn for
all of them, with all imperfections or with some: a diagnoser that has met only all of them together
takes a reading that is better than usual for a failed sensor. The vehicle of a vehicle file has
random missions in place of the thesis' stimulus.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from auv_fault_env.faults import CATALOGUE
from auv_fault_env.layout import SeverityProfile
from auv_fault_env.missions import MISSIONS, Mission, MissionSampler
from auv_fault_env.noise import episode_keys
from auv_fault_env.parameters import SAMPLE_TIME
from auv_fault_env.realism import EFFECTS
from auv_fault_env.schedules import Events, ScheduleSampler
from diagnosers.diagnoser import last_values
from training.learning.unknown_faults import with_unknown_faults
from training.logged_vehicle import THESIS, LoggedVehicle
from training.rollouts import Rollout, manoeuvres, roll_out
from training.seeds import seeds

N_SAMPLES = 600  # 60 s
# for the cards of weights
KINDS = (
    "half with the thesis' stimulus, a quarter with random missions and manoeuvres, a quarter with "
    "such missions that begin or end at rest; half with realism 1, a sixth ideal, a third with "
    "realism up to 2, of which half with some of the imperfections"
)
IDEAL = 1 / 3  # probability that vehicles with a drawn realism are ideal
PARTLY_IDEAL = 1 / 3  # that they have some of the imperfections
LARGEST_REALISM = 2.0  # of all that are not ideal, uniform
AT_REST = 0.5  # probability of a rest, at the start and at the end alike, on missions with rests
REST = (0.05, 0.4)  # share of an episode
CONSTANT = 0.6  # share of the missions with rests that have one speed throughout


class Realism(NamedTuple):
    """How far the sensors and the surroundings of a rollout are from ideal, as `Fleet` takes it."""

    realism: float
    imperfections: tuple[str, ...] | None  # None for all


class Course(NamedTuple):
    """What the vehicles of a rollout do."""

    missions: Sequence[Mission] | None  # None for those of the fleet's sampler
    actions: np.ndarray | None  # (n_samples, n_lanes, 3), see `roll_out`
    start: np.ndarray  # (n_lanes,) end of the rest at the start [s]


def training_episodes(
    purpose: str,
    n_lanes: int,
    first: int = 0,
    schedules: ScheduleSampler | None = None,
    unknown: float = 0.0,
    vehicle: LoggedVehicle = THESIS,
) -> Iterator[Rollout]:
    """Rollouts of 60 s, n_lanes (a multiple of 4) together, with the readings of the logs.

    The seeds are those of `training.seeds.seeds` from the first-th on. `unknown` is the share of
    the faulty lanes whose fault belongs to no class.
    """
    chosen = seeds(purpose, n_lanes, first)
    middle = n_lanes // 2
    last = 3 * n_lanes // 4
    first_course = thesis_course if vehicle == THESIS else random_course
    parts = [(first_course, chosen[:middle]), (random_course, chosen[middle:last])]
    parts.append((course_with_rests, chosen[last:]))
    sampler = shown_by(vehicle, schedules or ScheduleSampler())
    for course, lanes in parts:
        n_real = (len(lanes) + 1) // 2
        yield _rollout(course, lanes[:n_real], Realism(1.0, None), sampler, unknown, vehicle)
        if drawn := lanes[n_real:]:
            realism = drawn_realism(drawn[0])
            yield _rollout(course, drawn, realism, sampler, unknown, vehicle)


def shown_by(vehicle: LoggedVehicle, sampler: ScheduleSampler) -> ScheduleSampler:
    """The sampler without the classes that the vehicle's logs cannot show."""
    if not vehicle.hidden:
        return sampler
    shown = {fault.diagnosis for fault in CATALOGUE.values() if vehicle.shows(fault)}
    classes = {fault.diagnosis: 1.0 for fault in CATALOGUE.values()} | dict(sampler.prior)
    return replace(sampler, prior={name: classes[name] * (name in shown) for name in classes})


def drawn_realism(seed: int) -> Realism:
    """A realism from 0 to `LARGEST_REALISM`, of all imperfections or of some."""
    random = np.random.default_rng(seed)
    chance, place = random.uniform(size=2)
    if chance < IDEAL:
        return Realism(0.0, None)
    realism = LARGEST_REALISM * place
    if chance >= IDEAL + PARTLY_IDEAL:
        return Realism(realism, None)
    names = list(EFFECTS)
    chosen = random.choice(names, random.integers(1, len(names)), replace=False)
    return Realism(realism, tuple(chosen.tolist()))


def _rollout(
    course_of: Callable[[range, LoggedVehicle], Course],
    lanes: range,
    realism: Realism,
    sampler: ScheduleSampler,
    unknown: float,
    vehicle: LoggedVehicle,
) -> Rollout:
    """The episodes of these seeds; no fault begins at rest before the mission."""
    course = course_of(lanes, vehicle)
    keys = episode_keys(np.array(lanes, np.uint64), np.zeros(len(lanes), np.uint64))
    events = later(sampler.sample_events(keys, vehicle.vehicle), course.start)
    random = np.random.default_rng([lanes[0], 1])
    events, faults = with_unknown_faults(events, unknown, random, vehicle)
    fleet = vehicle.fleet(len(lanes), *realism, faults)
    rollout = roll_out(fleet, lanes, N_SAMPLES, course.actions, events, course.missions)
    return rollout._replace(observations=vehicle.as_logged(rollout.observations))


def without_gaps(observations: np.ndarray) -> np.ndarray:
    """Observations (n_samples, n_lanes, n_channels) with the last reading where none arrived.

    Before the first it is zero, as in a `Recursive` diagnoser.
    """
    rows = observations.reshape(len(observations), -1)
    return np.nan_to_num(last_values(rows), nan=0.0).reshape(observations.shape)


def later(events: Events, delay: np.ndarray) -> Events:
    """The events of every lane, moved by a delay (n_lanes,) [s]."""
    profile = events.profile.copy()
    for name in ("onset", "end"):
        profile[:, :, SeverityProfile._fields.index(name)] += delay[:, None]
    return Events(events.fault, profile)


def thesis_course(lanes: range, vehicle: LoggedVehicle = THESIS) -> Course:
    """The thesis' speed changes."""
    return Course([MISSIONS["thesis"]] * len(lanes), None, np.zeros(len(lanes)))


def random_course(lanes: range, vehicle: LoggedVehicle = THESIS) -> Course:
    """Random missions, and manoeuvres on half of them."""
    return Course(None, waves(lanes, N_SAMPLES, vehicle), np.zeros(len(lanes)))


def waves(lanes: range, n_samples: int, vehicle: LoggedVehicle) -> np.ndarray:
    """The `manoeuvres` of these lanes, in proportion to the speeds of the vehicle."""
    return manoeuvres(lanes[0], n_samples, len(lanes)) * [vehicle.speed_factor, 1.0, 1.0]


def course_with_rests(
    lanes: range,
    vehicle: LoggedVehicle = THESIS,
    n_samples: int = N_SAMPLES,
    sampler: MissionSampler | None = None,
) -> Course:
    """Missions as whole ones are: at rest before and after, some with one speed throughout."""
    n_lanes = len(lanes)
    random = np.random.default_rng([lanes[0], 2])
    sampler = sampler or vehicle.missions
    duration = n_samples * SAMPLE_TIME
    is_at_rest = random.uniform(size=(n_lanes, 2)) < AT_REST
    rests = duration * is_at_rest * random.uniform(*REST, (n_lanes, 2))
    start, last_rest = rests.T
    n_legs = np.where(random.uniform(size=n_lanes) < CONSTANT, 1, sampler.n_legs)
    keys = episode_keys(np.array(lanes, np.uint64), np.zeros(n_lanes, np.uint64))
    legs, start_speed = sampler.sample_legs(keys, vehicle.vehicle.maximum_speed)
    end = duration - last_rest
    missions = [
        _with_rests(legs[lane, : n_legs[lane]], start_speed[lane], start[lane], end[lane])
        for lane in range(n_lanes)
    ]
    time = np.arange(n_samples)[:, None] * SAMPLE_TIME
    is_moving = (time >= start) & (time < end)
    actions = waves(lanes, n_samples, vehicle) * is_moving[:, :, None]
    return Course(missions, actions, start)


def _with_rests(legs: np.ndarray, start_speed: float, start: float, end: float) -> Mission:
    """The legs (n_legs, 2), at rest before the start and from the end on [s]."""
    rest = [(0.0, 0.0)] if start else []
    moved = [(start + time, speed) for time, speed in legs if start + time < end]
    return Mission((*rest, *moved, (end, 0.0)), 0.0 if start else start_speed)
