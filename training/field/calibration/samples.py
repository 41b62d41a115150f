"""Logs as the fits want them: one table of all missions, gaps between readings bridged, noise told from signal."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.signal import savgol_filter

from auv_fault_env.channels import INDEX, READINGS
from auv_fault_env.parameters import SAMPLE_RATE, SIDES
from auv_fault_env.physics import RPM
from training.field.logs.log import Log

BLOCK = 20.0  # s, within which errors may go together: some correlation times of the disturbance
SMOOTH = 31  # samples, in which the noise of speed readings averages out to a quarter
NORMAL_MAD = 1.4826  # standard deviation of a normal distribution by its median absolute deviation
SECOND_DIFFERENCE = 6**0.5  # its standard deviation by that of the noise
LEAST_READINGS = 20  # that tell of a channel's noise


class Samples(NamedTuple):
    """All missions on the 10 Hz grid, one after the other.

    starts (n_samples,): whether a stretch begins here. mission (n_samples,): index of the log.
    block (n_samples,): number of the `BLOCK` of time. reading (n_samples, n_channels): NaN where
    nothing was read. held, of the same shape: between the readings of a stretch interpolated; NaN
    only where a channel has none.
    """

    starts: np.ndarray
    mission: np.ndarray
    block: np.ndarray
    reading: np.ndarray
    held: np.ndarray

    def channel(self, name: str, held: bool = False) -> np.ndarray:
        """Readings of a channel, (n_samples,)."""
        return (self.held if held else self.reading)[:, INDEX[name]]

    def exists(self, name: str) -> bool:
        """Whether the channel was ever read."""
        return bool(np.isfinite(self.channel(name)).any())

    def of(self, chosen: np.ndarray) -> "Samples":
        """Those samples (n_samples,) alone; whole missions, so that no stretch is cut."""
        return Samples(*(part[chosen] for part in self))

    @property
    def since_start(self) -> np.ndarray:
        """Number of samples since the beginning of the stretch, (n_samples,)."""
        index = np.arange(len(self.starts))
        return index - np.maximum.accumulate(np.where(self.starts, index, 0))

    @property
    def deflection(self) -> np.ndarray:
        """Squared and summed deflections [rad^2], (n_samples,); a missing plane does not move."""
        return sum(
            np.nan_to_num(self.channel(name, held=True)) ** 2 for name in ("rudder", "stern_plane")
        )

    @property
    def smooth_speed(self) -> np.ndarray:
        """Surge speed [m/s], (n_samples,), as read, a parabola through `SMOOTH`; as commanded if it is not logged."""
        speed = self.channel("speed" if self.exists("speed") else "speed_command", held=True)
        stretches = np.split(speed, np.flatnonzero(self.starts)[1:])
        return np.concatenate([savgol_filter(one, SMOOTH, 2, mode="nearest") for one in stretches])

    @property
    def measured_spins(self) -> np.ndarray | None:
        """Shaft speeds [rad/s], (n_samples, 2); a shaft without a counter turns as the other; None if none has one."""
        turning = [
            self.channel(f"{side}_rpm", held=True) / RPM
            for side in SIDES
            if self.exists(f"{side}_rpm")
        ]
        return np.column_stack([turning[0], turning[-1]]) if turning else None


def samples_of(logs: Sequence[Log]) -> Samples:
    """All stretches of all logs; a log's blocks of time are counted on from those before."""
    parts = []
    blocks = 0
    for mission, log in enumerate(logs):
        for segment in log.segments:
            reading = np.asarray(log.observation[segment], np.float64)
            index = np.arange(len(reading))
            block = blocks + index // round(BLOCK * SAMPLE_RATE)
            blocks = block[-1] + 1
            held = np.column_stack([_bridged(column) for column in reading.T])
            parts.append(Samples(index == 0, np.full(len(index), mission), block, reading, held))
    return Samples(*map(np.concatenate, zip(*parts, strict=True)))


def _bridged(column: np.ndarray) -> np.ndarray:
    known = np.flatnonzero(np.isfinite(column))
    return (
        np.interp(np.arange(column.size), known, column[known])
        if known.size
        else np.full(column.size, np.nan)
    )


def noise_levels(samples: Samples) -> dict[str, float]:
    """Standard deviation of the noise of every reading that exists, robust, from second differences.

    Misleads at one reading a second, where the signal itself bends between readings: then it is an
    upper limit. A channel that hardly ever changes (a coarse converter) has the root mean square
    instead, a constant one no level.
    """
    levels = {}
    for name in filter(samples.exists, READINGS):
        bends = (
            np.concatenate([_bends(column) for column in _stretches(samples, name)])
            / SECOND_DIFFERENCE
        )
        if bends.size >= LEAST_READINGS:
            levels[name] = float(
                NORMAL_MAD * np.median(np.abs(bends)) or np.sqrt(np.mean(bends**2))
            )
    return {name: level for name, level in levels.items() if level > 0.0}


def _bends(column: np.ndarray) -> np.ndarray:
    return np.diff(column[np.isfinite(column)], 2)


def _stretches(samples: Samples, name: str) -> list[np.ndarray]:
    return np.split(samples.channel(name), np.flatnonzero(samples.starts)[1:])
