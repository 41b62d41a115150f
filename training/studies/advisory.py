"""What following `diagnosers.advisory` saves: ``python -m training.studies.advisory``."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from auv_fault_env.errors import finite_in_range, whole_number
from auv_fault_env.faults import CATALOGUE, fault_classes
from auv_fault_env.parameters import PRESETS
from auv_fault_env.schedules import Schedule
from diagnosers import make
from diagnosers.advisory import SENSOR_PREFIX, Situation, advise
from training.benchmark.suites import ONE_FAULT
from training.metrics.intervals import interval, paired_bootstrap
from training.seeds import seeds
from training.studies.advisory_page import page
from training.studies.mission_runs import (
    ARMS,
    FOLLOWED,
    GOAL,
    IGNORED,
    OUTCOMES,
    STRANDED,
    TRUTH_KNOWN,
    MissionPlan,
    MissionRuns,
    normal_belief,
    run_missions,
)
from training.studies.run import command_line, run_study

VEHICLE = PRESETS["thesis1992"]
# within the seeds of tests
FIRST_SEED = 900_000_000
# ranges of the random missions: mission speed [m/s], length [m], share of the length before the
# simulation begins, battery relative to what a healthy vehicle needs, opposing current [m/s]
SPEED = (0.4, 0.8)
LENGTH = (500.0, 1500.0)
GONE = (0.1, 0.7)
RESERVE = (1.1, 1.5)
CURRENT = (-0.1, 0.1)
PROPULSION = "propulsion fault"
SENSORS = "sensor fault"
HEALTHY = "healthy"
PARTS = (PROPULSION, SENSORS, HEALTHY)


@dataclass(frozen=True)
class AdvisoryStudy:
    """Compare how missions end: advice ignored, followed by a belief, followed by the truth."""

    output: Path = Path("runs/advisory-study")
    """Folder of the report; an earlier run there is replaced."""
    missions: int = 200
    """Missions with a propulsion fault, as many with a sensor fault, and as many without fault."""
    diagnoser: str = "filter_bank"
    """Diagnoser whose belief the advice rests on."""
    hotel_load: float = 5.0
    """Power of all but the motors [W]; with 5 W about 0.5 m/s is the most economical speed."""
    seed: int = 0
    """Offset within the seeds of tests."""


def main(arguments: AdvisoryStudy) -> None:
    """Simulate missions, compare their ends, and write results and page."""
    whole_number("missions", arguments.missions)
    finite_in_range("hotel load", arguments.hotel_load, 0.5, 1000.0)
    finite_in_range("seed", arguments.seed, 0, 10_000_000)
    diagnoser = make(arguments.diagnoser)

    def study(_folder: Path) -> dict[str, Any]:
        plan = random_plan(arguments)
        runs = {arm: run_missions(plan, VEHICLE, arm, diagnoser) for arm in ARMS}
        return summary(arguments, plan, runs)

    run_study("advisory", arguments, study, page)


def random_plan(arguments: AdvisoryStudy) -> MissionPlan:
    """Random missions, as many of each part of `PARTS`, one part after the other."""
    n_lanes = len(PARTS) * arguments.missions
    lane_seeds = seeds("test", n_lanes, FIRST_SEED + arguments.seed)
    random = np.random.default_rng(lane_seeds.start)
    speed = random.uniform(*SPEED, n_lanes)
    length = random.uniform(*LENGTH, n_lanes)
    gone = random.uniform(*GONE, n_lanes)
    reserve = random.uniform(*RESERVE, n_lanes)
    current = random.uniform(*CURRENT, n_lanes)
    situation = Situation(
        speed=speed,
        distance_to_go=(1.0 - gone) * length,
        distance_home=gone * length,
        energy_left=np.zeros(n_lanes),
        hotel_load=np.full(n_lanes, arguments.hotel_load),
        current=current,
    )
    healthy_energy = advise(normal_belief(n_lanes), situation, VEHICLE).energy_per_metre.median
    energy_needed = healthy_energy * situation.distance_to_go
    schedules = []
    for part, part_seeds in zip(PARTS, np.array_split(lane_seeds, len(PARTS)), strict=True):
        schedules += sample_schedules(part, part_seeds.tolist())
    return MissionPlan(
        lane_seeds, schedules, situation._replace(energy_left=reserve * energy_needed)
    )


def sample_schedules(part: str, lane_seeds: Sequence[int]) -> list[Schedule]:
    """One lasting fault per seed, of any class of the part with equal probability; or no fault."""
    if part == HEALTHY:
        return [()] * len(lane_seeds)
    is_sensor_part = part == SENSORS
    prior = {
        name: float(name.startswith(SENSOR_PREFIX) == is_sensor_part) for name in fault_classes()
    }
    sampler = replace(ONE_FAULT, prior=prior)
    return [sampler.sample(seed) for seed in lane_seeds]


def summary(
    arguments: AdvisoryStudy,
    plan: MissionPlan,
    runs_by_arm: Mapping[str, MissionRuns],
) -> dict[str, Any]:
    """All results as plain data."""
    part_of_lane = np.repeat(list(PARTS), arguments.missions)
    kind = np.array([_kind(schedule) for schedule in plan.schedules])
    lanes_by_kind = {str(name): kind == name for name in np.unique(kind[kind != ""])}
    followed = runs_by_arm[FOLLOWED]
    others = {f"{FOLLOWED} minus {arm}": runs_by_arm[arm] for arm in (IGNORED, TRUTH_KNOWN)}
    parts = {}
    gaps = {}
    for part in PARTS:
        lanes = part_of_lane == part
        parts[part] = {
            arm: arm_figures(runs, lanes, arguments.seed) for arm, runs in runs_by_arm.items()
        }
        gaps[part] = {
            name: differences(followed, other, lanes, arguments.seed)
            for name, other in others.items()
        }
    ranges = dict(speed=SPEED, length=LENGTH, gone=GONE, reserve=RESERVE, current=CURRENT)
    return {
        "missions": arguments.missions,
        "diagnoser": arguments.diagnoser,
        "hotel_load": arguments.hotel_load,
        "drawn": ranges,
        "parts": parts,
        "differences": gaps,
        "kinds": {
            name: {arm: _shares(runs.outcome[lanes]) for arm, runs in runs_by_arm.items()}
            for name, lanes in lanes_by_kind.items()
        },
        "counts": {name: int(lanes.sum()) for name, lanes in lanes_by_kind.items()},
    }


def _kind(schedule: Schedule) -> str:
    """Diagnosis class of the fault without its place; empty for a healthy vehicle."""
    if not schedule:
        return ""
    return CATALOGUE[schedule[0].fault].diagnosis.partition(":")[0]


def _shares(outcome: np.ndarray) -> dict[str, float]:
    return {name: float((outcome == k).mean()) for k, name in enumerate(OUTCOMES)}


def mission_quantities(runs: MissionRuns, lanes: np.ndarray) -> dict[str, np.ndarray]:
    """Per mission of some lanes: completed, stranded (bool), energy [kJ] and duration [min]."""
    outcome = runs.outcome[lanes]
    return {
        "completed": outcome == GOAL,
        "stranded": outcome == STRANDED,
        "energy": runs.energy_used[lanes] / 1e3,
        "duration": runs.duration[lanes] / 60.0,
    }


def arm_figures(runs: MissionRuns, lanes: np.ndarray, seed: int) -> dict[str, Any]:
    """Shares of the outcomes of some lanes, and means of `mission_quantities` with intervals."""
    quantities = mission_quantities(runs, lanes)
    means = {
        name: [float(values.mean()), *interval(values.astype(float), seed)]
        for name, values in quantities.items()
    }
    completed = int(quantities["completed"].sum())
    energy = float(quantities["energy"].sum())
    return {
        "outcomes": _shares(runs.outcome[lanes]),
        **means,
        "energy_by_completed": energy / completed if completed else None,
        "changes": float(runs.action_changes[lanes].mean()),
    }


def differences(
    runs: MissionRuns, other_runs: MissionRuns, lanes: np.ndarray, seed: int
) -> dict[str, list[float]]:
    """Differences of the means of `mission_quantities` on the same lanes, with paired intervals."""
    quantities = mission_quantities(runs, lanes)
    other_quantities = mission_quantities(other_runs, lanes)
    triples = {}
    for name, values in quantities.items():
        other = other_quantities[name]
        paired_interval = paired_bootstrap(values.astype(float), other.astype(float), seed)
        triples[name] = [float(values.mean() - other.mean()), *paired_interval]
    return triples


if __name__ == "__main__":
    command_line(main)
