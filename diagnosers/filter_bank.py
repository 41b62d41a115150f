"""The classical diagnoser: a bank of filters for a world that is not exactly the model."""

import math
from dataclasses import dataclass
from functools import cache, cached_property
from typing import ClassVar, NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm

from auv_fault_env.errors import finite_in_range
from auv_fault_env.parameters import PARAMETERS, SAMPLE_TIME
from auv_fault_env.realism import IMPERFECTIONS, SURROUNDINGS
from diagnosers.bank.algebra import covariance_row
from diagnosers.bank.base import Bank, BankConstants, Machinery, prior_severity
from diagnosers.bank.hypotheses import OWN_PARAMETERS, SURGE, of_catalogue
from diagnosers.bank.motor import DEVIATIONS, RESISTANCE, TORQUE_CONSTANT
from diagnosers.bank.sensors import N_READINGS, new_sample
from diagnosers.kalman import START_SPEED_STD
from diagnosers.robust import algebra, surge
from diagnosers.robust.algebra import SEVERITY
from diagnosers.robust.alignment import N_EARLIER, N_LATENCIES, START_MISFIT
from diagnosers.robust.hypotheses import HypothesisTable, hypothesis_table
from diagnosers.robust.kernel import BankState, step_lanes
from diagnosers.robust.motor import START_VOLTAGE_STD, VOLTS
from diagnosers.robust.pack import workspace

FREEDOM = 6.0  # degrees of freedom of the readings' distribution
LATENESS = 0.3  # samples by which rpm readings lag behind those that they are aligned with, about
START_TILT_STD = 0.02  # m/s^2, error of the accelerometer before the first reading
START_TILT_WALK = 2e-3  # m/s^2, its change per sample before that has been seen
LEAST_TILT_WALK = 3e-5  # m/s^2
LARGEST_TILT_WALK = 0.05  # m/s^2
# of the supply voltage: change of the true voltage per sample before that has been seen, and limits
START_VOLTAGE_WALK = 8e-4
LEAST_VOLTAGE_WALK = 2e-5
LARGEST_VOLTAGE_WALK = 1e-2
# share by which these walks move per sample to what is seen
TILT_ADAPTATION = 0.02
VOLTAGE_ADAPTATION = 0.1  # within a second: a ramp of the voltage begins at any sample
NOISE_ADAPTATION = 0.005  # as these shares, of the noise: within 20 s
LARGEST_NOISE = 3.0  # standard deviations of a healthy sensor's noise
WARMING = 3.5  # K, of a motor on a mission, about: what 1 A makes of 1.1 ohm
STD_OF_UNIFORM = 1.0 / math.sqrt(3.0)  # of a uniform distribution, per half-width


class FilterBankConstants(NamedTuple):
    """What the kernel needs of a filter bank beside its hypotheses."""

    bank: BankConstants
    memory: float  # share of a healthy vehicle's deviation that is left after a sample
    healthy_variance: np.ndarray  # (3, SEVERITY), of the deviations of each subsystem
    tails: algebra.Tails
    lateness: float  # samples, of the rpm readings
    temperature: float  # see `FilterBank`
    class_temperature: float
    paddle_memory: float  # share of the paddle wheel's error that is left after a sample
    paddle_variance: float  # m^2/s^2, of that error
    walk_limits: np.ndarray  # (3, 3), of `BankState.walk`: share, least and largest value
    noise_adaptation: float  # share by which `BankState.noise_ratio` moves to what is seen
    largest_noise_ratio: float


@dataclass(frozen=True)
class FilterBank(Bank):
    """A bank of filters made for sensors and surroundings as `auv_fault_env.realism` lists them.

    Differences from `GaussianBank`: readings have heavy tails (Student's t), so that no single
    sample decides; the true voltage, the zero offset of the current, the error of the accelerometer
    by offset and attitude, and the slow error of the paddle wheel are states; how fast voltage and
    attitude change is estimated, and the noise of every sensor where it exceeds that of a healthy
    one; a command may step, by less than the noise of the voltage shows; a shaft speed that is read
    late is compared with the voltage and current of its time, and one that is too late for a
    healthy counter is `unknown`; the rounding of readings is seen in their differences; readings at
    rest are no evidence; a healthy vehicle's deviations change slowly; the water's current may
    change; a fault may end; evidence is forgotten within a minute; and a subsystem may change in a
    way that no fault of the catalogue does, the class `unknown`.
    Current and shaft speed imply a voltage that is not read.

    When it misleads: it takes longer than `GaussianBank` where readings are ideal; faults below a
    severity of 0.2 count as healthy; it has no double faults.
    A lasting change that is no fault of the catalogue may count as healthy after a minute or two,
    when the normal filter has come close to it and its misfit at the onset is forgotten.
    Without a reading of the shaft speed, a healthy motor that starts again after it has stood looks
    faulty; without one of the voltage, faults of motor, shaft and counter are confused.

    Attributes
    ----------
    repair
        Probability per sample that a fault ends.
    memory
        Time in which deviations of a healthy vehicle change [s].
    temperature
        Of the belief: the odds of a fault are raised to the power of 1 / temperature, because the
        likelihoods of successive samples, taken for independent, make them too sure. Calibrated on
        episodes of a minute of which most have a fault, as is the hazard; where faults are rare,
        the probability of `normal` is too low.
    class_temperature
        The same of the odds of each fault to the others: which fault it is, is less sure.
    """

    name = "filter_bank"
    machinery: ClassVar[Machinery] = Machinery(workspace, new_sample, step_lanes)
    grades: tuple[tuple[float, float], ...] = ((0.2, 0.45), (0.45, 0.7), (0.7, 1.0))
    walk_std: float = 0.03
    repair: float = 1e-8
    memory: float = 600.0
    temperature: float = 2.0
    class_temperature: float = 3.0

    def __post_init__(self):
        super().__post_init__()
        finite_in_range("repair", self.repair, 1e-12, 0.5)
        finite_in_range("memory", self.memory, SAMPLE_TIME, 1e6)
        finite_in_range("temperature", self.temperature, 0.1, 100.0)
        finite_in_range("class_temperature", self.class_temperature, 0.1, 100.0)

    @cached_property
    def constants(self) -> FilterBankConstants:
        """What the kernel needs: water, noise and disturbance of the nominal vehicle."""
        wheel = SURROUNDINGS["wheel_noise"].value
        wheel_time = SURROUNDINGS["wheel_noise_time"].value
        return FilterBankConstants(
            bank=super().constants,
            memory=math.exp(-SAMPLE_TIME / self.memory),
            healthy_variance=np.array([self._healthy_variance(k) for k in OWN_PARAMETERS]),
            tails=tails_of(FREEDOM),
            lateness=LATENESS,
            temperature=self.temperature,
            class_temperature=self.class_temperature,
            paddle_memory=math.exp(-SAMPLE_TIME / wheel_time),
            paddle_variance=wheel**2,
            walk_limits=self._walk_limits(),
            noise_adaptation=NOISE_ADAPTATION,
            largest_noise_ratio=LARGEST_NOISE**2,
        )

    def _walk_limits(self) -> np.ndarray:
        voltage = self._nominal.maximum_voltage
        least = LEAST_VOLTAGE_WALK * voltage
        largest = LARGEST_VOLTAGE_WALK * voltage
        of_tilt = (TILT_ADAPTATION, LEAST_TILT_WALK**2, LARGEST_TILT_WALK**2)
        of_voltage = (VOLTAGE_ADAPTATION, least**2, largest**2)
        return np.array([of_tilt, of_voltage, of_voltage])

    def _healthy_variance(self, subsystem: int) -> np.ndarray:
        """Variances of the states that deviate from nominal in healthy vehicles, (SEVERITY,).

        Drag and thrust take up the gain error of the paddle wheel, resistance and torque constant
        those of voltage and current, and the warming of the motor.
        """
        std = {name: STD_OF_UNIFORM * self._band_of(name) for name in PARAMETERS}
        if subsystem == SURGE:
            gain_std = STD_OF_UNIFORM * IMPERFECTIONS["speed"].gain
            sides = self._nominal.sides
            of_sides = (std[f"{side}_beta"] for side in sides)
            thrust_std = math.hypot(math.hypot(*of_sides) / len(sides), gain_std)
            drag_std = math.hypot(std["alpha"], gain_std)
            return np.square([0.0, 0.0, drag_std, thrust_std, 0.0, 0.0])
        voltage_std = STD_OF_UNIFORM * IMPERFECTIONS["port_voltage"].gain
        current_std = STD_OF_UNIFORM * IMPERFECTIONS["port_current"].gain
        copper_std = WARMING * SURROUNDINGS["copper"].value
        apparent_std = {
            TORQUE_CONSTANT: math.hypot(voltage_std, WARMING * SURROUNDINGS["magnets"].value),
            RESISTANCE: math.hypot(voltage_std, current_std, copper_std),
        }
        own = OWN_PARAMETERS[subsystem]
        deviations = [math.hypot(std[own[row]], apparent_std.get(row, 0.0)) for row in DEVIATIONS]
        zero_std = STD_OF_UNIFORM * IMPERFECTIONS["port_current"].zero
        return np.square([0.0, *deviations, zero_std])

    def hypotheses(self) -> HypothesisTable:
        """The hypotheses of the catalogue as it is now."""
        highest = tuple(high for _, high in self.grades)
        return of_catalogue(hypothesis_table, highest, self.hazard, self.repair, self.fault_names)

    def table_of(self, state: BankState) -> HypothesisTable:
        """The hypotheses of the catalogue as it is now; a state always has the bank's grades."""
        return self.hypotheses()

    def initial(self, n_lanes: int) -> BankState:
        """The state before any observation: a normal vehicle, somewhere in the healthy band."""
        low, high = np.array(self.grades).T
        of_grades = np.stack([(low + high) / 2, (high - low) ** 2 / 12, low])
        without_severity = np.zeros((3, 1))
        prior = np.tile(np.hstack([of_grades, without_severity]), (n_lanes, 1, 1))
        table = self.hypotheses()
        n_filters = table.hypothesis.size
        log_posterior = np.full((n_lanes, table.log_hazard.size), -np.inf)
        log_posterior[:, 0] = 0.0
        severity = prior_severity(prior, table)
        unread = np.full((n_lanes, N_READINGS), np.nan)
        return BankState(
            log_posterior=log_posterior,
            severity=severity,
            filters=self._initial_filters(severity, table),
            shaft_speed=np.full((n_lanes, n_filters), np.nan),
            readings=unread,
            spacing=unread.copy(),
            healthy=np.tile(self.healthy, (n_lanes, 1)),
            prior=prior,
            walk=np.tile(self._initial_walk(), (n_lanes, 1)),
            noise_ratio=np.ones((n_lanes, N_READINGS)),
            innovation=unread.copy(),
            earlier=np.full((n_lanes, 2, N_EARLIER, N_LATENCIES), np.nan),
            latency=np.zeros((n_lanes, 2), np.int64),
            misfit=np.tile([0.0, *[START_MISFIT] * (N_LATENCIES - 1)], (n_lanes, 2, 1)),
            age=np.zeros(n_lanes),
        )

    def _initial_filters(self, severity: np.ndarray, table: HypothesisTable) -> np.ndarray:
        """Means and packed covariances before any observation, (n_lanes, N_MOMENTS, n_filters)."""
        filters = np.zeros((len(severity), algebra.N_MOMENTS, table.hypothesis.size))
        variances = [covariance_row.py_func(i, i, algebra.N_STATES) for i in range(SEVERITY)]
        for subsystem in OWN_PARAMETERS:
            first = int(table.first_filter[subsystem])
            last = int(table.first_filter[subsystem + 1])
            variance = self.constants.healthy_variance[subsystem].copy()
            if subsystem == SURGE:
                variance[surge.U] = START_SPEED_STD**2
                variance[surge.D] = self.constants.bank.disturbance_variance
                variance[surge.TILT] = START_TILT_STD**2
                variance[surge.PADDLE] = self.constants.paddle_variance
            else:
                variance[VOLTS] = START_VOLTAGE_STD**2
            filters[:, variances, first:last] = variance[:, None]
        filters[:, SEVERITY] = severity[:, 0, table.hypothesis]
        filters[:, algebra.SEVERITY_VARIANCE] = severity[:, 1, table.hypothesis]
        return filters

    def _initial_walk(self) -> list[float]:
        """The first `BankState.walk` of a lane."""
        of_voltage = (START_VOLTAGE_WALK * self._nominal.maximum_voltage) ** 2
        return [START_TILT_WALK**2, of_voltage, of_voltage]


@cache
def tails_of(freedom: float) -> algebra.Tails:
    """Student's t for readings whose noise is Gaussian but for outliers."""

    def preference(scale: float) -> float:
        """Derivative of the mean log density by the logarithm of the variance, times 2."""
        mean = norm.expect(lambda z: z * z / (freedom * scale + z * z))
        return (freedom + 1.0) * mean - 1.0

    return algebra.Tails(freedom, brentq(preference, 0.3, 1.1))
