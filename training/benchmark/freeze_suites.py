"""Write the suites of the benchmark, or seal files with suites of your own.

``python -m training.benchmark.freeze_suites [FILE ...]``.

The suites in the package are frozen: sampled once by this file, and written out episode by episode.
Sampling them anew gives the same files, unless a sampler or the catalogue of faults has changed.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path

import numpy as np

from auv_fault_env.faults import CATALOGUE, fault_classes
from auv_fault_env.missions import Mission, MissionSampler
from auv_fault_env.parameters import FOOT, SIDES
from auv_fault_env.schedules import FaultEvent, Schedule
from auv_fault_env.unmodelled import UNMODELLED
from training.benchmark import suites
from training.benchmark.suites import (
    ONE_FAULT,
    Conditions,
    Episode,
    Steering,
    Suite,
)
from training.benchmark.whole_missions import WholeMissionSampler
from training.seeds import seeds

Cell = tuple[str, float]  # a fault and its full severity
BLOCK = 20_000_000  # test seeds of a suite; the second half counts false alarms on healthy lanes
THRESHOLD = 900_000_000  # first test seed of the lanes that the thresholds of all suites are set on
# number of the block of each suite; a published suite keeps its own
BLOCKS = {
    "thesis": 0,
    "ideal": 1,
    "ood_noise": 2,
    "ood_disturbance": 3,
    "ood_vehicle": 4,
    "ood_severity": 5,
    "ood_compound": 6,
    "ood_mission": 7,
    "standard": 8,
    "ood_sensors": 9,
    "unknown_faults": 10,
    "long": 11,
}
PER_CLASS = 114
PER_CLASS_OF_A_SHIFT = 22
PER_FAULT_OF_THE_THESIS = 32
PER_UNMODELLED_FAULT = 22
PER_PAIR = 44
# s by which a second fault follows the first: at least, and at most so much more
DELAY = 2.0
MORE_DELAY = 8.0
PAIRED = ("seal_friction", "propeller_loss")  # kinds that strike both sides at once
# fields of the events of faults that come and go
TEMPORARY = {"ventilating_propeller": {"period": 4.0, "duty": 0.5}}
LATE_ONSET = (60.0, 1160.0)  # s, of the suite with long missions
CONSTANT = MissionSampler(speed=(0.2, 0.5), n_legs=1, from_rest=0.0)
THESIS_SPEED = 0.75 * FOOT  # m/s: the thesis' 0.5 and 1.0 ft/s lie a budget below and above
PLANT = dict(preset="thesis1992", sensor_noise=1.0, disturbance=1.0, healthy_band=1.0)
STEERING = Steering(1.0 / 3.0, 0.3)
IDEAL = Conditions(PLANT, 65.0, (CONSTANT, MissionSampler()), STEERING)
STANDARD = replace(IDEAL, plant=PLANT | {"realism": 1.0}, whole_missions=WholeMissionSampler())
LONG = replace(
    STANDARD,
    duration=1200.0,
    missions=(MissionSampler(duration=(60.0, 300.0), n_legs=12, from_rest=1.0),),
)

ABOUT = {
    "thesis": "faults of the thesis, nominal vehicles at its mean speed",
    "ideal": "every class and severity, sensors and surroundings as the diagnosers assume them",
    "standard": "every class and severity, imperfect sensors and surroundings",
    "ood_sensors": "shift: sensors and surroundings twice as imperfect",
    "ood_noise": "shift: sensors twice as noisy",
    "ood_disturbance": "shift: disturbance twice as strong",
    "ood_vehicle": "shift: healthy vehicles twice as different",
    "ood_severity": "shift: severity 0.05 to 0.2",
    "ood_compound": "shift: a second, lesser fault 2 to 10 s after the one to find",
    "ood_mission": "shift: fast short legs, half from rest, large rudder and plane deflections",
    "unknown_faults": "faults outside the catalogue, and faults of both sides at once",
    "long": "missions of 20 minutes, faults that begin anywhere in them",
}


@dataclass(frozen=True)
class Recipe:
    """What a suite is sampled from; one cell per episode."""

    cells: Sequence[Cell]
    conditions: Conditions = STANDARD
    # the faults of an episode from the one of its cell and the seed
    schedule: Callable[[FaultEvent, int], Schedule] = lambda event, seed: (event,)


def graded_cells(per_class: int, low: float = 0.2, high: float = 1.0) -> list[Cell]:
    """As many cells of every class, its faults in turn, severities evenly spaced for each fault."""
    cells = []
    for diagnosis in fault_classes():
        faults = [fault.name for fault in CATALOGUE.values() if fault.diagnosis == diagnosis]
        for k, fault in enumerate(faults):
            n = len(range(k, per_class, len(faults)))
            for i in range(n):
                cells.append((fault, low + (high - low) * (i + 0.5) / n))
    return cells


def even_cells(per_class: int, low: float = 0.2, high: float = 1.0) -> list[Cell]:
    """As `graded_cells`, with severities of at least the fault's own `least_severity`."""
    return [
        (fault, max(severity, CATALOGUE[fault].least_severity))
        for fault, severity in graded_cells(per_class, low, high)
    ]


def is_only_whole(fault: str) -> bool:
    """Whether the fault has no slight severity."""
    return CATALOGUE[fault].least_severity > 0.0


def unexplained_cells() -> list[Cell]:
    """Faults outside the catalogue, whole, and one side of each pair."""
    cells = [(fault, 1.0) for fault in UNMODELLED for _ in range(PER_UNMODELLED_FAULT)]
    for kind in PAIRED:
        fault = f"{kind}:{SIDES[0]}"
        for i in range(PER_PAIR):
            severity = 0.2 + 0.8 * (i + 0.5) / PER_PAIR
            cells.append((fault, max(severity, CATALOGUE[fault].least_severity)))
    return cells


def thesis_cells() -> list[Cell]:
    """The thesis' faults, at its severities where it states them."""
    faults = {"increased_drag": 0.35, "decreased_drag": 0.7}
    for side in ("port", "starboard"):
        faults[f"propeller_damage:{side}"] = 0.7
        faults[f"propeller_loss:{side}"] = 1.0
        faults[f"seal_friction:{side}"] = 0.5
    return [cell for cell in faults.items() for _ in range(PER_FAULT_OF_THE_THESIS)]


def shifted(**plant: float) -> Conditions:
    """The standard conditions with another plant."""
    return replace(STANDARD, plant=dict(STANDARD.plant) | plant)


def recipes() -> dict[str, Recipe]:
    """The recipe of every suite."""
    shift_cells = even_cells(PER_CLASS_OF_A_SHIFT)
    slight_cells = graded_cells(PER_CLASS_OF_A_SHIFT, 0.05, 0.2)
    slight_cells = [cell for cell in slight_cells if not is_only_whole(cell[0])]
    thesis_speed = MissionSampler(speed=(THESIS_SPEED, THESIS_SPEED), n_legs=1, from_rest=0.0)
    fast_legs = MissionSampler(speed=(0.5, 0.9), duration=(4.0, 8.0), n_legs=16, from_rest=0.5)
    nominal_plant = PLANT | {"healthy_band": 0.0}
    nominal = Conditions(nominal_plant, 65.0, (thesis_speed,), Steering(0.0, 0.0))
    fast = replace(
        STANDARD,
        missions=(fast_legs,),
        steering=Steering(1.0, 0.4),
        whole_missions=WholeMissionSampler(speed=(0.5, 0.9), leg=(4.0, 8.0)),
    )
    return {
        "thesis": Recipe(thesis_cells(), nominal),
        "ideal": Recipe(graded_cells(PER_CLASS), IDEAL),
        "standard": Recipe(even_cells(PER_CLASS)),
        "ood_sensors": Recipe(shift_cells, shifted(realism=2.0)),
        "ood_noise": Recipe(shift_cells, shifted(sensor_noise=2.0)),
        "ood_disturbance": Recipe(shift_cells, shifted(disturbance=2.0)),
        "ood_vehicle": Recipe(shift_cells, shifted(healthy_band=2.0)),
        "ood_severity": Recipe(slight_cells),
        "ood_compound": Recipe(shift_cells, schedule=with_lesser_fault),
        "ood_mission": Recipe(shift_cells, fast),
        "unknown_faults": Recipe(unexplained_cells(), schedule=unexplained),
        "long": Recipe(shift_cells, LONG, late),
    }


def frozen(name: str, recipe: Recipe) -> Suite:
    """The suite of a recipe with its test seeds."""
    first = BLOCKS[name] * BLOCK
    healthy = {
        "threshold": seeds("test", 1, THRESHOLD)[0],
        "counting": seeds("test", 1, first + BLOCK // 2)[0],
    }
    return sampled(name, recipe, seeds("test", len(recipe.cells), first), healthy)


def sampled(name: str, recipe: Recipe, chosen: range, healthy: Mapping[str, int]) -> Suite:
    """The suite of a recipe, a seed per episode, at most one for each cell.

    The order is random, so that each k-th episode, or the first ones, are a fair sample.
    """
    order = np.random.default_rng(chosen[0]).permutation(len(recipe.cells))
    missions = map(rounded, recipe.conditions.sample_missions(chosen))
    schedules = [
        recipe.schedule(first_event(seed, *recipe.cells[k]), seed)
        for seed, k in zip(chosen, order[: len(chosen)], strict=True)
    ]
    episodes = tuple(map(Episode, chosen, schedules, missions))
    return Suite(name, ABOUT[name], recipe.conditions, healthy, episodes)


def first_event(seed: int, fault: str, severity: float) -> FaultEvent:
    """The fault with onset and ramp from the seed."""
    sampled = ONE_FAULT.sample(seed)[0]
    onset = round(sampled.onset, 2)
    ramp = round(sampled.ramp, 2)
    return FaultEvent(fault, onset, round(severity, 4), ramp)


def with_lesser_fault(first: FaultEvent, seed: int) -> Schedule:
    """The fault, and another class after it that is less severe."""
    return first, lesser_fault(first, seed)


def unexplained(event: FaultEvent, seed: int) -> Schedule:
    """A fault of the catalogue on both sides at once; another one alone, with its period."""
    kind, _, side = event.fault.partition(":")
    if event.fault in CATALOGUE:
        other = SIDES[1 - SIDES.index(side)]
        return event, replace(event, fault=f"{kind}:{other}")
    return (replace(event, **TEMPORARY.get(kind, {})),)


def late(event: FaultEvent, seed: int) -> Schedule:
    """The fault at the place in `LATE_ONSET` that it had among the onsets of the sampler."""
    low, high = ONE_FAULT.onset
    first, last = LATE_ONSET
    place = (event.onset - low) / (high - low)
    return (replace(event, onset=round(first + (last - first) * place, 2)),)


def lesser_fault(first: FaultEvent, seed: int) -> FaultEvent:
    """A fault of another class that follows the first and is less severe."""
    diagnosis = CATALOGUE[first.fault].diagnosis
    samples = (ONE_FAULT.sample(seed + BLOCK // 4 + k)[0] for k in count())
    second = next(event for event in samples if is_lesser(event, diagnosis))
    low, high = ONE_FAULT.onset
    delay = DELAY + MORE_DELAY * (second.onset - low) / (high - low)
    return FaultEvent(
        second.fault,
        onset=round(first.onset + delay, 2),
        severity=round(first.severity * second.severity, 4),
        ramp=round(second.ramp, 2),
    )


def is_lesser(event: FaultEvent, diagnosis: str) -> bool:
    """Whether an event can be the lesser one beside a fault of that class."""
    return CATALOGUE[event.fault].diagnosis != diagnosis and not is_only_whole(event.fault)


def rounded(mission: Mission) -> Mission:
    """The mission with times to 10 ms and speeds to 0.1 mm/s."""
    legs = tuple((round(start, 2), round(speed, 4)) for start, speed in mission.legs)
    return Mission(legs, round(mission.start_speed, 4))


def main(paths: Sequence[str]) -> None:
    """Write the packaged suites, or seal the given files as they are."""
    for path in map(Path, paths):
        path.write_bytes(suites.parse(suites.read(path), path).text().encode())
    for name, recipe in () if paths else recipes().items():
        (suites.FOLDER / f"{name}.json").write_bytes(frozen(name, recipe).text().encode())


if __name__ == "__main__":
    main(sys.argv[1:])
