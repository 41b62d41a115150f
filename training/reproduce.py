"""``auv-fault reproduce``: the thesis' test runs of chapters III to V, our figures beside the thesis'."""

from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from auv_fault_env.errors import finite_in_range
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS
from auv_fault_env.schedules import FaultEvent, Schedule
from diagnosers.kalman import PARAMETERS, Estimate, ParameterFilter
from training import filter_consistency
from training.arguments import Reproduce
from training.report import write_report
from training.reproduce_page import page
from training.runs import run_folder, write_json

STEPS = 600  # 60 s, the length of the thesis' runs
CONSISTENCY_SEEDS = 200
LEAST_NOISE = 0.1  # of the default, which the filter assumes in noise-free runs: with less it chases every mismatch


class TestRun(NamedTuple):
    """One run of the thesis: its figures, the mission and the fault."""

    figures: str
    mission: str
    schedule: Schedule


# The thesis changes alpha or beta at 10 s; the sizes of the faults of chapter V.C are not in it and are chosen here.
TEST_RUNS: dict[str, TestRun] = {
    "normal": TestRun("5.13, 5.14", "thesis", ()),
    "drag": TestRun("4.1, 5.15", "thesis", (FaultEvent("increased_drag", 10.0, 0.35),)),
    "thrust": TestRun(
        "4.2",
        "thesis",
        (FaultEvent("propeller_damage:port", 10.0, 0.7), FaultEvent("propeller_damage:starboard", 10.0, 0.7)),
    ),
    "loss": TestRun("5.18, 5.19", "thesis", (FaultEvent("propeller_loss:port", 10.0, 1.0),)),
    "start_normal": TestRun("5.3", "acceleration", ()),
    "start_friction": TestRun("5.4", "acceleration", (FaultEvent("seal_friction:port", 0.0, 0.5),)),
    "start_propeller": TestRun("5.5", "acceleration", (FaultEvent("propeller_damage:port", 0.0, 1.0),)),
    "start_drag": TestRun("5.6", "acceleration", (FaultEvent("increased_drag", 0.0, 0.35),)),
}


class Recording(NamedTuple):
    """One batch of runs: readings (STEPS + 1, n_runs, n_seeds, n_channels) and estimates of alpha, beta, gamma.

    mean and std (STEPS + 1, n_runs, n_seeds, 3) are relative to nominal, nis (STEPS + 1, n_runs, n_seeds) is the
    normalised innovation squared of the filter.
    """

    readings: np.ndarray
    mean: np.ndarray
    std: np.ndarray
    nis: np.ndarray


def main(arguments: Reproduce) -> None:
    """Simulate, filter, compare, and write report, figures and results."""
    finite_in_range("seeds", arguments.seeds, 2, 10_000)
    finite_in_range("seed", arguments.seed, 0, 2**62)
    with run_folder(arguments.output, "reproduce", arguments) as folder:
        results = reproduce(arguments)
        write_json(folder / "results.json", results)
        write_report(results, folder)
    print_table(results)
    print(f"\nreport: {arguments.output / 'index.html'}")


def reproduce(arguments: Reproduce) -> dict[str, Any]:
    """All results as plain data: what `write_report` needs, and nothing else does it read."""
    with tqdm(total=2 * STEPS, unit="step", desc="test runs") as bar:
        clean = record(0.0, [arguments.seed], bar)
        noisy = record(1.0, list(range(arguments.seed, arguments.seed + arguments.seeds)), bar)
    command = f"auv-fault reproduce --seed {arguments.seed} --seeds {arguments.seeds}"
    results = page(clean, noisy, list(TEST_RUNS), command)
    results["sections"].insert(-2, filter_consistency.section(CONSISTENCY_SEEDS, arguments.seed))
    return results


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
    readings, estimates = [observation], [kalman.update(kalman.initial(n_lanes), observation)]
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
    variances = [np.diagonal(estimate.covariance, axis1=1, axis2=2)[:, columns] for estimate in estimates]
    return Recording(
        fold(readings),
        fold([estimate.mean[:, columns] for estimate in estimates]),
        np.sqrt(fold(variances)),
        fold([estimate.innovation**2 / estimate.innovation_variance for estimate in estimates])[..., 0],
    )


def print_table(results: dict[str, Any]) -> None:
    """The comparison as plain text."""
    for section in results["sections"]:
        table = section.get("table")
        if table is None:
            continue
        rows = [row[:6] for row in (table["columns"], *table["rows"])]
        widths = [max(len(row[c]) for row in rows) for c in range(len(rows[0]))]
        print(f"\n{section['heading']}")
        for row in rows:
            cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
            print("  " + "  ".join(cells).rstrip())
