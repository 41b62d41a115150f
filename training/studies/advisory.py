"""What it saves to follow the advice of `diagnosers.advisory`: ``python -m training.studies.advisory``."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from auv_fault_env.errors import finite_in_range, whole_number
from auv_fault_env.faults import CATALOGUE, classes
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
    TOLD,
    Plan,
    Voyages,
    normal,
    sail,
)
from training.studies.run import command_line, run_study

VEHICLE = PRESETS["thesis1992"]  # the diagnosers' own
FIRST_SEED = 900_000_000  # within those of tests
# What a mission may be: speed [m/s], whole way [m], share of it that is gone, battery by what a
# healthy vehicle needs for the rest, current against it [m/s].
SPEED = (0.4, 0.8)
LENGTH = (500.0, 1500.0)
GONE = (0.1, 0.7)
RESERVE = (1.1, 1.5)
CURRENT = (-0.1, 0.1)
_, SENSORS, HEALTHY = PARTS = ("propulsion fault", "sensor fault", "healthy")


@dataclass(frozen=True)
class AdvisoryStudy:
    """Sail missions with the advice followed, ignored, and given by one who knows the fault, and compare the ends."""

    output: Path = Path("runs/advisory-study")
    """Folder of the report; an earlier run there is replaced."""
    missions: int = 200
    """Missions with a fault of the propulsion, and as many with one of a sensor, and without any."""
    diagnoser: str = "filter_bank"
    """Diagnoser whose belief the advice rests on."""
    hotel_load: float = 5.0
    """Power of all but the motors [W]; so that about 0.5 m/s is the most economical speed."""
    seed: int = 0
    """Offset within the seeds of tests."""


def main(arguments: AdvisoryStudy) -> None:
    """Sail, and write report, figures and results."""
    whole_number("missions", arguments.missions)
    finite_in_range("hotel load", arguments.hotel_load, 0.5, 1000.0)
    finite_in_range("seed", arguments.seed, 0, 10_000_000)
    diagnoser = make(arguments.diagnoser)

    def study(_folder: Path) -> dict[str, Any]:
        plan = planned(arguments)
        runs = {arm: sail(plan, VEHICLE, arm, diagnoser) for arm in ARMS}
        return summary(arguments, plan, runs)

    run_study("advisory-study", arguments, study, page)


def planned(arguments: AdvisoryStudy) -> Plan:
    """Missions as drawn, part after part of `PARTS`."""
    n_lanes = len(PARTS) * arguments.missions
    chosen = seeds("test", n_lanes, FIRST_SEED + arguments.seed)
    random = np.random.default_rng(chosen.start)
    speed, length, gone, reserve, current = (
        random.uniform(*limits, n_lanes) for limits in (SPEED, LENGTH, GONE, RESERVE, CURRENT)
    )
    to_go = (1.0 - gone) * length
    hotel_load = np.full(n_lanes, arguments.hotel_load)
    situation = Situation(speed, to_go, gone * length, np.zeros(n_lanes), hotel_load, current)
    need = advise(normal(n_lanes), situation, VEHICLE).energy_per_metre.median * to_go
    lots = zip(PARTS, np.array_split(chosen, len(PARTS)), strict=True)
    schedules = [schedule for part, lot in lots for schedule in drawn(part, lot.tolist())]
    return Plan(chosen, schedules, situation._replace(energy_left=reserve * need))


def drawn(part: str, chosen: Sequence[int]) -> list[Schedule]:
    """One lasting fault of a class that belongs to the part for each seed, all classes equally likely; or none."""
    if part == HEALTHY:
        return [()] * len(chosen)
    weights = {
        name: float(name.startswith(SENSOR_PREFIX) == (part == SENSORS)) for name in classes()[1:]
    }
    sampler = replace(ONE_FAULT, prior=weights)
    return [sampler.sample(seed) for seed in chosen]


def summary(arguments: AdvisoryStudy, plan: Plan, sailed: Mapping[str, Voyages]) -> dict[str, Any]:
    """All results as plain data."""
    given = ("missions", "diagnoser", "hotel_load", "seed")
    options = (f"--{name.replace('_', '-')} {getattr(arguments, name)}" for name in given)
    part = np.repeat(list(PARTS), arguments.missions)
    kind = np.array(
        [
            CATALOGUE[one[0].fault].diagnosis.partition(":")[0] if one else ""
            for one in plan.schedules
        ]
    )
    kinds = {str(name): kind == name for name in np.unique(kind[kind != ""])}
    pairs = {
        f"{FOLLOWED} minus {other}": (sailed[FOLLOWED], sailed[other]) for other in (IGNORED, TOLD)
    }
    return {
        "command": " ".join(["python -m training.studies.advisory", *options]),
        "missions": arguments.missions,
        "diagnoser": arguments.diagnoser,
        "hotel_load": arguments.hotel_load,
        "drawn": {
            "speed": SPEED,
            "length": LENGTH,
            "gone": GONE,
            "reserve": RESERVE,
            "current": CURRENT,
        },
        "parts": {
            name: {arm: figures(one, part == name, arguments.seed) for arm, one in sailed.items()}
            for name in PARTS
        },
        "differences": {
            name: {
                pair: difference(*both, part == name, arguments.seed)
                for pair, both in pairs.items()
            }
            for name in PARTS
        },
        "kinds": {
            name: {arm: _shares(one.outcome[lanes]) for arm, one in sailed.items()}
            for name, lanes in kinds.items()
        },
        "counts": {name: int(lanes.sum()) for name, lanes in kinds.items()},
    }


def _shares(outcome: np.ndarray) -> dict[str, float]:
    return {name: float((outcome == k).mean()) for k, name in enumerate(OUTCOMES)}


def measured(voyages: Voyages, lanes: np.ndarray) -> dict[str, np.ndarray]:
    """Per mission: whether completed, whether the vehicle was stranded, energy [kJ], duration [min]."""
    outcome = voyages.outcome[lanes]
    energy = voyages.spent[lanes] / 1e3
    duration = voyages.lasted[lanes] / 60.0
    return {
        "completed": outcome == GOAL,
        "stranded": outcome == STRANDED,
        "energy": energy,
        "duration": duration,
    }


def figures(voyages: Voyages, lanes: np.ndarray, seed: int) -> dict[str, Any]:
    """Of some missions: shares of the outcomes, means with their intervals, energy by completed mission [kJ]."""
    values = measured(voyages, lanes)
    completed = int(values["completed"].sum())
    return {
        "outcomes": _shares(voyages.outcome[lanes]),
        **{
            name: [float(value.mean()), *interval(value.astype(float), seed)]
            for name, value in values.items()
        },
        "energy_by_completed": float(values["energy"].sum()) / completed if completed else None,
        "changes": float(voyages.changes[lanes].mean()),
    }


def difference(
    one: Voyages, other: Voyages, lanes: np.ndarray, seed: int
) -> dict[str, list[float]]:
    """Means of one less those of the other on the same missions, with paired intervals."""
    pairs = zip(measured(one, lanes).items(), measured(other, lanes).values(), strict=True)
    return {
        name: [
            float(a.mean() - b.mean()),
            *paired_bootstrap(a.astype(float), b.astype(float), seed),
        ]
        for (name, a), b in pairs
    }


if __name__ == "__main__":
    command_line(main)
