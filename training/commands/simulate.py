"""``auv-fault simulate``: episodes of faulty vehicles as tables, one row per sample."""

import json
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
from tqdm import tqdm

from auv_fault_env.channels import CHANNELS
from auv_fault_env.errors import refusal
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import Mission, mission_of
from auv_fault_env.parameters import SAMPLE_RATE
from auv_fault_env.schedules import (
    Events,
    Schedule,
    load_schedule,
    schedules_of,
    to_json,
)
from auv_fault_env.truth import FleetTruth
from training.arguments import Simulate
from training.commands.simulate_page import report
from training.formats.minari import FORMAT as MINARI
from training.formats.minari import episodes, new_storage
from training.report.page import write_report
from training.report.run_folder import run_folder, write_json

ROWS_AT_ONCE = 150_000  # held in memory, about 400 bytes each
WRITERS = {"csv": pyarrow.csv.CSVWriter, "parquet": pyarrow.parquet.ParquetWriter}


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
    n_steps = _checked_steps(arguments)
    schedule = None if arguments.schedule is None else _checked_schedule(arguments)
    mission = None if arguments.mission is None else _mission(arguments.mission)
    _check_plan(arguments, schedule, mission)
    with run_folder(arguments.output, "simulate", arguments) as folder:
        results = write_tables(folder, arguments, n_steps, schedule, mission)
        write_json(folder / "results.json", results)
        write_report(results, folder)
    n_rows = n_steps * arguments.vehicles
    print(f"{n_rows} rows of {arguments.vehicles} vehicles in {arguments.output}")


def _checked_steps(arguments: Simulate) -> int:
    if not arguments.formats:
        raise refusal(
            "formats",
            arguments.formats,
            "csv, parquet, minari or several",
            "name one",
        )
    _fleet(1, arguments)
    return round(arguments.duration * SAMPLE_RATE)


def _fleet(n_lanes: int, arguments: Simulate) -> Fleet:
    return Fleet(
        n_lanes,
        arguments.preset,
        arguments.sensor_noise,
        arguments.disturbance,
        arguments.healthy_band,
    )


def _checked_schedule(arguments: Simulate) -> Schedule:
    schedule = load_schedule(arguments.schedule)
    for event in schedule:
        if event.onset >= arguments.duration:
            name = f"onset of {event.fault}"
            allowed = f"before the episode's end at {arguments.duration:g} s"
            raise refusal(name, event.onset, allowed, "begin earlier or raise --duration")
    return schedule


def _check_plan(arguments: Simulate, schedule: Schedule | None, mission: Mission | None) -> None:
    """Refuse a schedule or a mission that the vehicle cannot have."""
    schedules = None if schedule is None else [schedule]
    missions = None if mission is None else [mission]
    _fleet(1, arguments).reset([0], schedules=schedules, missions=missions)


def _mission(text: str) -> Mission:
    """The mission of that name, or at that speed."""
    name_or_speed: str | float = text
    with suppress(ValueError):
        name_or_speed = float(text)
    return mission_of(name_or_speed)


class TableFiles:
    """The tables in several formats, each a file that grows by the chunks."""

    def __init__(self, folder: Path, formats: Sequence[str], stack: ExitStack):
        self._paths = {name: folder / f"episodes.{name}" for name in WRITERS if name in formats}
        self._stack = stack
        self._writers: dict[str, Any] = {}

    def append(self, table: pa.Table) -> None:
        """Write a table behind those before."""
        for name, path in self._paths.items():
            if name not in self._writers:
                # a file, because Arrow takes no path that is not UTF-8
                file = self._stack.enter_context(path.open("wb"))
                writer = WRITERS[name](file, table.schema)
                self._writers[name] = self._stack.enter_context(writer)
            self._writers[name].write_table(table)


def write_tables(
    folder: Path,
    arguments: Simulate,
    n_steps: int,
    schedule: Schedule | None,
    mission: Mission | None,
) -> dict[str, Any]:
    """Write the episodes chunk by chunk, and schedules.json; returns the report as plain data.

    Schedule and mission are those of all vehicles; None samples them.
    """
    schedules: dict[int, Schedule] = {}
    storage = new_storage(folder, arguments) if MINARI in arguments.formats else None
    n_samples = arguments.vehicles * n_steps
    with (
        ExitStack() as stack,
        tqdm(total=n_samples, unit="sample", unit_scale=True) as bar,
    ):
        files = TableFiles(folder, arguments.formats, stack)
        for chunk in _chunks(arguments, n_steps, schedule, mission, bar):
            table = _table(chunk)
            files.append(table)
            if storage is not None:
                planned = chunk.schedules.values()
                storage.update_episodes(episodes(chunk.columns, chunk.seeds, planned, mission))
            if not schedules:
                first_vehicle = _first_vehicle(table, n_steps)
            schedules |= chunk.schedules
    plain = {vehicle: json.loads(to_json(events)) for vehicle, events in schedules.items()}
    write_json(folder / "schedules.json", plain)
    command = f"auv-fault simulate --vehicles {arguments.vehicles} --seed {arguments.seed}"
    return report(command, table.schema.names, schedules, arguments.seed, first_vehicle)


def _first_vehicle(table: pa.Table, n_steps: int) -> dict[str, np.ndarray]:
    """Time and channels of the first vehicle, (n_steps,) each."""
    return {name: table[name].slice(0, n_steps).to_numpy() for name in ("time", *CHANNELS)}


def _chunks(
    arguments: Simulate,
    n_steps: int,
    schedule: Schedule | None,
    mission: Mission | None,
    bar: tqdm,
) -> Iterator[Chunk]:
    n_lanes = max(1, ROWS_AT_ONCE // n_steps)
    for first in range(0, arguments.vehicles, n_lanes):
        vehicles = np.arange(first, min(first + n_lanes, arguments.vehicles))
        fleet = _fleet(vehicles.size, arguments)
        seeds = arguments.seed + vehicles
        observation = fleet.reset(
            seeds.tolist(),
            schedules=None if schedule is None else [schedule] * vehicles.size,
            missions=None if mission is None else [mission] * vehicles.size,
        )
        columns = roll_out_with_truth(fleet, observation, n_steps, bar)
        planned = schedules_of(Events(fleet.plan.fault, fleet.plan.profile))
        schedules = dict(zip(vehicles.tolist(), planned, strict=True))
        yield Chunk(vehicles, seeds, schedules, columns)


def roll_out_with_truth(
    fleet: Fleet, observation: np.ndarray, n_steps: int, bar: tqdm
) -> dict[str, np.ndarray]:
    """Let every lane follow its mission; channels and truth, (n_steps + 1, n_lanes) each.

    `observation` is that of the reset, the first sample.
    """
    samples = [_sample(fleet, observation)]
    actions = np.zeros((fleet.n_lanes, 3))
    for _ in range(n_steps):
        actions[:, 0] = observation[:, 0]
        observation = fleet.step(actions)
        samples.append(_sample(fleet, observation))
        bar.update(fleet.n_lanes)
    return {name: np.stack([sample[name] for sample in samples]) for name in samples[0]}


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
    sensors = tuple(CHANNELS)
    for name, value in truth["state"].items():
        columns[f"truth_{name}"] = value
    for name, value in truth["parameters"].items():
        if not name.startswith(sensors):
            columns[f"truth_{name}"] = value
    return columns


def _table(chunk: Chunk) -> pa.Table:
    """One row per vehicle and sample, without the sample at the start."""
    n_steps = len(chunk.columns["time"]) - 1
    columns = {
        "vehicle": np.repeat(chunk.vehicles, n_steps),
        "seed": np.repeat(chunk.seeds, n_steps),
    }
    for name, values in chunk.columns.items():
        columns[name] = values[1:].T.ravel()
    return pa.table(columns)
