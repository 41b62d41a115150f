"""``auv-fault simulate``: episodes of faulty vehicles as tables, one row per sample: time, channels, truth."""

import json
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
from tqdm import tqdm

from auv_fault_env.channels import CHANNELS
from auv_fault_env.errors import finite_in_range, refusal
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS, Mission, mission_of
from auv_fault_env.parameters import SAMPLE_RATE
from auv_fault_env.schedules import Events, Schedule, load_schedule, schedules_of, to_json
from auv_fault_env.truth import FleetTruth
from training.arguments import Simulate
from training.commands.simulate_page import page
from training.formats.minari import FORMAT as MINARI
from training.formats.minari import episodes, new_storage
from training.report.page import write_report
from training.report.run_folder import run_folder, write_json

ROWS_AT_ONCE = 150_000  # held in memory, about 400 bytes each
WRITERS = {"csv": pyarrow.csv.CSVWriter, "parquet": pyarrow.parquet.ParquetWriter}


class Chunk(NamedTuple):
    """Episodes of some vehicles: their numbers and seeds, (n_lanes,), and schedules by number.

    columns: channels and truth, (steps + 1, n_lanes) each, the first at the start.
    """

    vehicles: np.ndarray
    seeds: np.ndarray
    schedules: dict[int, Schedule]
    columns: dict[str, np.ndarray]


def main(arguments: Simulate) -> None:
    """Simulate and write; the output holds the tables, every vehicle's schedule, and a manifest."""
    steps = _checked_steps(arguments)
    schedule = None if arguments.schedule is None else _checked_schedule(arguments)
    mission = None if arguments.mission is None else _mission(arguments.mission)
    with run_folder(arguments.output, "simulate", arguments) as folder:
        results = write_tables(folder, arguments, steps, schedule, mission)
        write_json(folder / "results.json", results)
        write_report(results, folder)
    print(
        f"{steps * arguments.vehicles} rows of {arguments.vehicles} vehicles in {arguments.output}"
    )


def _checked_steps(arguments: Simulate) -> int:
    if arguments.vehicles < 1:
        raise refusal(
            "vehicles", arguments.vehicles, "a whole number from 1", "ask for at least one vehicle"
        )
    if not arguments.formats:
        raise refusal("formats", arguments.formats, "csv, parquet, minari or several", "name one")
    finite_in_range("seed", arguments.seed, 0, 2**62)
    _fleet(1, arguments)
    return round(
        finite_in_range("duration", arguments.duration, 1 / SAMPLE_RATE, 1e5) * SAMPLE_RATE
    )


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
            allowed = f"before the episode's end at {arguments.duration:g} s"
            raise refusal(
                f"onset of {event.fault}", event.onset, allowed, "begin earlier or raise --duration"
            )
    return schedule


def _mission(text: str) -> Mission:
    return mission_of(text if text in MISSIONS or not _is_number(text) else float(text))


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def write_tables(
    folder: Path,
    arguments: Simulate,
    steps: int,
    schedule: Schedule | None,
    mission: Mission | None,
) -> dict[str, Any]:
    """Write the episodes chunk by chunk, and schedules.json; returns the report as plain data."""
    writers: dict[str, Any] = {}
    schedules: dict[int, Schedule] = {}
    storage = new_storage(folder, arguments) if MINARI in arguments.formats else None
    with (
        ExitStack() as stack,
        tqdm(total=arguments.vehicles * steps, unit="sample", unit_scale=True) as bar,
    ):
        for chunk in _chunks(arguments, steps, schedule, mission, bar):
            table = _table(chunk)
            for kind in set(arguments.formats) & set(WRITERS):
                if kind not in writers:
                    writer = WRITERS[kind](str(folder / f"episodes.{kind}"), table.schema)
                    writers[kind] = stack.enter_context(writer)
                writers[kind].write_table(table)
            if storage is not None:
                storage.update_episodes(
                    episodes(chunk.columns, chunk.seeds, chunk.schedules.values(), mission)
                )
            if not schedules:
                first = {
                    name: table[name].slice(0, steps).to_numpy() for name in ("time", *CHANNELS)
                }
            schedules |= chunk.schedules
    plain = {vehicle: json.loads(to_json(events)) for vehicle, events in schedules.items()}
    write_json(folder / "schedules.json", plain)
    command = f"auv-fault simulate --vehicles {arguments.vehicles} --seed {arguments.seed}"
    return page(command, table.schema.names, schedules, arguments.seed, first)


def _chunks(
    arguments: Simulate, steps: int, schedule: Schedule | None, mission: Mission | None, bar: tqdm
) -> Iterator[Chunk]:
    at_once = max(1, ROWS_AT_ONCE // steps)
    for first in range(0, arguments.vehicles, at_once):
        vehicles = np.arange(first, min(first + at_once, arguments.vehicles))
        fleet = _fleet(vehicles.size, arguments)
        seeds = arguments.seed + vehicles
        observation = fleet.reset(
            seeds.tolist(),
            schedules=None if schedule is None else [schedule] * vehicles.size,
            missions=None if mission is None else [mission] * vehicles.size,
        )
        columns = roll_out(fleet, observation, steps, bar)
        planned = schedules_of(Events(fleet.plan.fault, fleet.plan.profile))
        yield Chunk(vehicles, seeds, dict(zip(vehicles.tolist(), planned, strict=True)), columns)


def roll_out(fleet: Fleet, observation: np.ndarray, steps: int, bar: tqdm) -> dict[str, np.ndarray]:
    """Let every lane follow its mission; columns (steps + 1, n_lanes) of channels and truth, the first at the start."""
    samples = [_sample(fleet, observation)]
    actions = np.zeros((fleet.n_lanes, 3))
    for _ in range(steps):
        actions[:, 0] = observation[:, 0]
        observation = fleet.step(actions)
        samples.append(_sample(fleet, observation))
        bar.update(fleet.n_lanes)
    return {name: np.stack([sample[name] for sample in samples]) for name in samples[0]}


def _sample(fleet: Fleet, observation: np.ndarray) -> dict[str, np.ndarray]:
    truth = FleetTruth(fleet)
    severity = np.stack(list(truth["severity"].values()))
    plant = {
        name: value
        for name, value in truth["parameters"].items()
        if not name.startswith(tuple(CHANNELS))
    }
    columns = {"time": fleet.time} | dict(zip(CHANNELS, observation.T, strict=True))
    columns |= {
        "truth_label": truth["label"],
        "truth_severity": severity.max(axis=0),
        "truth_onset": truth["onset"],
    }
    columns |= dict(
        zip(("truth_reward", "truth_energy", "truth_cost"), fleet.outcomes[:3], strict=True)
    )
    return columns | {f"truth_{name}": value for name, value in (truth["state"] | plant).items()}


def _table(chunk: Chunk) -> pa.Table:
    """One row per vehicle and sample, that at the start left out."""
    steps = len(chunk.columns["time"]) - 1
    keys = {"vehicle": np.repeat(chunk.vehicles, steps), "seed": np.repeat(chunk.seeds, steps)}
    return pa.table(keys | {name: values[1:].T.ravel() for name, values in chunk.columns.items()})
