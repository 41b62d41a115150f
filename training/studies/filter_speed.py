"""How fast is the bank's surge filter beside the same filter in filterpy? ``python -m training.studies.filter_speed``.

Both make the same extended Kalman filter update: speed, disturbance, deviations of drag and thrust,
severity, from paddle wheel and accelerometer. filterpy (the bench extra) takes one filter at a
time, the bank all of a lane at once.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from auv_fault_env.compiling import kernel
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS
from auv_fault_env.parameters import SAMPLE_TIME
from diagnosers.bank import surge
from diagnosers.bank.algebra import N_STATES, covariance_row
from diagnosers.bank.hypotheses import OWN_PARAMETERS, SURGE
from diagnosers.bank.pack import new_workspace
from diagnosers.bank.sensors import N_READINGS, fill_sample, new_sample
from diagnosers.filter_bank import BankConstants, FilterBank
from diagnosers.kalman import BETWEEN_STD
from training.rollouts import roll_out
from training.studies.run import command_line

N_LANES = 4096
CHANNEL_OF_RPM = (8, 11)


@kernel
def update_lanes(filters, rpm, last, observation, constants, work, sample):
    """One sample of the surge filters of every lane, (n_lanes, 20, n_filters), in place; rpm (n_lanes, 2)."""
    columns = (np.uint64(0), np.uint64(filters.shape[2]))
    for lane in range(len(filters)):
        fill_sample(observation[lane : lane + 1], last[lane : lane + 1], constants.sensors, sample)
        for side, shaft in enumerate((work.port, work.starboard)):
            now = observation[lane, CHANNEL_OF_RPM[side]]
            shaft[surge.RPM_NOW] = now
            shaft[surge.RPM_BEFORE] = rpm[lane, side]
            shaft[surge.RPM_SLOPE] = 0.0
            shaft[surge.RPM_STD] = 1.0
            rpm[lane, side] = now
        last[lane] = sample.reading[:, 0]
        surge.update(filters[lane], columns, sample, constants, work)


@dataclass
class Surge:
    """The surge filter's model for one hypothesis in plain Python: base, slope, offset of the parameters (14,)."""

    base: np.ndarray
    slope: np.ndarray
    offset: np.ndarray
    constants: BankConstants
    deflection: float = 0.0
    now: tuple[float, float] = (0.0, 0.0)
    before: tuple[float, float] = (0.0, 0.0)

    def form(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Parameters at the state, and their derivatives by severity."""
        healthy = self.base.copy()
        healthy[surge.ALPHA] *= 1.0 + x[2]
        healthy[[surge.PORT_BETA, surge.STARBOARD_BETA]] *= 1.0 + x[3]
        by_severity = healthy * self.slope + self.offset
        return healthy + x[4] * by_severity, by_severity

    def forces(self, x: np.ndarray, speed: float, opening: float) -> tuple[float, np.ndarray]:
        """Acceleration at a speed, and its gradient by the states with the speed held, drag's by speed in place 0."""
        p, by_severity = self.form(x)
        squares = [
            opening * b * b + (1.0 - opening) * n * n
            for n, b in zip(self.now, self.before, strict=True)
        ]
        thrust = p[2] * squares[0] + p[3] * squares[1]
        slope = by_severity[2] * squares[0] + by_severity[3] * squares[1]
        drag = p[0] + p[1] * self.deflection
        square = speed * abs(speed)
        by_drag = by_severity[0] + by_severity[1] * self.deflection
        gradient = [2.0 * drag * abs(speed), 1.0, p[0] / (1 + x[2]) * square, thrust / (1 + x[3])]
        return drag * square + thrust + x[1], np.array([*gradient, by_drag * square + slope])

    def shaken(self, x: np.ndarray) -> float:
        """Variance of the thrust's acceleration by the noise of the rpm counters."""
        p, _ = self.form(x)
        return (2.0 * p[2] * self.now[0]) ** 2 + (2.0 * p[3] * self.now[1]) ** 2

    def move(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """State after a sample, its Jacobian and the covariance of what joins it."""
        c = self.constants
        p = self.form(x)[0]
        x = x.copy()
        x[1] *= c.disturbance_memory
        first, at_start = self.forces(x, x[0], c.opening)
        middle = x[0] + 0.5 * SAMPLE_TIME * first
        rate, at_middle = self.forces(x, middle, c.opening)
        pull = 0.5 * SAMPLE_TIME * at_middle[0]
        row = SAMPLE_TIME * (1.0 + pull) * at_middle
        row[0] = 1.0 + 2.0 * pull * (1.0 + 0.5 * SAMPLE_TIME * at_start[0])
        jacobian = np.eye(N_STATES)
        noise = np.zeros((N_STATES, N_STATES))
        jacobian[0] = row
        noise[1, 1] = (1.0 - c.disturbance_memory**2) * c.disturbance_variance
        noise = jacobian @ noise @ jacobian.T
        jump = sum(p[2 + i] * (self.now[i] ** 2 - self.before[i] ** 2) for i in range(2))
        noise[0, 0] += SAMPLE_TIME**2 * (self.shaken(x) + (BETWEEN_STD * jump) ** 2)
        x[0] += SAMPLE_TIME * rate
        return x, jacobian @ np.diag([1.0, c.disturbance_memory, 1.0, 1.0, 1.0]), noise

    def sensor(self, x: np.ndarray, row: int) -> tuple[float, np.ndarray]:
        """Expected reading of the sensor whose parameters begin at `row`, and its gradient."""
        p, by_severity = self.form(x)
        truth, gradient = (
            (x[0], np.eye(N_STATES)[0]) if row == surge.SPEED else self.forces(x, x[0], 0.0)
        )
        gradient = p[row + 1] * gradient
        gradient[4] += by_severity[row + 1] * truth + by_severity[row]
        return p[row + 1] * truth + p[row], gradient


def reference(model: Surge, mean: np.ndarray, covariance: np.ndarray):
    """A filterpy filter of that model, and the function that takes it through a sample (observation (n_channels,))."""
    from filterpy.kalman import ExtendedKalmanFilter

    class Filter(ExtendedKalmanFilter):
        def predict_x(self, u=0):
            self.x, self.F, self.Q = model.move(self.x)

    kalman = Filter(N_STATES, 1)
    kalman.x = mean.copy()
    kalman.P = covariance.copy()

    def update(observation: np.ndarray):
        model.before = model.now
        model.now = (observation[8], observation[11])
        model.deflection = observation[2] ** 2 + observation[3] ** 2
        kalman.predict()
        for row, channel in ((surge.SPEED, 4), (surge.ACCELERATION, 5)):
            noise = model.form(kalman.x)[0][row + 2] ** 2
            noise += model.shaken(kalman.x) * (
                model.form(kalman.x)[0][row + 1] ** 2 if channel == 5 else 0.0
            )
            gradient = partial(lambda row, x: model.sensor(x, row)[1][None], row)
            expected = partial(lambda row, x: np.array([model.sensor(x, row)[0]]), row)
            kalman.update(np.array([observation[channel]]), gradient, expected, R=noise)

    return kalman, update


@dataclass
class Bank:
    """The bank's surge filters of many lanes, ready to be updated; `filters` (n_lanes, 20, n_filters)."""

    n_lanes: int

    def __post_init__(self):
        bank = FilterBank()
        table = bank.hypotheses()
        state = bank.initial(self.n_lanes)
        self.n_filters = int(table.first_filter[SURGE + 1])
        rows = len(OWN_PARAMETERS[SURGE])
        self.constants = bank.constants
        self.base = state.healthy[0, table.parameter[SURGE]]
        self.filters = np.ascontiguousarray(state.filters[:, :, : self.n_filters])
        self.slope, self.offset = (
            part[:, : self.n_filters].copy() for part in (table.slope, table.offset)
        )
        self.rpm, self.last = (
            np.zeros((self.n_lanes, 2)),
            np.full((self.n_lanes, N_READINGS), np.nan),
        )
        self.work = new_workspace(table, 1)
        self.sample = new_sample(1)
        self.rows = slice(0, rows)
        self.work.healthy[:] = self.base[:, None]

    def update(self, observation: np.ndarray) -> None:
        """One sample, (n_lanes, n_channels) float64, rudder and stern plane at zero."""
        update_lanes(
            self.filters, self.rpm, self.last, observation, self.constants, self.work, self.sample
        )

    def moments(self, lane: int, f: int) -> tuple[np.ndarray, np.ndarray]:
        """Mean (5,) and covariance (5, 5) of one filter."""
        places = [[covariance_row.py_func(i, j) for j in range(N_STATES)] for i in range(N_STATES)]
        return self.filters[lane, :N_STATES, f].copy(), self.filters[lane, :, f][np.array(places)]

    def reference(self, lane: int, f: int) -> tuple[object, Callable[[np.ndarray], None]]:
        """The filterpy filter that equals one of these, with its update."""
        effect = self.slope[self.rows, f], self.offset[self.rows, f]
        return reference(
            Surge(self.base[self.rows], *effect, self.constants), *self.moments(lane, f)
        )


def observations(n_lanes: int, n_samples: int) -> np.ndarray:
    """Healthy lanes on the thesis' stimulus, (n_samples, n_lanes, n_channels) float64."""
    rolled = roll_out(
        Fleet(n_lanes),
        range(n_lanes),
        n_samples,
        None,
        [()] * n_lanes,
        [MISSIONS["thesis"]] * n_lanes,
    )
    return rolled.observations.astype(np.float64)


def seconds(update: Callable[[np.ndarray], None], samples: np.ndarray) -> float:
    """Median time of an update [s]; the first sample warms up."""
    times = []
    for sample in samples:
        start = time.perf_counter()
        update(sample)
        times.append(time.perf_counter() - start)
    return float(np.median(times[1:]))


def main() -> None:
    """Print both times per filter update, and their ratio."""
    samples = observations(N_LANES, 12)
    bank = Bank(N_LANES)
    _, update = bank.reference(0, 1)
    ours = seconds(bank.update, samples) / (N_LANES * bank.n_filters)
    theirs = seconds(update, np.tile(samples[:, 0], (40, 1)))
    print(
        f"surge filter update, {N_LANES} lanes of {bank.n_filters} filters, one thread: {ours * 1e9:.0f} ns"
    )
    print(f"the same in filterpy: {theirs * 1e6:.0f} us, {theirs / ours:.0f} times as long")


if __name__ == "__main__":
    command_line(main)
