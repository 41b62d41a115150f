"""What `auv-fault simulate` is asked for, checked: vehicles, seeds, faults and missions."""

import json
import os
from pathlib import Path
from typing import Any, NamedTuple

from auv_fault_env.distributions import TYPE, Distribution
from auv_fault_env.errors import InputError, known_name, refusal
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import (
    MISSIONS,
    Mission,
    MissionDistribution,
    MissionSampler,
    mission_of,
)
from auv_fault_env.parameters import SAMPLE_RATE, vehicle_of
from auv_fault_env.schedules import (
    Schedule,
    ScheduleDistribution,
    ScheduleSampler,
    load_schedule,
)
from auv_fault_env.text_files import text_of
from training import seeds
from training.arguments import Simulate
from training.field.vehicle_file import VehicleFile, read_vehicle
from training.formats.minari import FORMAT as MINARI


class Plan(NamedTuple):
    """Vehicles to simulate.

    Schedule and mission are those of all vehicles; None draws them from the distributions of
    `settings`, the arguments of a `Fleet`.
    """

    seeds: range  # by number of the vehicle
    n_steps: int
    schedule: Schedule | None
    mission: Mission | None
    settings: dict[str, Any]

    @property
    def distributions(self) -> dict[str, dict[str, Any]]:
        """The given distributions as an environment takes them, `schedules` and `missions`."""
        given = {name: self.settings[name] for name in ("schedules", "missions")}
        return {name: one.plain() for name, one in given.items() if one is not None}

    def fleet(self, n_lanes: int) -> Fleet:
        """Vehicles of the plan, not yet reset."""
        return Fleet(n_lanes, **self.settings)


def plan_of(arguments: Simulate) -> Plan:
    """The plan of the arguments; a schedule or mission that the vehicle cannot have is refused."""
    if not arguments.formats:
        allowed = "csv, parquet, minari or several"
        raise refusal("formats", arguments.formats, allowed, "name one")
    _check_one_source("schedule", arguments.schedule, arguments.schedules)
    _check_one_source("mission", arguments.mission, arguments.missions)
    plan = Plan(
        _seeds(arguments),
        round(arguments.duration * SAMPLE_RATE),
        None if arguments.schedule is None else _checked_schedule(arguments),
        None if arguments.mission is None else _mission(arguments.mission),
        _settings(arguments),
    )
    schedules = None if plan.schedule is None else [plan.schedule]
    missions = None if plan.mission is None else [plan.mission]
    plan.fleet(1).reset(plan.seeds[:1], schedules=schedules, missions=missions)
    return plan


def _check_one_source(name: str, of_all: Any, distribution: str | None) -> None:
    if of_all is not None and distribution is not None:
        allowed = f"no --{name}s beside --{name}, which is that of every vehicle"
        raise refusal(f"{name}s", distribution, allowed, "leave one of them out")


def _seeds(arguments: Simulate) -> range:
    if arguments.split is not None:
        purpose = seeds.SPLITS[known_name("split", arguments.split, seeds.SPLITS)]
        return seeds.seeds(purpose, arguments.vehicles, arguments.seed)
    return range(arguments.seed, arguments.seed + arguments.vehicles)


def _settings(arguments: Simulate) -> dict[str, Any]:
    own = {}
    vehicle = vehicle_of(arguments.preset)
    if arguments.vehicle is not None:
        file = _vehicle_file(arguments)
        vehicle = file.vehicle
        own = {"band": file.band, "noise": file.noise}
    schedules = None
    missions = None
    if arguments.schedules is not None:
        kinds = ScheduleDistribution, ScheduleSampler
        schedules = _distribution("schedules", arguments.schedules, *kinds, vehicle)
    if arguments.missions is not None:
        kinds = MissionDistribution, MissionSampler
        fastest = vehicle.maximum_speed
        missions = _distribution("missions", arguments.missions, *kinds, fastest)
    return {
        "preset": vehicle,
        "sensor_noise": arguments.sensor_noise,
        "disturbance": arguments.disturbance,
        "healthy_band": arguments.healthy_band,
        "realism": arguments.realism,
        "schedules": schedules,
        "missions": missions,
        **own,
    }


def _vehicle_file(arguments: Simulate) -> VehicleFile:
    if arguments.preset != Simulate.preset:
        allowed = "no --preset beside --vehicle, whose file names one"
        raise refusal("preset", arguments.preset, allowed, "leave one of them out")
    if MINARI in arguments.formats:
        allowed = "csv and parquet with --vehicle, as no environment has its healthy band"
        raise refusal("formats", MINARI, allowed, "leave it out")
    return read_vehicle(arguments.vehicle)


def _distribution(
    option: str, text: str, base: type[Distribution], usual: type[Distribution], of_vehicle: Any
) -> Distribution:
    """The distribution of that class, ``module:Class``, or of a JSON file with its fields.

    `of_vehicle` is what its `check` compares with.
    """
    is_class = ":" in text and not os.path.isfile(text)
    plain = {TYPE: text} if is_class else _json_object(option, Path(text))
    try:
        distribution = base.of(plain, usual)
        distribution.check(of_vehicle)
    except InputError:
        raise
    except Exception as error:  # foreign code, or fields of the wrong type
        allowed = f"the fields of a {base.__name__} (docs/extending.md)"
        got = f"{type(error).__name__}: {error}"
        raise refusal(f"{option} {text}", got, allowed, "correct it") from error
    return distribution


def _json_object(option: str, path: Path) -> dict[str, Any]:
    form = "a JSON file of the fields of a distribution, or module:Class"
    text = text_of(path, option, form)
    try:
        content = json.loads(text)
    except json.JSONDecodeError as error:
        place = f"{option} {path}, line {error.lineno} column {error.colno}"
        raise refusal(place, error.msg, form, "correct that place") from None
    # ValueError for a number of thousands of digits
    except (RecursionError, ValueError) as error:
        raise refusal(f"{option} {path}", str(error), form, "write plain fields") from None
    if not isinstance(content, dict):
        remedy = f"write an object, or give --{option[:-1]} what all vehicles share"
        raise refusal(f"{option} {path}", content, form, remedy)
    return content


def _checked_schedule(arguments: Simulate) -> Schedule:
    schedule = load_schedule(arguments.schedule)
    for event in schedule:
        if event.onset >= arguments.duration:
            name = f"onset of {event.fault}"
            allowed = f"before the episode's end at {arguments.duration:g} s"
            raise refusal(name, event.onset, allowed, "begin earlier or raise --duration")
    return schedule


def _mission(text: str) -> Mission:
    """The mission of that name, or at that speed."""
    try:
        speed = float(text)
    except ValueError:
        return mission_of(known_name("mission", text, [*MISSIONS, "a speed [m/s]"]))
    return mission_of(speed)
