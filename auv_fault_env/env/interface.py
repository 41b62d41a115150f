"""What both forms of the environment share: spaces, options of a reset, order of the calls."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

import gymnasium as gym
import numpy as np

from auv_fault_env.errors import known_name, refusal
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MissionDistribution, MissionSampler
from auv_fault_env.parameters import Vehicle, channels_of, vehicle_of
from auv_fault_env.schedules import (
    Schedule,
    ScheduleDistribution,
    ScheduleSampler,
    schedule_of,
)


def vehicle_of_argument(preset: str | Vehicle | Mapping) -> Vehicle:
    """The vehicle of a preset's name, a `Vehicle`, or that of its fields."""
    if not isinstance(preset, Mapping):
        return vehicle_of(preset)
    for name in preset:
        known_name("field of the vehicle", name, [spec.name for spec in fields(Vehicle)])
    return Vehicle(**preset)


def box(names: Sequence[str], vehicle: Vehicle) -> gym.spaces.Box:
    """The space of these channels of a vehicle."""
    channels = channels_of(vehicle)
    low = np.array([channels[name].low for name in names], np.float32)
    high = np.array([channels[name].high for name in names], np.float32)
    return gym.spaces.Box(low, high, dtype=np.float32)


class WithFleet:
    """An environment over a fleet, whose distributions can be changed."""

    fleet: Fleet

    def set_distributions(
        self,
        schedules: ScheduleDistribution | Mapping | None = None,
        missions: MissionDistribution | Mapping | None = None,
    ) -> None:
        """Draw the next episodes from these, for a curriculum; None keeps the present one.

        The present episode goes on, and `spec` stays that of the environment as it was made.
        """
        if schedules is not None:
            schedules = ScheduleDistribution.of(schedules, ScheduleSampler)
            schedules.check(self.fleet.vehicle)
        if missions is not None:
            missions = MissionDistribution.of(missions, MissionSampler)
            missions.check(self.fleet.vehicle.maximum_speed)
        self.fleet.schedules = schedules or self.fleet.schedules
        self.fleet.missions = missions or self.fleet.missions


def outcome_info(outcomes: np.ndarray) -> dict[str, Any]:
    """What the `outcomes` of a fleet (4, ...) add to the information of a step."""
    _, energy, cost, mission_speed = outcomes
    return {"mission_speed": mission_speed, "energy": energy, "cost": cost}


def masked(info: dict[str, Any], mask: np.ndarray) -> dict[str, Any]:
    """The information of a vector environment, and for each name a mask ``_name`` (num_envs,).

    As in Gymnasium the mask says which lanes have the entry.
    """
    marked = {}
    for name, entry in info.items():
        marked[name] = masked(entry, mask) if isinstance(entry, dict) else entry
        marked[f"_{name}"] = mask
    return marked


def known_options(options: dict[str, Any] | None, names: Sequence[str]) -> dict[str, Any]:
    """The options of a reset, if all have one of these names."""
    if not isinstance(options, Mapping | None):
        raise refusal("reset options", options, "a mapping", f"give some of {', '.join(names)}")
    for name in options or {}:
        known_name("reset option", name, names)
    return options or {}


def need_reset(started: bool, call: str) -> None:
    """Refuse a call, `step` or `render`, that is only possible after a reset."""
    if not started:
        allowed = f"{call} after a reset"
        message = f"{call}: got no reset before; allowed is {allowed}; call reset() first"
        raise gym.error.ResetNeeded(message)


def checked_schedule(value, end: float) -> Schedule:
    """The schedule, if all its faults begin before the end [s] of the episode."""
    schedule = schedule_of(value)
    for event in schedule:
        if event.onset >= end:
            allowed = f"before the episode's end at {end:g} s"
            remedy = "begin earlier, or raise max_episode_steps"
            raise refusal(f"onset of {event.fault}", event.onset, allowed, remedy)
    return schedule
