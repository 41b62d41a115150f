"""The state-and-parameter filter on real runs of a ship: surge speed, shaft speed and rudder."""

from collections.abc import Sequence
from dataclasses import replace
from math import exp, sqrt
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.parameters import PRESETS, SAMPLE_TIME, Vehicle
from diagnosers.kalman import SurgeFilter
from training.datasets.esso_osaka_runs import ShipRun
from training.datasets.surge_fit import AHEAD

# m/s, of the speed. Its noise is 2 mm/s, but the tracking's jumps last for seconds, at up to 0.1
# m/s: white noise as strong at low frequencies is larger, and pessimistic for quick changes. Chosen
# on these runs, among 0.005 to 0.05.
SPEED_NOISE = 0.02
# per square root of a second: the ship answers about ten times slower than the AUV
WALK_STD = (0.003,) * 3


class Track(NamedTuple):
    """Estimates along a run, by the thesis' terms alone and with turn and wind as well (lanes)."""

    # (n_samples, 2, 2): by sample and lane, of alpha and beta relative to the nominal
    relative: np.ndarray
    std: np.ndarray
    # (2,): mean squared innovation over its variance; below 1 if the filter assumes too much noise
    nis: np.ndarray


def ship(form: Sequence[str], coefficients: np.ndarray, error: float) -> Vehicle:
    """The ship as a nominal vehicle: hull and thrust as fitted, and a disturbance.

    The disturbance explains the error of the ten-second prediction [m/s rms]: it is the
    Ornstein-Uhlenbeck process, of the preset's correlation time T, whose integral over t = 10 s has
    that size: ``error^2 = 2 std^2 T (t - T (1 - exp(-t/T)))``. The ship's one propeller is divided
    among the two of a `Vehicle`, half the thrust each. Its motor is unknown: those constants stay
    the preset's, and the filter uses them only for the change of thrust within a sample.
    """
    preset = PRESETS["thesis1992"]
    fitted = dict(zip(form, coefficients.tolist(), strict=True))
    duration = AHEAD * SAMPLE_TIME
    memory = preset.disturbance_time
    integral = memory * (duration - memory * (1 - exp(-duration / memory)))
    return replace(
        preset,
        name="esso_osaka",
        disturbance_std=error / sqrt(2 * integral),
        alpha=fitted["alpha"],
        beta=fitted["beta"],
        gamma=min(fitted["gamma"], 0.0),
    )


def track(run: ShipRun, vehicle: Vehicle, known: np.ndarray) -> Track:
    """Run the filter along a run; known (n_samples - 1,) [m/s^2] is added in the second lane."""
    surge = SurgeFilter(vehicle, SPEED_NOISE / CHANNELS["speed"].noise, walk_std=WALK_STD)
    estimate = surge.initial(2)
    columns = [surge.states.index(name) for name in ("alpha", "beta")]
    changes = np.zeros((len(run.speed), *estimate.mean.shape))
    changes[1:, 1, surge.states.index("speed")] = SAMPLE_TIME * known
    means = []
    variances = []
    nis = []
    for observation, change in zip(observations(run), changes, strict=True):
        moved = estimate._replace(mean=estimate.mean + change)
        estimate = surge.update(moved, observation)
        means.append(estimate.mean[:, columns])
        variances.append(estimate.covariance[:, columns, columns])
        nis.append(estimate.innovation**2 / estimate.innovation_variance)
    return Track(np.array(means), np.sqrt(variances), np.mean(nis, axis=0))


def observations(run: ShipRun) -> np.ndarray:
    """The run as the channels of two equal lanes, (n_samples, 2, n_channels); else zero."""
    rows = np.zeros((len(run.speed), 2, len(CHANNELS)))
    rows[:, :, INDEX["speed"]] = run.speed[:, None]
    rows[:, :, INDEX["rudder"]] = run.inputs.rudder[:, None]
    for side in ("port", "starboard"):
        rows[:, :, INDEX[f"{side}_rpm"]] = run.inputs.rpm[:, None]
    return rows
