"""The state-and-parameter filter on real runs of a ship: surge speed, shaft speed and rudder, sample by sample."""

from collections.abc import Sequence
from dataclasses import replace
from math import exp, sqrt
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS
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
CHANNEL = {name: k for k, name in enumerate(CHANNELS)}


class Track(NamedTuple):
    """The filter's estimates along a run, by lane: knowing the thesis' terms alone, and told the known rest.

    relative and std (n_samples, 2, 2): by sample and lane, of alpha and beta relative to the
    nominal. nis (2,): mean squared innovation over its variance; 1 for a consistent filter, below
    if the ship is less noisy than it believes.
    """

    relative: np.ndarray
    std: np.ndarray
    nis: np.ndarray


def ship(form: Sequence[str], coefficients: np.ndarray, error: float) -> Vehicle:
    """The ship as a nominal vehicle: hull and thrust as fitted, and a disturbance that explains the prediction's error.

    error [m/s rms] is that of the ten-second prediction; the disturbance is the Ornstein-Uhlenbeck
    process, of the preset's correlation time T, whose integral over t = 10 s has this size:
    ``error^2 = 2 std^2 T (t - T (1 - exp(-t/T)))``. The two propellers of a `Vehicle` are both the
    ship's one, half the thrust each. Of its motor nothing is known: those constants stay the
    preset's, and the filter uses them for how thrust settles within a sample alone.
    """
    preset = PRESETS["thesis1992"]
    fitted = dict(zip(form, coefficients.tolist(), strict=True))
    ahead = AHEAD * SAMPLE_TIME
    memory = preset.disturbance_time
    std = error / sqrt(2 * memory * (ahead - memory * (1 - exp(-ahead / memory))))
    hull = {"alpha": fitted["alpha"], "beta": fitted["beta"], "gamma": min(fitted["gamma"], 0.0)}
    return replace(preset, name="esso_osaka", disturbance_std=std, **hull)


def track(run: ShipRun, vehicle: Vehicle, known: np.ndarray) -> Track:
    """Run the filter over a run; known (n_samples - 1,) [m/s^2] is the acceleration that the second lane is told of."""
    surge = SurgeFilter(vehicle, SPEED_NOISE / CHANNELS["speed"].noise, walk_std=WALK_STD)
    estimate = surge.initial(2)
    columns = [surge.states.index(name) for name in ("alpha", "beta")]
    push = np.zeros((len(run.speed), *estimate.mean.shape))
    push[1:, 1, surge.states.index("speed")] = SAMPLE_TIME * known
    means = []
    variances = []
    nis = []
    for observation, pushed in zip(observations(run), push, strict=True):
        estimate = surge.update(estimate._replace(mean=estimate.mean + pushed), observation)
        means.append(estimate.mean[:, columns])
        variances.append(estimate.covariance[:, columns, columns])
        nis.append(estimate.innovation**2 / estimate.innovation_variance)
    return Track(np.array(means), np.sqrt(variances), np.mean(nis, axis=0))


def observations(run: ShipRun) -> np.ndarray:
    """The run as the channels of two lanes alike, (n_samples, 2, n_channels); what the ship has not is zero."""
    rows = np.zeros((len(run.speed), 2, len(CHANNELS)))
    x = run.inputs
    read = {"speed": run.speed, "rudder": x.rudder, "port_rpm": x.rpm, "starboard_rpm": x.rpm}
    for name, values in read.items():
        rows[:, :, CHANNEL[name]] = values[:, None]
    return rows
