"""Whole missions of healthy vehicles, from rest to rest, of minutes to hours."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import MAXIMUM_COMMAND
from auv_fault_env.errors import finite_in_range, pair_in_range
from auv_fault_env.missions import Mission
from auv_fault_env.noise import STREAMS, uniforms
from auv_fault_env.parameters import SAMPLE_TIME

SHORTEST = 60.0  # s
LONGEST = 86_400.0  # s
LARGEST_REST = 0.25  # share of a mission that a rest takes at most, at each end


class WholeMission(NamedTuple):
    """A mission and how long it lasts."""

    mission: Mission
    duration: float  # s, a whole number of samples


@dataclass(frozen=True)
class WholeMissionSampler:
    """Random missions from rest to rest: one speed throughout, or leg by leg.

    Durations and rests are log-uniform, speeds and legs uniform. At rest the speed command is 0
    and the motors are off.
    """

    duration: tuple[float, float] = (60.0, 7200.0)  # s, with both rests
    rest: tuple[float, float] = (10.0, 240.0)  # s, at each end, at most `LARGEST_REST`
    speed: tuple[float, float] = (0.15, 0.6)  # m/s
    leg: tuple[float, float] = (8.0, 300.0)  # s
    constant: float = 0.3  # share of the missions with one speed throughout

    def __post_init__(self):
        limits = {
            "duration": (SHORTEST, LONGEST),
            "rest": (SAMPLE_TIME, LONGEST),
            "speed": (0.0, MAXIMUM_COMMAND),
            "leg": (1.0, LONGEST),
        }
        for name, allowed in limits.items():
            pair = pair_in_range(f"{name} of whole missions", getattr(self, name), *allowed)
            object.__setattr__(self, name, pair)
        finite_in_range("share of constant speed", self.constant, 0.0, 1.0)

    def sample(self, key: np.ndarray) -> list[WholeMission]:
        """Missions from noise keys (n_lanes,)."""
        most_legs = math.ceil(self.duration[1] / self.leg[0])
        numbers = uniforms(key, STREAMS["mission"], 4 + 2 * most_legs)
        return [self._mission(row[:4], row[4::2], row[5::2]) for row in numbers]

    def durations(self, key: np.ndarray) -> np.ndarray:
        """Durations [s] of the missions of these noise keys, both (n_lanes,)."""
        place = uniforms(key, STREAMS["mission"], 1)[:, 0]
        return np.round(_log_uniform(self.duration, place), 1)

    def _mission(
        self, chance: np.ndarray, of_length: Sequence[float], of_speed: Sequence[float]
    ) -> WholeMission:
        duration = round(float(_log_uniform(self.duration, chance[0])), 1)
        rests = np.minimum(_log_uniform(self.rest, chance[1:3]), LARGEST_REST * duration)
        first_rest, last_rest = np.round(rests, 1).tolist()
        end = round(duration - last_rest, 1)
        is_constant = chance[3] < self.constant
        legs = [(0.0, 0.0)]
        start = first_rest
        for length, speed in zip(of_length, of_speed, strict=True):
            legs.append((start, round(_uniform(self.speed, speed), 4)))
            start = round(start + _uniform(self.leg, length), 1)
            if is_constant or start >= end:
                break
        return WholeMission(Mission((*legs, (end, 0.0)), 0.0), duration)


def _uniform(limits: tuple[float, float], place: float) -> float:
    return float(limits[0] + (limits[1] - limits[0]) * place)


def _log_uniform(limits: tuple[float, float], place):
    """Log-uniform numbers from uniform ones, alone or an array."""
    return limits[0] * (limits[1] / limits[0]) ** place
