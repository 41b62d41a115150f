"""``auv-fault simulate``: episodes of faulty vehicles as tables, one row per sample."""

import json
import shlex
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from auv_fault_env.channels import CHANNELS
from auv_fault_env.fleet import Fleet
from auv_fault_env.printable import printable
from auv_fault_env.schedules import PROFILE, Events, Schedule, schedules_of, to_json
from auv_fault_env.truth import FleetTruth
from auv_fault_env.unmodelled import plant_fault
from training.arguments import Simulate
from training.commands.simulate_page import report
from training.commands.simulate_plan import Plan, plan_of
from training.formats.columns import PLANT_PARAMETERS, TABLES, write_dictionary
from training.formats.minari import FORMAT as MINARI
from training.formats.minari import episodes, new_storage
from training.formats.tables import WRITERS, TableFiles
from training.report.page import write_report
from training.report.run_folder import run_folder, write_json

ROWS_AT_ONCE = 150_000  # held in memory, about 400 bytes each


class Chunk(NamedTuple):
    """Episodes of some vehicles: numbers and seeds (n_lanes,), schedules by number.

    `columns` are channels and truth, (n_steps + 1, n_lanes) each, the first sample at the start.
    """

    vehicles: np.ndarray
    seeds: np.ndarray
    schedules: dict[int, Schedule]
    columns: dict[str, np.ndarray]


def main(arguments: Simulate) -> None:
    """Simulate; the output holds the tables, the schedule of every vehicle, and a manifest."""
    plan = plan_of(arguments)
    with run_folder(arguments.output, "simulate", arguments) as folder:
        results = write_tables(folder, arguments, plan)
        write_json(folder / "results.json", results)
        write_report(results, folder)
    n_rows = plan.n_steps * len(plan.seeds)
    print(f"{n_rows} rows of {arguments.vehicles} vehicles in {arguments.output}")


def write_tables(folder: Path, arguments: Simulate, plan: Plan) -> dict[str, Any]:
    """Write the episodes chunk by chunk, and schedules.json; returns the report as plain data."""
    schedules: dict[int, Schedule] = {}
    storage = None
    if MINARI in arguments.formats:
        storage = new_storage(folder, arguments, plan.distributions)
    if set(WRITERS) & set(arguments.formats):
        write_dictionary(folder)
    n_samples = len(plan.seeds) * plan.n_steps
    with (
        ExitStack() as stack,
        tqdm(total=n_samples, unit="sample", unit_scale=True) as bar,
    ):
        files = {
            name: TableFiles(folder, name, schema, arguments.formats, stack)
            for name, schema in TABLES.items()
        }
        for chunk in _chunks(plan, bar):
            files["episodes"].append(_episode_columns(chunk))
            files["events"].append(_event_columns(chunk))
            if storage is not None:
                planned = chunk.schedules.values()
                made = episodes(chunk.columns, chunk.seeds, planned, plan.mission)
                storage.update_episodes(made)
            if not schedules:
                first_vehicle = _first_vehicle(chunk)
            schedules |= chunk.schedules
    plain = {vehicle: json.loads(to_json(events)) for vehicle, events in schedules.items()}
    write_json(folder / "schedules.json", plain)
    return report(_command(arguments), schedules, plan.seeds, first_vehicle)


def _command(arguments: Simulate) -> str:
    """The command with its size, and all options but the output that are not their defaults."""
    words = ["auv-fault", "simulate"]
    for option in fields(arguments):
        value = getattr(arguments, option.name)
        is_named = option.name in ("vehicles", "seed") or value != option.default
        if is_named and option.name != "output":
            values = value if isinstance(value, tuple) else (value,)
            words += [f"--{option.name.replace('_', '-')}", *map(str, values)]
    return printable(shlex.join(words))


def _first_vehicle(chunk: Chunk) -> dict[str, np.ndarray]:
    """Time and channels of the first vehicle, (n_steps,) each."""
    return {name: chunk.columns[name][1:, 0] for name in ("time", *CHANNELS)}


def _chunks(plan: Plan, bar: tqdm) -> Iterator[Chunk]:
    n_lanes = max(1, ROWS_AT_ONCE // plan.n_steps)
    for first in range(0, len(plan.seeds), n_lanes):
        seeds = plan.seeds[first : first + n_lanes]
        fleet = plan.fleet(len(seeds))
        observation = fleet.reset(
            seeds,
            schedules=None if plan.schedule is None else [plan.schedule] * len(seeds),
            missions=None if plan.mission is None else [plan.mission] * len(seeds),
        )
        columns = roll_out_with_truth(fleet, observation, plan.n_steps, bar)
        planned = schedules_of(Events(fleet.plan.fault, fleet.plan.profile))
        vehicles = np.arange(first, first + len(seeds))
        schedules = dict(zip(vehicles.tolist(), planned, strict=True))
        yield Chunk(vehicles, np.array(seeds), schedules, columns)


def roll_out_with_truth(
    fleet: Fleet, observation: np.ndarray, n_steps: int, bar: tqdm
) -> dict[str, np.ndarray]:
    """Let every lane follow its mission; channels and truth, (n_steps + 1, n_lanes) each.

    `observation` is that of the reset, the first sample.
    """
    first = _sample(fleet, observation)
    # a list of samples would take 20 times the memory of one lane
    columns = {name: np.empty((n_steps + 1, *row.shape), row.dtype) for name, row in first.items()}
    for name, row in first.items():
        columns[name][0] = row
    actions = np.zeros((fleet.n_lanes, 3))
    for step in range(1, n_steps + 1):
        actions[:, 0] = observation[:, 0]
        observation = fleet.step(actions)
        for name, row in _sample(fleet, observation).items():
            columns[name][step] = row
        bar.update(fleet.n_lanes)
    return columns


def _sample(fleet: Fleet, observation: np.ndarray) -> dict[str, np.ndarray]:
    """Time, channels and truth of one sample, (n_lanes,) each."""
    truth = FleetTruth(fleet)
    severity = np.stack(list(truth["severity"].values()))
    reward, energy, cost = fleet.outcomes[:3]
    columns = {"time": fleet.time}
    columns |= dict(zip(CHANNELS, observation.T, strict=True))
    columns |= {
        "truth_label": truth["label"],
        "truth_severity": severity.max(axis=0),
        "truth_onset": truth["onset"],
        "truth_reward": reward,
        "truth_energy": energy,
        "truth_cost": cost,
    }
    for name, value in truth["state"].items():
        columns[f"truth_{name}"] = value
    parameters = truth["parameters"]
    for name in PLANT_PARAMETERS:
        columns[f"truth_{name}"] = parameters[name]
    return columns


def _episode_columns(chunk: Chunk) -> dict[str, np.ndarray]:
    """One row per vehicle and sample, without the sample at the start."""
    n_steps = len(chunk.columns["time"]) - 1
    columns = {
        "vehicle": np.repeat(chunk.vehicles, n_steps),
        "seed": np.repeat(chunk.seeds, n_steps),
    }
    for name, values in chunk.columns.items():
        columns[name] = values[1:].T.ravel()
    return columns


def _event_columns(chunk: Chunk) -> dict[str, list]:
    """One row per fault event."""
    columns: dict[str, list] = {name: [] for name in TABLES["events"].names}
    schedules = zip(chunk.schedules.items(), chunk.seeds.tolist(), strict=True)
    for (vehicle, schedule), seed in schedules:
        for number, event in enumerate(schedule):
            fault = plant_fault(event.fault)
            row = {
                "vehicle": vehicle,
                "seed": seed,
                "event": number,
                "fault": event.fault,
                "class": fault.diagnosis,
                "component": fault.component,
            }
            row |= {name: getattr(event, name) for name in PROFILE}
            for name, value in row.items():
                columns[name].append(value)
    return columns
