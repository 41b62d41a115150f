"""The thesis' test runs on the plant, recorded together with the parameter filter."""

from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS, follow_mission
from auv_fault_env.schedules import FaultEvent, Schedule
from diagnosers.consistency import nis
from diagnosers.kalman import PARAMETERS, Estimate, ParameterFilter

STEPS = 600  # 60 s, the length of the thesis' runs
# Share of the default noise that the filter assumes in runs without noise: with less it follows
# every mismatch.
LEAST_NOISE = 0.1


class TestRun(NamedTuple):
    """One run of the thesis: the name of the mission, and the faults."""

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
    """Readings and estimates of all test runs, (STEPS + 1, n_runs, n_seeds, ...) each.

    `mean` and `std` are of alpha, beta and gamma relative to nominal; `nis` is the normalised
    innovation squared of the filter.
    """

    readings: np.ndarray
    mean: np.ndarray
    std: np.ndarray
    nis: np.ndarray


def record(sensor_noise: float, seeds: list[int], bar: tqdm) -> Recording:
    """Every test run with every seed, the nominal vehicle in still water.

    The filter knows the noise; without noise it assumes `LEAST_NOISE`.
    """
    n_lanes = len(TEST_RUNS) * len(seeds)
    fleet = Fleet(n_lanes, "thesis1992", sensor_noise, disturbance=0.0, healthy_band=0.0)
    runs = [run for run in TEST_RUNS.values() for _ in seeds]
    schedules = [run.schedule for run in runs]
    missions = [MISSIONS[run.mission] for run in runs]
    observation = fleet.reset(seeds * len(TEST_RUNS), schedules=schedules, missions=missions)
    kalman = ParameterFilter(sensor_noise=max(sensor_noise, LEAST_NOISE), disturbance=0.0)
    readings = [observation]
    estimates = [kalman.update(kalman.initial(n_lanes), observation)]
    for _ in range(STEPS):
        observation = fleet.step(follow_mission(observation))
        readings.append(observation)
        estimates.append(kalman.update(estimates[-1], observation))
        bar.update()
    return _recording(readings, estimates, kalman, len(seeds))


def _recording(
    readings: list[np.ndarray],
    estimates: list[Estimate],
    kalman: ParameterFilter,
    n_seeds: int,
) -> Recording:
    columns = [kalman.states.index(name) for name in PARAMETERS]

    def by_run_and_seed(samples: list[np.ndarray]) -> np.ndarray:
        return np.stack(samples).reshape(len(samples), len(TEST_RUNS), n_seeds, -1)

    means = []
    variances = []
    for estimate in estimates:
        means.append(estimate.mean[:, columns])
        variances.append(np.diagonal(estimate.covariance, axis1=1, axis2=2)[:, columns])
    innovations = [nis(estimate) for estimate in estimates]
    return Recording(
        by_run_and_seed(readings),
        by_run_and_seed(means),
        np.sqrt(by_run_and_seed(variances)),
        by_run_and_seed(innovations)[..., 0],
    )
