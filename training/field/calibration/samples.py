"""Logs as the fits need them: one table of all missions, gaps interpolated, and noise levels."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.signal import savgol_filter

from auv_fault_env.channels import INDEX, READINGS
from auv_fault_env.parameters import SAMPLE_RATE, SIDES
from auv_fault_env.physics import RPM
from training.field.logs.log import Log

# s, within which errors may be correlated: some correlation times of the disturbance
BLOCK = 20.0
# samples of a parabola through speed readings, which leaves a quarter of their noise
SMOOTHING_SAMPLES = 31
NORMAL_MAD = 1.4826  # standard deviation of a normal distribution by its median absolute deviation
SECOND_DIFFERENCE = 6**0.5  # its standard deviation by that of the noise
LEAST_READINGS = 20  # for an estimate of a channel's noise


class Samples(NamedTuple):
    """All missions on the 10 Hz grid, one after the other."""

    starts: np.ndarray  # whether a segment begins with the sample, (n_samples,)
    mission: np.ndarray  # index of the log, (n_samples,)
    block: np.ndarray  # number of the `BLOCK` of time, (n_samples,)
    reading: np.ndarray  # (n_samples, n_channels), NaN where no reading arrived
    # between the readings of a segment; NaN only for a channel without readings
    interpolated: np.ndarray

    def channel(self, name: str) -> np.ndarray:
        """Readings of a channel, (n_samples,)."""
        return self.reading[:, INDEX[name]]

    def interpolated_channel(self, name: str) -> np.ndarray:
        """Interpolated readings of a channel, (n_samples,)."""
        return self.interpolated[:, INDEX[name]]

    def has(self, name: str) -> bool:
        """Whether the channel has any reading."""
        return bool(np.isfinite(self.channel(name)).any())

    def where(self, is_chosen: np.ndarray) -> "Samples":
        """The chosen samples (n_samples,); whole missions, so that no segment is cut."""
        return Samples(*(column[is_chosen] for column in self))

    @property
    def since_start(self) -> np.ndarray:
        """Number of samples since the beginning of the segment, (n_samples,)."""
        index = np.arange(len(self.starts))
        return index - np.maximum.accumulate(np.where(self.starts, index, 0))

    @property
    def deflection(self) -> np.ndarray:
        """Squared and summed deflections [rad^2], (n_samples,); a missing plane does not move."""
        rudder = np.nan_to_num(self.interpolated_channel("rudder"))
        stern_plane = np.nan_to_num(self.interpolated_channel("stern_plane"))
        return rudder**2 + stern_plane**2

    @property
    def smoothed_speed(self) -> np.ndarray:
        """Surge speed [m/s], (n_samples,), smoothed; the commanded one if no speed is logged."""
        name = "speed" if self.has("speed") else "speed_command"
        speed = self.interpolated_channel(name)
        segments = np.split(speed, np.flatnonzero(self.starts)[1:])
        smoothed = [
            savgol_filter(segment, SMOOTHING_SAMPLES, 2, mode="nearest") for segment in segments
        ]
        return np.concatenate(smoothed)

    @property
    def measured_shaft_speeds(self) -> np.ndarray | None:
        """Shaft speeds [rad/s], (n_samples, 2), a missing one as the other; None without any."""
        names = [f"{side}_rpm" for side in SIDES]
        speeds = [self.interpolated_channel(name) / RPM for name in names if self.has(name)]
        return np.column_stack([speeds[0], speeds[-1]]) if speeds else None


def samples_of(logs: Sequence[Log]) -> Samples:
    """All segments of all logs; the numbers of blocks go on from log to log."""
    segments = []
    n_blocks = 0
    for mission, log in enumerate(logs):
        for segment in log.segments:
            reading = np.asarray(log.observation[segment], np.float64)
            index = np.arange(len(reading))
            block = n_blocks + index // round(BLOCK * SAMPLE_RATE)
            n_blocks = block[-1] + 1
            interpolated = np.column_stack([_interpolated(column) for column in reading.T])
            missions = np.full(len(index), mission)
            segments.append(Samples(index == 0, missions, block, reading, interpolated))
    return Samples(*map(np.concatenate, zip(*segments, strict=True)))


def _interpolated(column: np.ndarray) -> np.ndarray:
    known = np.flatnonzero(np.isfinite(column))
    if not known.size:
        return np.full(column.size, np.nan)
    return np.interp(np.arange(column.size), known, column[known])


def noise_levels(samples: Samples) -> dict[str, float]:
    """Standard deviation of the noise of every reading, robust, from second differences.

    Misleads at one reading a second, where the signal itself bends between readings: then it is an
    upper limit. A channel that hardly ever changes (a coarse converter) has the root mean square
    instead, a constant one no level.
    """
    segment_starts = np.flatnonzero(samples.starts)[1:]
    levels = {}
    for name in filter(samples.has, READINGS):
        segments = np.split(samples.channel(name), segment_starts)
        differences = np.concatenate([_second_differences(segment) for segment in segments])
        noise = differences / SECOND_DIFFERENCE
        if noise.size >= LEAST_READINGS:
            robust_std = NORMAL_MAD * np.median(np.abs(noise))
            levels[name] = float(robust_std or np.sqrt(np.mean(noise**2)))
    return {name: level for name, level in levels.items() if level > 0.0}


def _second_differences(column: np.ndarray) -> np.ndarray:
    return np.diff(column[np.isfinite(column)], 2)
