"""Logs of healthy simulated vehicles, and what a lesser logger keeps of them."""

from dataclasses import replace

import numpy as np

from auv_fault_env.channels import CHANNELS, COMMANDS
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS, MissionSampler
from auv_fault_env.parameters import PRESETS
from training.field.logs.log import Log
from training.field.vehicle_file import Column, VehicleFile
from training.rollouts import roll_out

from .fleet_logs import log_of

NAMES = list(CHANNELS)
PRESET = PRESETS["npsnet1995"]
FILE = VehicleFile(PRESET, {name: Column(name) for name in CHANNELS})
OFF = replace(
    PRESET,
    alpha=1.25 * PRESET.alpha,
    beta=0.8 * PRESET.beta,
    torque_constant=0.85 * PRESET.torque_constant,
    resistance=1.2 * PRESET.resistance,
    coulomb_friction=1.3 * PRESET.coulomb_friction,
)
LEGS = MissionSampler(n_legs=8)


def healthy_logs(
    vehicle=OFF, n=4, n_samples=900, mission=None, rudder=0.0, band=0.0, noise=1.0, seed=0
) -> list[Log]:
    """Logs of one vehicle, every second on the thesis' speed steps, or all on the mission given."""
    fleet = Fleet(n, vehicle, noise, noise, healthy_band=band, missions=LEGS)
    fleet.reset(range(seed, seed + n), schedules=[()] * n)
    drawn = [LEGS.sample_legs(fleet.state.key[k : k + 1])[0][0].tolist() for k in range(n)]
    missions = [mission or (MISSIONS["thesis"] if k % 2 else drawn[k]) for k in range(n)]
    waves = np.zeros((n_samples, n, 3))
    waves[:, :, 1] = rudder * (np.sin(0.05 * np.arange(n_samples)) > 0.0)[:, None]
    rolled = roll_out(fleet, range(seed, seed + n), n_samples, waves, [()] * n, missions)
    return [log_of(rolled.observations[:, k].astype(float)) for k in range(n)]


def kept(logs: list[Log], channels: tuple[str, ...], every: int = 1) -> list[Log]:
    """The logs with these readings alone, one sample of so many."""
    poor = []
    for log in logs:
        observation = np.full_like(log.observation, np.nan)
        commands = [NAMES.index(name) for name in COMMANDS]
        readings = [NAMES.index(name) for name in channels]
        observation[:, commands] = log.observation[:, commands]
        observation[::every, readings] = log.observation[::every, readings]
        poor.append(log._replace(observation=observation))
    return poor
