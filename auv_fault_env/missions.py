"""The mission: which speed the vehicle is asked to keep, leg by leg."""

import numbers
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from auv_fault_env.channels import INDEX, MAXIMUM_COMMAND
from auv_fault_env.errors import (
    InputError,
    finite_in_range,
    known_name,
    pair_in_range,
    refusal,
    whole_number,
)
from auv_fault_env.noise import STREAMS, uniforms
from auv_fault_env.parameters import FOOT, SAMPLE_TIME


@dataclass(frozen=True)
class Mission:
    """Mission speed in legs.

    Attributes
    ----------
    legs
        Pairs (start [s], speed [m/s]), the first at 0 s, in ascending order.
    start_speed
        Speed [m/s] at which the vehicle starts in steady motion; None for that of the first leg, 0
        for rest.
    """

    legs: tuple[tuple[float, float], ...]
    start_speed: float | None = None

    def __post_init__(self):
        legs = tuple(
            (
                finite_in_range("start of a mission leg", start, 0.0, 1e12),
                finite_in_range("mission speed", speed, 0.0, MAXIMUM_COMMAND),
            )
            for start, speed in self.legs
        )
        starts = [start for start, _ in legs]
        if not legs or starts[0] != 0.0 or sorted(set(starts)) != starts:
            raise refusal(
                "mission legs", starts, "start times that begin at 0 and ascend", "order the legs"
            )
        start_speed = legs[0][1] if self.start_speed is None else self.start_speed
        start_speed = finite_in_range("mission speed", start_speed, 0.0, MAXIMUM_COMMAND)
        object.__setattr__(self, "legs", legs)
        object.__setattr__(self, "start_speed", start_speed)


MISSIONS: dict[str, Mission] = {
    # thesis V.D: 0.5 ft/s, at 10 s 1.0 ft/s, at 20 s 0.5 ft/s, and so on
    "thesis": Mission(tuple((10.0 * leg, FOOT * (0.5, 1.0)[leg % 2]) for leg in range(12))),
    # thesis V.C: from rest to 1.5 ft/s
    "acceleration": Mission(((0.0, 1.5 * FOOT),), start_speed=0.0),
    "cruise": Mission(((0.0, FOOT),)),
}


def mission_of(value: "Mission | str | float | Sequence | Mapping") -> Mission:
    """A mission from itself, a name of `MISSIONS`, a constant speed [m/s], a list of legs, or a mapping of fields."""
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
        raise refusal(
            "mission", value, "a name, a speed or a list of (start, speed)", "write one of these"
        ) from None


@dataclass(frozen=True)
class MissionSampler:
    """Missions of `n_legs` legs; a share of them starts at rest, the others in steady motion.

    Attributes
    ----------
    speed
        Range of the legs' speeds [m/s].
    duration
        Range of the legs' durations [s].
    n_legs
        Number of legs; the last one has no end.
    from_rest
        Probability of a start at rest.
    """

    speed: tuple[float, float] = (0.15, 0.6)
    duration: tuple[float, float] = (8.0, 20.0)
    n_legs: int = 5
    from_rest: float = 0.2

    def __post_init__(self):
        pair_in_range("speed of the legs", self.speed, 0.0, MAXIMUM_COMMAND)
        pair_in_range("duration of the legs", self.duration, SAMPLE_TIME, 1e12)
        whole_number("number of legs", self.n_legs)
        finite_in_range("from_rest", self.from_rest, 0.0, 1.0)

    def sample_legs(self, key: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Legs (n_lanes, n_legs, 2) and start speeds (n_lanes,) for lanes with the given noise keys (n_lanes,)."""
        u = uniforms(key, STREAMS["mission"], 2 * self.n_legs + 1)
        legs = np.empty((key.size, self.n_legs, 2))
        durations = self.duration[0] + (self.duration[1] - self.duration[0]) * u[:, : self.n_legs]
        legs[:, :, 0] = np.cumsum(durations, axis=1) - durations
        legs[:, :, 1] = self.speed[0] + (self.speed[1] - self.speed[0]) * u[:, self.n_legs : -1]
        return legs, np.where(u[:, -1] < self.from_rest, 0.0, legs[:, 0, 1])


def follow_mission(observation: np.ndarray) -> np.ndarray:
    """The actions (n_lanes, 3) that command the mission speed with rudder and stern plane amidships.

    observation is (n_lanes, n_channels).
    """
    return observation[:, INDEX["mission_speed"], None] * [1.0, 0.0, 0.0]
