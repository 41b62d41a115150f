"""The filters of all particles of one vehicle: normal ones, and those of every fault and slot.

The vehicle has three parts, surge and the two motors. A fault has filters in the parts that it
touches; elsewhere it shares the normal one. A motor takes the surge speed from the paddle wheel,
surge the shaft speeds from the counters, but for faults of these sensors, whose filters take each
other's estimates.
"""

import math
from collections.abc import Sequence

import numpy as np

from auv_fault_env.channels import READINGS
from auv_fault_env.parameters import PARAMETERS, SAMPLE_TIME
from auv_fault_env.physics import RPM, PlantConstants
from diagnosers.bank import pack, surge
from diagnosers.bank.algebra import N_STATES as N_SURGE_STATES
from diagnosers.bank.algebra import covariance_row
from diagnosers.bank.base import BankConstants
from diagnosers.bank.hypotheses import (
    N_PARAMETER_ROWS,
    OWN_PARAMETERS,
    PORT,
    STARBOARD,
    SURGE,
    filters_of_faults,
    of_sensors,
    parameter_indices,
    touched,
)
from diagnosers.bank.kernel import MOTOR_CHANNEL, SPEED_CHANNEL
from diagnosers.bank.motor import OF_RPM
from diagnosers.bank.sensors import NOISE_STD, new_sample
from diagnosers.gaussian_bank import GaussianBank
from training.bounds.posterior import motor
from training.bounds.posterior.surge import begin_sample, replace_severities, step_surge
from training.bounds.posterior.voltages import Voltages

SIDE_NAMES = {PORT: "port", STARBOARD: "starboard"}
JERK_STD = 0.02  # m/s^2 per square root of a second: change of the acceleration
# per square root of a second, of the severity while it grows: a ramp of another length explains it
GROWTH_STD = 0.03
START_ACCELERATION_STD = 0.05  # m/s^2


class Part:
    """The filters of one part of the vehicle: a normal one, then a block of slots per fault."""

    def __init__(self, number: int, faults: tuple[str, ...], n_slots: int, bank: GaussianBank):
        found = filters_of_faults(number, faults, np.arange(len(faults)))
        self.number = number
        self.faults = found.hypothesis[1:] - 1
        self.n_slots = n_slots
        self.block = np.full(len(faults), -1)
        self.block[self.faults] = np.arange(self.faults.size)
        self.slope = found.slope[1:].T
        self.offset = found.offset[1:].T
        particles = self.faults[:, None] * n_slots + np.arange(n_slots)
        self.particle = particles.ravel()  # of each column but the first
        self.share = np.zeros(self.particle.size)
        n_columns = 1 + self.particle.size
        self.columns = np.uint64(0), np.uint64(n_columns)
        is_surge = number == SURGE
        self.n_states = N_SURGE_STATES if is_surge else motor.N_STATES
        rows = {
            **(pack.N_ROWS if is_surge else motor.N_ROWS),
            **dict.fromkeys(pack.OWN_SINGLE_ROWS if is_surge else pack.SINGLE_ROWS),
            **dict.fromkeys(pack.EFFECTS, N_PARAMETER_ROWS),
        }
        self.work = pack.new_memory(rows, n_columns, motor.Parts(tuple(range(self.n_states))))
        indices = parameter_indices(OWN_PARAMETERS[number])
        self.work.healthy[: len(indices)] = bank.healthy[indices][:, None]

    @property
    def filters(self) -> np.ndarray:
        """Means and packed covariances, (n_moments, n_columns)."""
        return self.work.filters

    def places(self, fault: np.ndarray, slot: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which of these particles (n,) have a filter here, and its column."""
        has_filter = self.block[fault] >= 0
        column = 1 + self.block[fault] * self.n_slots + slot
        return has_filter, column[has_filter]

    def set_severity(self, column: np.ndarray, mean: np.ndarray, variance: np.ndarray) -> None:
        """Give filters a severity that is independent of their other states."""
        last = self.n_states - 1
        rows = [covariance_row(last, i, self.n_states) for i in range(last)]
        self.filters[np.ix_(rows, column)] = 0.0
        self.filters[last, column] = mean
        self.filters[covariance_row(last, last, self.n_states), column] = variance

    def scale_effects(self, share: np.ndarray) -> None:
        """Let the severities of all particles have these shares of the full ones."""
        here = share.ravel()[self.particle]
        changed = np.flatnonzero(here != self.share)
        block = changed // self.n_slots
        self.work.slope[:, 1 + changed] = self.slope[:, block] * here[changed]
        self.work.offset[:, 1 + changed] = self.offset[:, block] * here[changed]
        self.share = here

    def take_severities(self, mean: np.ndarray, variance: np.ndarray) -> None:
        """Replace the severities by those of all particles, (n_particles,) each."""
        self.work.severity[0, 1:] = mean[self.particle]
        self.work.severity[1, 1:] = variance[self.particle]
        replace_severities(*self.columns, self.work)

    def give_severities(self, mean: np.ndarray, variance: np.ndarray) -> None:
        """Write the severities into those of all particles."""
        last = self.n_states - 1
        mean[self.particle] = self.filters[last, 1:]
        variance[self.particle] = self.filters[covariance_row(last, last, self.n_states), 1:]


class VehicleFilters:
    """All filters of a vehicle, as `population.Branches`; `bank` is the model of the vehicle."""

    def __init__(
        self,
        bank: GaussianBank,
        faults: tuple[str, ...],
        limits: np.ndarray,
        voltages: Voltages,
        n_slots: int,
    ):
        """Begin an episode; limits (n_faults, 2) of the severities."""
        self._constants: BankConstants = bank.constants
        self._water: PlantConstants = bank.constants.water
        self._voltages = voltages
        self._shape = len(faults), n_slots
        self._low, self._high = np.repeat(limits, n_slots, axis=0).T
        self._mean = np.zeros(len(faults) * n_slots)
        self._variance = np.zeros(len(faults) * n_slots)
        self.parts = [Part(number, faults, n_slots, bank) for number in (PORT, STARBOARD, SURGE)]
        self._start_surge = bank.initial(1).filters[0, :, bank.hypotheses().first_filter[SURGE]]
        self._sample = new_sample(1)
        self._readings = np.full((1, len(READINGS)), np.nan)
        self._noise = bank.constants.sensors[:, NOISE_STD]
        self._paddle = PaddleWheel(self._noise[SPEED_CHANNEL])
        self._k = 0
        port, starboard, surge_part = self.parts
        self._own_speed = [
            shared_particles(part, surge_part, touched(faults, of_sensors("speed")))
            for part in (port, starboard)
        ]
        self._own_rpm = [
            shared_particles(
                surge_part, part, touched(faults, of_sensors(f"{SIDE_NAMES[part.number]}_rpm"))
            )
            for part in (port, starboard)
        ]

    def branch(self, fault, slot, mean, variance) -> None:
        """See `population.Branches.branch`."""
        particle = fault * self._shape[1] + slot
        self._mean[particle] = mean
        self._variance[particle] = variance
        for part in self.parts:
            here, column = part.places(fault, slot)
            part.filters[:, column] = part.filters[:, :1]
            part.set_severity(column, mean[here], variance[here])
            if part.number == SURGE:
                for shaft in (part.work.port, part.work.starboard):
                    shaft[:, column] = shaft[:, :1]

    def copy(self, fault, parent, slot, severity) -> None:
        """See `population.Branches.copy`."""
        faults = np.full(slot.size, fault)
        particle = fault * self._shape[1] + slot
        self._mean[particle] = severity
        self._variance[particle] = 0.0
        for part in self.parts:
            here, column = part.places(faults, slot)
            _, source = part.places(faults, parent)
            part.filters[:, column] = part.filters[:, source]
            part.set_severity(column, severity[here], 0.0)
            if part.number == SURGE:
                for shaft in (part.work.port, part.work.starboard):
                    shaft[:, column] = shaft[:, source]

    def severities(self):
        """See `population.Branches.severities`."""
        return self._mean.reshape(self._shape), self._variance.reshape(self._shape)

    def step(self, observation, share):
        """See `population.Branches.step`."""
        begin_sample(observation[None], self._readings, self._constants.sensors, self._sample)
        reading = self._sample.reading[:, 0]
        speed = self._paddle.mean_speed(reading[SPEED_CHANNEL])
        if self._k == 0:
            self._begin(reading)
        grows = (share.ravel() > 0.0) & (share.ravel() < 1.0) & (self._variance > 0.0)
        self._variance[grows] += SAMPLE_TIME * GROWTH_STD**2
        for part in self.parts:
            part.work.evidence[:] = 0.0
            part.scale_effects(share)
        for side, part in enumerate(self.parts[:2]):
            if self._k:
                self._step_motor(side, part, speed)
        self._step_surge(self.parts[2], reading)
        self._k += 1
        log_normal = sum(float(part.work.evidence[0]) for part in self.parts)
        log_density = np.full(self._mean.size, log_normal)
        for part in self.parts:
            log_density[part.particle] += part.work.evidence[1:] - part.work.evidence[0]
        return log_normal, log_density.reshape(self._shape)

    def _begin(self, reading: np.ndarray) -> None:
        """Begin the normal filters at the first readings."""
        for side, part in enumerate(self.parts[:2]):
            channel = MOTOR_CHANNEL[part.number]
            rpm_channel = channel + OF_RPM
            by_start = self._voltages.by_start[0, side]
            std = [
                self._noise[rpm_channel] / RPM,
                *healthy_stds(part.number, motor.DEVIATIONS),
                self._noise[channel] * by_start,
            ]
            part.filters[motor.W] = max(reading[rpm_channel], 0.0) / RPM
            for state, value in enumerate(std):
                part.filters[covariance_row(state, state, part.n_states)] = value**2
        self.parts[2].filters[:] = self._start_surge[:, None]

    def _step_motor(self, side: int, part: Part, speed: float) -> None:
        part.work.surge_speed[:] = speed
        own, of_surge = self._own_speed[side]
        part.work.surge_speed[own] = self.parts[2].filters[surge.U, of_surge]
        part.take_severities(self._mean, self._variance)
        motor.step_motor(
            *part.columns,
            float(self._voltages.voltage[self._k, side]),
            float(self._voltages.by_start[self._k, side]),
            self._sample,
            MOTOR_CHANNEL[part.number],
            self._water,
            part.work,
        )
        self._give_severities(part)

    def _step_surge(self, part: Part, reading: np.ndarray) -> None:
        shafts = (part.work.port, part.work.starboard)
        for shaft, source, (own, of_motor) in zip(
            shafts, self.parts[:2], self._own_rpm, strict=True
        ):
            now = np.full(shaft.shape[1], reading[MOTOR_CHANNEL[source.number] + OF_RPM])
            now[own] = RPM * source.filters[motor.W, of_motor]
            std = np.full(shaft.shape[1], self._noise[MOTOR_CHANNEL[source.number] + OF_RPM])
            variance_row = covariance_row(motor.W, motor.W, motor.N_STATES)
            std[own] = RPM * np.sqrt(np.maximum(source.filters[variance_row, of_motor], 0.0))
            shaft[surge.RPM_BEFORE] = shaft[surge.RPM_NOW] if self._k else now
            shaft[surge.RPM_NOW] = now
            shaft[surge.RPM_STD] = std
        part.take_severities(self._mean, self._variance)
        step_surge(*part.columns, self._sample, self._constants, part.work)
        self._give_severities(part)

    def _give_severities(self, part: Part) -> None:
        part.give_severities(self._mean, self._variance)
        np.clip(self._mean, self._low, self._high, out=self._mean)


class PaddleWheel:
    """A Kalman filter of speed and acceleration by the paddle wheel alone."""

    def __init__(self, noise: float):
        self._variance = noise**2
        self._mean = np.zeros(2)
        self._covariance = np.diag([1.0, START_ACCELERATION_STD**2])
        self._transition = np.array([[1.0, SAMPLE_TIME], [0.0, 1.0]])

    def mean_speed(self, reading: float) -> float:
        """Mean speed [m/s] over the sample that ends with a reading."""
        self._mean = self._transition @ self._mean
        self._covariance = self._transition @ self._covariance @ self._transition.T
        self._covariance[1, 1] += SAMPLE_TIME * JERK_STD**2
        gain = self._covariance[:, 0] / (self._covariance[0, 0] + self._variance)
        self._mean = self._mean + gain * (reading - self._mean[0])
        self._covariance = self._covariance - np.outer(gain, self._covariance[0])
        return float(self._mean[0] - 0.5 * SAMPLE_TIME * self._mean[1])


def shared_particles(part: Part, other: Part, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Columns of the particles of some faults (n_faults,) in a part, and in another."""
    faults = np.flatnonzero(chosen & (part.block >= 0) & (other.block >= 0))
    slots = np.arange(part.n_slots)
    places = [(1 + of.block[faults][:, None] * of.n_slots + slots).ravel() for of in (part, other)]
    return places[0], places[1]


def healthy_stds(part: int, rows: Sequence[int]) -> list[float]:
    """Standard deviations of the relative healthy deviations of some parameters of a part."""
    names = [OWN_PARAMETERS[part][row] for row in rows]
    return [PARAMETERS[name].band / math.sqrt(3.0) for name in names]
