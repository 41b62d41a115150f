"""The thesis' test runs on the plant, with the parameter filter behind them."""

from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS
from auv_fault_env.schedules import FaultEvent, Schedule
from diagnosers.consistency import nis
from diagnosers.kalman import PARAMETERS, Estimate, ParameterFilter

STEPS = 600  # 60 s, the length of the thesis' runs
# of the default, which the filter assumes in noise-free runs: with less it chases every mismatch
LEAST_NOISE = 0.1


class TestRun(NamedTuple):
    """One run of the thesis: the mission and the fault."""

    mission: str
    schedule: Schedule


# The thesis changes alpha or beta at 10 s; the sizes of the faults of chapter V.C are not in it and
# are chosen here.
TEST_RUNS: dict[str, TestRun] = {
    "normal": TestRun("thesis", ()),
    "drag": TestRun("thesis", (FaultEvent("increased_drag", 10.0, 0.35),)),
    "thrust": TestRun(
        "thesis",
        (
            FaultEvent("propeller_damage:port", 10.0, 0.7),
            FaultEvent("propeller_damage:starboard", 10.0, 0.7),
        ),
    ),
    "loss": TestRun("thesis", (FaultEvent("propeller_loss:port", 10.0, 1.0),)),
    "start_normal": TestRun("acceleration", ()),
    "start_friction": TestRun("acceleration", (FaultEvent("seal_friction:port", 0.0, 0.5),)),
    "start_propeller": TestRun("acceleration", (FaultEvent("propeller_damage:port", 0.0, 1.0),)),
    "start_drag": TestRun("acceleration", (FaultEvent("increased_drag", 0.0, 0.35),)),
}


class Recording(NamedTuple):
    """One batch of runs: readings (STEPS + 1, n_runs, n_seeds, n_channels) and estimates of alpha, beta, gamma.

    mean and std (STEPS + 1, n_runs, n_seeds, 3) are relative to nominal, nis (STEPS + 1, n_runs,
    n_seeds) is the normalised innovation squared of the filter.
    """

    readings: np.ndarray
    mean: np.ndarray
    std: np.ndarray
    nis: np.ndarray


def record(sensor_noise: float, seeds: list[int], bar: tqdm) -> Recording:
    """Every test run with every seed, the nominal vehicle in still water, filtered by a filter that knows the noise."""
    n_lanes = len(TEST_RUNS) * len(seeds)
    fleet = Fleet(n_lanes, "thesis1992", sensor_noise, disturbance=0.0, healthy_band=0.0)
    runs = [run for run in TEST_RUNS.values() for _ in seeds]
    observation = fleet.reset(
        seeds * len(TEST_RUNS),
        schedules=[run.schedule for run in runs],
        missions=[MISSIONS[run.mission] for run in runs],
    )
    kalman = ParameterFilter(sensor_noise=max(sensor_noise, LEAST_NOISE), disturbance=0.0)
    readings = [observation]
    estimates = [kalman.update(kalman.initial(n_lanes), observation)]
    for _ in range(STEPS):
        observation = fleet.step(observation[:, :1] * [1.0, 0.0, 0.0])
        readings.append(observation)
        estimates.append(kalman.update(estimates[-1], observation))
        bar.update()
    return _recording(readings, estimates, kalman, len(seeds))


def _recording(
    readings: list[np.ndarray], estimates: list[Estimate], kalman: ParameterFilter, n_seeds: int
) -> Recording:
    columns = [kalman.states.index(name) for name in PARAMETERS]
    fold = lambda values: np.stack(values).reshape(len(values), len(TEST_RUNS), n_seeds, -1)  # noqa: E731
    variances = [
        np.diagonal(estimate.covariance, axis1=1, axis2=2)[:, columns] for estimate in estimates
    ]
    return Recording(
        fold(readings),
        fold([estimate.mean[:, columns] for estimate in estimates]),
        np.sqrt(fold(variances)),
        fold([nis(estimate) for estimate in estimates])[..., 0],
    )
