"""The mission: the speed that the vehicle is asked to have, leg by leg."""

import numbers
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from auv_fault_env.channels import INDEX, MAXIMUM_COMMAND
from auv_fault_env.distributions import CHECKED_KEYS, Distribution, generators_of
from auv_fault_env.errors import (
    InputError,
    finite_in_range,
    known_name,
    pair_in_range,
    refusal,
    whole_number,
)
from auv_fault_env.noise import STREAMS, uniforms
from auv_fault_env.parameters import FASTEST, FOOT, SAMPLE_TIME

LONGEST = 1e12  # s


@dataclass(frozen=True)
class Mission:
    """Mission speed in legs, and the speed at the start: that of the first leg if None.

    A vehicle refuses one that is faster than its largest command.
    """

    legs: tuple[tuple[float, float], ...]  # (start [s], speed [m/s]), ascending, the first at 0 s
    start_speed: float | None = None  # m/s

    def __post_init__(self):
        legs = tuple(_checked_leg(start, speed) for start, speed in self.legs)
        starts = [start for start, _ in legs]
        if not legs or starts[0] != 0.0 or sorted(set(starts)) != starts:
            allowed = "start times that begin at 0 and ascend"
            raise refusal("mission legs", starts, allowed, "order the legs")
        start_speed = legs[0][1] if self.start_speed is None else self.start_speed
        start_speed = finite_in_range("mission speed", start_speed, 0.0, FASTEST)
        object.__setattr__(self, "legs", legs)
        object.__setattr__(self, "start_speed", start_speed)


def _checked_leg(start: float, speed: float) -> tuple[float, float]:
    start = finite_in_range("start of a mission leg", start, 0.0, LONGEST)
    return start, finite_in_range("mission speed", speed, 0.0, FASTEST)


# V.D of the thesis: 0.5 ft/s, at 10 s 1.0 ft/s, at 20 s 0.5 ft/s, and so on
ALTERNATING_LEGS = tuple((10.0 * leg, FOOT * (0.5, 1.0)[leg % 2]) for leg in range(12))
MISSIONS: dict[str, Mission] = {
    "thesis": Mission(ALTERNATING_LEGS),
    # V.C of the thesis: from rest to 1.5 ft/s
    "acceleration": Mission(((0.0, 1.5 * FOOT),), start_speed=0.0),
    "cruise": Mission(((0.0, FOOT),)),
}


def mission_of(value: "Mission | str | float | Sequence | Mapping") -> Mission:
    """A mission, or that of a name in `MISSIONS`, a speed [m/s], a list of legs or its fields."""
    if isinstance(value, Mission):
        return value
    if isinstance(value, str):
        return MISSIONS[known_name("mission", value, MISSIONS)]
    try:
        if isinstance(value, Mapping):
            return Mission(**value)
        if isinstance(value, numbers.Real):
            return Mission(((0.0, value),))
        return Mission(tuple((start, speed) for start, speed in value))
    except InputError:
        raise
    except (TypeError, ValueError):
        allowed = "a name, a speed or a list of (start, speed)"
        raise refusal("mission", value, allowed, "write one of these") from None


def legs_of(missions: Sequence[Mission]) -> tuple[np.ndarray, np.ndarray]:
    """Legs (n_lanes, n_legs, 2) and start speeds (n_lanes,) of the missions.

    Legs that a mission lacks begin at infinity.
    """
    n_legs = max(len(mission.legs) for mission in missions)
    legs = np.full((len(missions), n_legs, 2), np.inf)
    for lane, mission in enumerate(missions):
        legs[lane, : len(mission.legs)] = mission.legs
    return legs, np.array([mission.start_speed for mission in missions])


def missions_of(legs: np.ndarray, start_speed: np.ndarray) -> list[Mission]:
    """The mission of every lane: the inverse of `legs_of`."""
    return [
        Mission(tuple(map(tuple, rows[np.isfinite(rows[:, 0])])), speed)
        for rows, speed in zip(legs, start_speed, strict=True)
    ]


class MissionDistribution(Distribution):
    """A distribution of missions; a subclass defines `mission`, or the faster `sample_legs`."""

    def mission(self, random: np.random.Generator, maximum_speed: float) -> Mission:
        """The mission of one lane, of speeds up to the vehicle's largest command [m/s]."""
        raise NotImplementedError

    def sample_legs(
        self, key: np.ndarray, maximum_speed: float = MAXIMUM_COMMAND
    ) -> tuple[np.ndarray, np.ndarray]:
        """Random legs (n_lanes, n_legs, 2) and start speeds (n_lanes,), from noise keys."""
        generators = generators_of(key, "mission")
        return legs_of([mission_of(self.mission(random, maximum_speed)) for random in generators])

    def check(self, maximum_speed: float) -> None:
        """Refuse impossible missions, and those of a lane that depend on other lanes."""
        missions = missions_of(*self.sample_legs(CHECKED_KEYS, maximum_speed))
        keys = CHECKED_KEYS[:, None]
        alone = [missions_of(*self.sample_legs(key, maximum_speed))[0] for key in keys]
        if missions != alone:
            allowed = "the same mission for a key whenever it is drawn"
            raise refusal("distribution", type(self).__name__, allowed, "use its generator only")
        for mission in missions:
            fastest = max(mission.start_speed, *(speed for _, speed in mission.legs))
            finite_in_range("mission speed", fastest, 0.0, maximum_speed)


@dataclass(frozen=True)
class MissionSampler(MissionDistribution):
    """Random missions: legs of uniform speed and duration, the last one without an end."""

    speed: tuple[float, float] = (0.15, 0.6)  # of the vehicle's largest command
    duration: tuple[float, float] = (8.0, 20.0)  # s
    n_legs: int = 5
    from_rest: float = 0.2  # probability of a start at rest, otherwise in motion

    def __post_init__(self):
        pair_in_range("speed of the legs", self.speed, 0.0, 1.0)
        pair_in_range("duration of the legs", self.duration, SAMPLE_TIME, LONGEST)
        for name in ("speed", "duration"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        whole_number("number of legs", self.n_legs)
        finite_in_range("from_rest", self.from_rest, 0.0, 1.0)

    def sample_legs(
        self, key: np.ndarray, maximum_speed: float = MAXIMUM_COMMAND
    ) -> tuple[np.ndarray, np.ndarray]:
        """Random legs (n_lanes, n_legs, 2) and start speeds (n_lanes,), from noise keys.

        maximum_speed: the vehicle's largest command [m/s].
        """
        u = uniforms(key, STREAMS["mission"], 2 * self.n_legs + 1)
        legs = np.empty((key.size, self.n_legs, 2))
        shortest, longest = self.duration
        durations = shortest + (longest - shortest) * u[:, : self.n_legs]
        legs[:, :, 0] = np.cumsum(durations, axis=1) - durations
        slowest, fastest = self.speed
        shares = slowest + (fastest - slowest) * u[:, self.n_legs : -1]
        legs[:, :, 1] = maximum_speed * shares
        start_at_rest = u[:, -1] < self.from_rest
        return legs, np.where(start_at_rest, 0.0, legs[:, 0, 1])


def follow_mission(observation: np.ndarray) -> np.ndarray:
    """Actions (n_lanes, 3) that command the mission speed of the observation, fins amidships."""
    return observation[:, INDEX["mission_speed"], None] * [1.0, 0.0, 0.0]
