"""Propulsion faults of an autonomous underwater vehicle, as Gymnasium environments.

Importing this package registers ``auv_fault_env/Propulsion-v0``.
"""

import gymnasium as gym

from auv_fault_env.channels import CHANNELS, Channel
from auv_fault_env.faults import CATALOGUE, Fault, classes, labels
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS, Mission, MissionDistribution, MissionSampler
from auv_fault_env.parameters import PARAMETERS, PRESETS, Vehicle
from auv_fault_env.schedules import (
    FaultEvent,
    ScheduleDistribution,
    ScheduleSampler,
    from_json,
    load_schedule,
    to_json,
)
from auv_fault_env.unmodelled import UNMODELLED

__all__ = [
    "CATALOGUE",
    "CHANNELS",
    "MISSIONS",
    "PARAMETERS",
    "PRESETS",
    "UNMODELLED",
    "Channel",
    "Fault",
    "FaultEvent",
    "Fleet",
    "Mission",
    "MissionDistribution",
    "MissionSampler",
    "ScheduleDistribution",
    "ScheduleSampler",
    "Vehicle",
    "classes",
    "from_json",
    "labels",
    "load_schedule",
    "to_json",
]

gym.register(
    id="auv_fault_env/Propulsion-v0",
    entry_point="auv_fault_env.env:PropulsionEnv",
    vector_entry_point="auv_fault_env.env:PropulsionVectorEnv",
    max_episode_steps=600,
)
