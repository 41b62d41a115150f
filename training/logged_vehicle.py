"""A vehicle to simulate, and its simulation as its logs would show it."""

import hashlib
import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from auv_fault_env.channels import CHANNELS, COMMANDS, INDEX
from auv_fault_env.faults import CATALOGUE, Fault
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MissionSampler
from auv_fault_env.parameters import PRESETS, SAMPLE_RATE, Vehicle, full_scale_factors

N_COMMANDS = len(COMMANDS)
DEFAULT_MISSIONS = MissionSampler()
OTHER_SIDE = {"port": "starboard", "starboard": "port"}


@dataclass(frozen=True)
class LoggedVehicle:
    """A vehicle, and what its logs show of it; by default that of the thesis and everything.

    `training.field.logged` makes it of a vehicle file.

    Attributes
    ----------
    vehicle
        The nominal vehicle, with as many shafts as the logs show.
    band, noise
        Where not the default: relative half-width of the healthy band by parameter of `Vehicle`;
        standard deviation by reading [its unit].
    channels
        Those that the logs have.
    sample_rate
        Of the logs [Hz].
    hidden
        How the names of the parameters begin whose faults the logs cannot show.
    missions
        Speeds and legs of its missions.
    """

    vehicle: Vehicle = PRESETS["thesis1992"]
    band: Mapping[str, float] = field(default_factory=dict)
    noise: Mapping[str, float] = field(default_factory=dict)
    channels: tuple[str, ...] = tuple(CHANNELS)
    sample_rate: float = SAMPLE_RATE
    hidden: tuple[str, ...] = ()
    missions: MissionSampler = DEFAULT_MISSIONS

    def fleet(
        self,
        n_lanes: int,
        realism: float,
        imperfections: Sequence[str] | None = None,
        more_faults: Sequence[Fault] = (),
    ) -> Fleet:
        """Vehicles of its healthy band, with its noise."""
        return Fleet(
            n_lanes,
            self.vehicle,
            missions=self.missions,
            realism=realism,
            imperfections=imperfections,
            more_faults=more_faults,
            band=self.band,
            noise=self.noise,
        )

    @property
    def faults(self) -> tuple[str, ...]:
        """The faults of the catalogue that the logs can show."""
        return tuple(fault.name for fault in CATALOGUE.values() if self.shows(fault))

    def shows(self, fault: Fault) -> bool:
        """Whether the logs can show a fault."""
        return not changes_parameter(fault, self.hidden)

    @property
    def bank(self) -> dict[str, Any]:
        """Settings of a filter bank for this vehicle, where not the default; plain data."""
        settings = {"band": dict(self.band), "noise": dict(self.noise)}
        if self.hidden:
            settings["faults"] = list(self.faults)
        return {name: setting for name, setting in settings.items() if setting}

    @property
    def speed_factor(self) -> float:
        """Its speeds relative to those of `thesis1992`."""
        return full_scale_factors(self.vehicle)["m/s"]

    @property
    def is_symmetric(self) -> bool:
        """Whether port and starboard can be exchanged."""
        return set(map(other_side, self.channels)) == set(self.channels)

    @cached_property
    def digest(self) -> str:
        """SHA-256 of all of this, by which two vehicles are compared."""
        text = json.dumps(asdict(self), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()

    def as_logged(self, observations: np.ndarray) -> np.ndarray:
        """What a log has of a simulation (n_samples, n_lanes, n_channels), float32.

        A reading is NaN where none is logged, as in `training.field.logs.log.Log`.
        """
        if set(self.channels) == set(CHANNELS) and self.sample_rate >= SAMPLE_RATE:
            return observations
        n_samples = len(observations)
        rows = logged_rows(n_samples, self.sample_rate)
        last_row = rows[np.searchsorted(rows, np.arange(n_samples), side="right") - 1]
        shown = self._shown(observations.reshape(-1, len(CHANNELS))).reshape(observations.shape)
        logged = np.full_like(observations, np.nan)
        logged[rows] = shown[rows]
        logged[:, :, :N_COMMANDS] = shown[last_row, :, :N_COMMANDS]
        return logged

    def _shown(self, observations: np.ndarray) -> np.ndarray:
        """The channels of the logs, of observations (n_rows, n_channels)."""
        values = {channel: observations[:, INDEX[channel]] for channel in self.channels}
        if "mission_speed" in values and "speed_command" not in values:
            # one column for both is what the controller is asked for
            values["mission_speed"] = observations[:, INDEX["speed_command"]]
        return observations_of(values)


def logged_rows(n_samples: int, sample_rate: float) -> np.ndarray:
    """The samples at which a log of this rate [Hz] has a row, (n_rows,).

    >>> logged_rows(11, 4.0)
    array([ 0,  2,  5,  8, 10])
    """
    n_rows = math.ceil(n_samples * min(sample_rate / SAMPLE_RATE, 1.0)) + 1
    rows = np.rint(np.arange(n_rows) * max(SAMPLE_RATE / sample_rate, 1.0)).astype(int)
    return rows[rows < n_samples]


def observations_of(values: Mapping[str, np.ndarray]) -> np.ndarray:
    """All channels, (n_rows, n_channels), from the values by channel (n_rows,); NaN without values.

    Mission speed and speed command stand for each other where one is not logged; a fin that is not
    logged is amidships.
    """
    n_rows = len(next(iter(values.values())))
    observations = np.full((n_rows, len(CHANNELS)), np.nan)
    columns = {"rudder": np.zeros(n_rows), "stern_plane": np.zeros(n_rows)}
    if "speed_command" in values:
        columns["mission_speed"] = values["speed_command"]
    if "mission_speed" in values:
        columns["speed_command"] = values["mission_speed"]
    columns |= values
    for channel, column in columns.items():
        observations[:, INDEX[channel]] = column
    return observations


def changes_parameter(fault: Fault, beginnings: tuple[str, ...]) -> bool:
    """Whether a fault changes a parameter whose name begins so."""
    return any(name.startswith(beginnings) for name in (*fault.scale, *fault.offset))


def other_side(name: str) -> str:
    """The name with port and starboard exchanged."""
    return re.sub("starboard|port", lambda side: OTHER_SIDE[side[0]], name)


THESIS = LoggedVehicle()
