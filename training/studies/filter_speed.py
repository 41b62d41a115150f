"""Speed of the banks, and of the surge filter of one beside the same filter in filterpy.

Run ``python -m training.studies.filter_speed``; it needs the extra `bench`. Both make the same
update of an extended Kalman filter with paddle wheel and accelerometer; the states are speed,
disturbance, deviations of drag and thrust, and severity. filterpy updates one filter at a time, the
bank all filters of a lane at once. Set OMP_NUM_THREADS=1 for the banks on one thread.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from auv_fault_env.channels import INDEX
from auv_fault_env.compiling import kernel
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS
from auv_fault_env.parameters import SAMPLE_TIME
from diagnosers.bank import surge
from diagnosers.bank.algebra import N_STATES, covariance_row
from diagnosers.bank.base import Bank, BankConstants
from diagnosers.bank.hypotheses import OWN_PARAMETERS, SURGE
from diagnosers.bank.pack import new_workspace
from diagnosers.bank.sensors import N_READINGS, fill_sample, new_sample
from diagnosers.filter_bank import FilterBank
from diagnosers.gaussian_bank import GaussianBank
from diagnosers.kalman import BETWEEN_STD
from training.rollouts import roll_out
from training.stimuli.light_bank import light_bank
from training.studies.run import command_line

N_LANES = 4096
N_SAMPLES = 12
BANK_LANES = (1, 64, 512, 4096)
N_UPDATES = 6000  # of lanes, at least, of a bank
# updates of the single filterpy filter, which are far slower
N_SINGLE_UPDATES = 40
RUDDER = INDEX["rudder"]
STERN_PLANE = INDEX["stern_plane"]
SPEED = INDEX["speed"]
ACCELERATION = INDEX["acceleration"]
CHANNEL_OF_RPM = (INDEX["port_rpm"], INDEX["starboard_rpm"])
BETAS = [surge.PORT_BETA, surge.STARBOARD_BETA]


@kernel
def update_lanes(filters, last_rpm, last, observation, constants, work, sample):
    """Update the surge filters of every lane, (n_lanes, 20, n_filters), by one sample."""
    columns = (np.uint64(0), np.uint64(filters.shape[2]))
    for lane in range(len(filters)):
        fill_sample(
            observation[lane : lane + 1],
            last[lane : lane + 1],
            constants.sensors,
            sample,
        )
        for side, shaft in enumerate((work.port, work.starboard)):
            rpm = observation[lane, CHANNEL_OF_RPM[side]]
            shaft[surge.RPM_NOW] = rpm
            shaft[surge.RPM_BEFORE] = last_rpm[lane, side]
            shaft[surge.RPM_SLOPE] = 0.0
            shaft[surge.RPM_STD] = 1.0
            last_rpm[lane, side] = rpm
        last[lane] = sample.reading[:, 0]
        work.filters[:, : filters.shape[2]] = filters[lane]
        surge.update(columns, sample, constants, work)
        filters[lane] = work.filters[:, : filters.shape[2]]


@dataclass
class SurgeModel:
    """The model of the surge filter for one hypothesis, in plain Python.

    Attributes
    ----------
    base, slope, offset
        Healthy parameters, and the effect of the severity on them, (14,).
    constants
        Constants of the bank.
    deflection
        Sum of the squared deflections of rudder and stern plane.
    rpm, last_rpm
        Shaft speeds of both sides at this sample and at the last one.
    """

    base: np.ndarray
    slope: np.ndarray
    offset: np.ndarray
    constants: BankConstants
    deflection: float = 0.0
    rpm: np.ndarray = field(default_factory=lambda: np.zeros(2))
    last_rpm: np.ndarray = field(default_factory=lambda: np.zeros(2))

    def parameters(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Parameters at the state, and their derivatives by severity."""
        healthy = self.base.copy()
        healthy[surge.ALPHA] *= 1.0 + x[2]
        healthy[BETAS] *= 1.0 + x[3]
        by_severity = healthy * self.slope + self.offset
        return healthy + x[4] * by_severity, by_severity

    def acceleration(
        self, x: np.ndarray, speed: float, last_weight: float
    ) -> tuple[float, np.ndarray]:
        """Acceleration at a speed, and its gradient by the states.

        The first element of the gradient is that of the drag by speed. `last_weight` is the weight
        of the last shaft speeds in the thrust.
        """
        p, by_severity = self.parameters(x)
        now = np.square(self.rpm)
        squares = last_weight * np.square(self.last_rpm) + (1.0 - last_weight) * now
        thrust = p[BETAS] @ squares
        thrust_slope = by_severity[BETAS] @ squares
        drag = p[0] + p[1] * self.deflection
        drag_slope = by_severity[0] + by_severity[1] * self.deflection
        square = speed * abs(speed)
        gradient = [
            2.0 * drag * abs(speed),
            1.0,
            p[0] / (1 + x[2]) * square,
            thrust / (1 + x[3]),
            drag_slope * square + thrust_slope,
        ]
        return drag * square + thrust + x[1], np.array(gradient)

    def counter_noise_variance(self, x: np.ndarray) -> float:
        """Variance of the acceleration from the noise of the rpm counters."""
        p, _ = self.parameters(x)
        return np.square(2.0 * p[BETAS] * self.rpm).sum()

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """State after a sample, its Jacobian and the covariance of the process noise."""
        c = self.constants
        p, _ = self.parameters(x)
        x = x.copy()
        x[1] *= c.disturbance_memory
        first, first_gradient = self.acceleration(x, x[0], c.opening)
        middle_speed = x[0] + 0.5 * SAMPLE_TIME * first
        middle, gradient = self.acceleration(x, middle_speed, c.opening)
        half_drag = 0.5 * SAMPLE_TIME * gradient[0]
        speed_row = SAMPLE_TIME * (1.0 + half_drag) * gradient
        speed_row[0] = 1.0 + 2.0 * half_drag * (1.0 + 0.5 * SAMPLE_TIME * first_gradient[0])
        jacobian = np.eye(N_STATES)
        jacobian[0] = speed_row
        noise = np.zeros((N_STATES, N_STATES))
        noise[1, 1] = (1.0 - c.disturbance_memory**2) * c.disturbance_variance
        noise = jacobian @ noise @ jacobian.T
        jump = p[BETAS] @ (np.square(self.rpm) - np.square(self.last_rpm))
        variance = self.counter_noise_variance(x) + (BETWEEN_STD * jump) ** 2
        noise[0, 0] += SAMPLE_TIME**2 * variance
        x[0] += SAMPLE_TIME * middle
        return (
            x,
            jacobian @ np.diag([1.0, c.disturbance_memory, 1.0, 1.0, 1.0]),
            noise,
        )

    def reading(self, x: np.ndarray, row: int) -> tuple[float, np.ndarray]:
        """Predicted reading of the sensor whose parameters begin at `row`, and its gradient."""
        p, by_severity = self.parameters(x)
        if row == surge.SPEED:
            truth = x[0]
            gradient = np.eye(N_STATES)[0]
        else:
            truth, gradient = self.acceleration(x, x[0], 0.0)
        gradient = p[row + 1] * gradient
        gradient[4] += by_severity[row + 1] * truth + by_severity[row]
        return p[row + 1] * truth + p[row], gradient


def filterpy_filter(model: SurgeModel, mean: np.ndarray, covariance: np.ndarray):
    """A filterpy filter of the model, and the function that updates it by an observation."""
    from filterpy.kalman import ExtendedKalmanFilter

    class Filter(ExtendedKalmanFilter):
        def predict_x(self, u=0):
            self.x, self.F, self.Q = model.predict(self.x)

    kalman = Filter(N_STATES, 1)
    kalman.x = mean.copy()
    kalman.P = covariance.copy()

    def gradient(x: np.ndarray, row: int) -> np.ndarray:
        return model.reading(x, row)[1][None]

    def predicted(x: np.ndarray, row: int) -> np.ndarray:
        return np.array([model.reading(x, row)[0]])

    def update(observation: np.ndarray) -> None:
        model.last_rpm = model.rpm
        model.rpm = observation[list(CHANNEL_OF_RPM)]
        model.deflection = observation[RUDDER] ** 2 + observation[STERN_PLANE] ** 2
        kalman.predict()
        for row, channel in (
            (surge.SPEED, SPEED),
            (surge.ACCELERATION, ACCELERATION),
        ):
            parameters, _ = model.parameters(kalman.x)
            variance = parameters[row + 2] ** 2
            if channel == ACCELERATION:
                gain = parameters[row + 1]
                variance += model.counter_noise_variance(kalman.x) * gain**2
            reading = np.array([observation[channel]])
            functions = (partial(gradient, row=row), partial(predicted, row=row))
            kalman.update(reading, *functions, R=variance)

    return kalman, update


@dataclass
class SurgeBank:
    """The surge filters of the bank for many lanes."""

    n_lanes: int

    def __post_init__(self):
        bank = GaussianBank()
        table = bank.hypotheses()
        state = bank.initial(self.n_lanes)
        self.n_filters = int(table.first_filter[SURGE + 1])
        self.constants = bank.constants
        self.base = state.healthy[0, table.parameter[SURGE]]
        self.filters = np.ascontiguousarray(state.filters[:, :, : self.n_filters])
        self.slope = table.slope[:, : self.n_filters].copy()
        self.offset = table.offset[:, : self.n_filters].copy()
        self.last_rpm = np.zeros((self.n_lanes, 2))
        self.last = np.full((self.n_lanes, N_READINGS), np.nan)
        self.work = new_workspace(table, 1)
        self.sample = new_sample(1)
        self.work.healthy[:] = self.base[:, None]

    def update(self, observation: np.ndarray) -> None:
        """Update all filters by float64 observations (n_lanes, n_channels) without deflections."""
        last = (self.last_rpm, self.last)
        update_lanes(self.filters, *last, observation, self.constants, self.work, self.sample)

    def moments(self, lane: int, f: int) -> tuple[np.ndarray, np.ndarray]:
        """Mean (5,) and covariance (5, 5) of one filter."""
        rows = np.vectorize(covariance_row.py_func)(*np.indices((N_STATES, N_STATES)), N_STATES)
        moments = self.filters[lane, :, f]
        return moments[:N_STATES].copy(), moments[rows]

    def filterpy_filter(self, lane: int, f: int) -> tuple[object, Callable[[np.ndarray], None]]:
        """The filterpy filter that equals one of these, and its update."""
        n = len(OWN_PARAMETERS[SURGE])
        model = SurgeModel(self.base[:n], self.slope[:n, f], self.offset[:n, f], self.constants)
        return filterpy_filter(model, *self.moments(lane, f))


def observations(n_lanes: int, n_samples: int) -> np.ndarray:
    """Healthy lanes on the thesis' mission, (n_samples, n_lanes, n_channels) float64."""
    schedules = [()] * n_lanes
    missions = [MISSIONS["thesis"]] * n_lanes
    rollout = roll_out(Fleet(n_lanes), range(n_lanes), n_samples, None, schedules, missions)
    return rollout.observations.astype(np.float64)


def median_seconds(update: Callable[[np.ndarray], None], samples: np.ndarray) -> float:
    """Median time of an update [s]; the first sample compiles and does not count."""
    times = []
    for sample in samples:
        start = time.perf_counter()
        update(sample)
        times.append(time.perf_counter() - start)
    return float(np.median(times[1:]))


def bank_seconds(bank: Bank, samples: np.ndarray) -> float:
    """Least time per lane of an update [s] in some passes over the samples."""
    n_lanes = samples.shape[1]
    passes = max(2, N_UPDATES // (n_lanes * len(samples)))
    least = math.inf
    for _ in range(passes):
        bank.reset(n_lanes)
        bank.update(samples[0])
        for sample in samples[1:]:
            start = time.process_time()
            bank.update(sample)
            least = min(least, time.process_time() - start)
    return least / n_lanes


def print_bank_times(samples: np.ndarray) -> None:
    """Print the CPU time per lane and sample of whole banks."""
    banks = {"filter_bank": FilterBank(), "light bank": light_bank()}
    for name, bank in banks.items():
        for n_lanes in BANK_LANES:
            seconds = bank_seconds(bank, samples[:, :n_lanes])
            print(f"{name}, {n_lanes} lanes: {seconds * 1e6:.1f} us of CPU per lane and sample")


def main() -> None:
    """Print the times of banks, of a filter in one and in filterpy, and the ratio of the last."""
    samples = observations(N_LANES, N_SAMPLES)
    print_bank_times(samples)
    bank = SurgeBank(N_LANES)
    _, update = bank.filterpy_filter(0, 1)
    bank_time = median_seconds(bank.update, samples) / (N_LANES * bank.n_filters)
    filterpy_time = median_seconds(update, np.tile(samples[:, 0], (N_SINGLE_UPDATES, 1)))
    size = f"{N_LANES} lanes of {bank.n_filters} filters, one thread"
    print(f"surge filter update, {size}: {bank_time * 1e9:.0f} ns")
    ratio = filterpy_time / bank_time
    print(f"the same in filterpy: {filterpy_time * 1e6:.0f} us, {ratio:.0f} times as long")


if __name__ == "__main__":
    command_line(main)
