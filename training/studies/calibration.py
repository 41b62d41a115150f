"""Does a calibration find vehicles far from the preset? ``python -m training.studies.calibration``.

Vehicles are sampled around a preset and simulated. Their logs are written with other column names,
units and separator than this project's, and read back with a vehicle file of the preset.
"""

import statistics
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
from tqdm import tqdm

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.errors import finite_in_range
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS
from auv_fault_env.parameters import PRESETS, SAMPLE_RATE, Vehicle
from training.field.calibration.calibration import Calibration, calibrate
from training.field.logs.log import Log, read_log
from training.field.units import UNITS
from training.field.vehicle_file import (
    Column,
    VehicleFile,
    read_vehicle,
    write_vehicle,
)
from training.report.sections import table_section
from training.rollouts import roll_out
from training.seeds import seeds
from training.studies.run import command_line, run_study

SAMPLED = ("alpha", "beta", "torque_constant", "resistance", "coulomb_friction")
HALF_WIDTH = 0.3  # of the range of the sampled parameters around the preset, relative
DURATION = 120.0  # s, of a log
LOGS = 3  # with the thesis' speed steps, and as many with random missions
FIRST_SEED = 600_000_000  # within those of tests
FOREIGN_COLUMNS = {  # column and unit by channel
    "speed_command": ("u_soll", "kn"),
    "rudder": ("ruder", "deg"),
    "stern_plane": ("tiefenruder", "deg"),
    "speed": ("fahrt", "kn"),
    "acceleration": ("a_laengs", "g"),
    "port_voltage": ("U_bb", "mV"),
    "port_current": ("I_bb", "mA"),
    "port_rpm": ("n_bb", "rev/s"),
    "starboard_voltage": ("U_stb", "mV"),
    "starboard_current": ("I_stb", "mA"),
    "starboard_rpm": ("n_stb", "rev/s"),
}


@dataclass(frozen=True)
class CalibrationStudy:
    """Calibrate vehicles around a preset and count the parameters inside their 95 % intervals."""

    output: Path = Path("runs/calibration-study")
    """Folder of the report; an earlier run there is replaced."""
    vehicles: int = 100
    """Number of vehicles, six logs of 120 s each."""
    preset: str = "npsnet1995"
    """Preset around which vehicles are sampled, and from which the calibration starts."""
    seed: int = 0
    """Offset of the vehicles, and within the seeds of tests."""


def main(arguments: CalibrationStudy) -> None:
    """Calibrate, count, and write the results."""
    finite_in_range("vehicles", arguments.vehicles, 2, 10_000)
    finite_in_range("seed", arguments.seed, 0, 1_000_000)
    run_study("calibration", arguments, lambda folder: study(arguments))


def study(arguments: CalibrationStudy) -> dict[str, Any]:
    """Counts, widths and errors, as plain data and as a page."""
    numbers = range(arguments.seed, arguments.seed + arguments.vehicles)
    vehicles = []
    for number in tqdm(numbers, unit="vehicle"):
        truth = sampled_vehicle(PRESETS[arguments.preset], number)
        calibration = calibrate(*simulated_logs(truth, number))
        vehicles.append(compared_with_truth(calibration, truth))
    rows = summary(vehicles)
    return page(rows, len(vehicles)) | {"parameters": rows, "vehicles": vehicles}


def sampled_vehicle(preset: Vehicle, seed: int) -> Vehicle:
    """A vehicle whose `SAMPLED` parameters are uniform within `HALF_WIDTH` of the preset's."""
    offsets = np.random.default_rng(seed).uniform(-1.0, 1.0, len(SAMPLED))
    factors = 1.0 + HALF_WIDTH * offsets
    values = {
        name: getattr(preset, name) * float(factor)
        for name, factor in zip(SAMPLED, factors, strict=True)
    }
    return replace(preset, **values)


def simulated_logs(vehicle: Vehicle, seed: int) -> tuple[list[Log], VehicleFile]:
    """Healthy logs of a vehicle, read back from files, and its preset's vehicle file."""
    n_samples = 1 + round(DURATION * SAMPLE_RATE)
    log_seeds = seeds("test", 2 * LOGS, FIRST_SEED + 2 * LOGS * seed)
    logs = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_vehicle(folder / "vehicle.toml", foreign_file(PRESETS[vehicle.name]))
        file = read_vehicle(folder / "vehicle.toml")
        halves = (
            (log_seeds[:LOGS], [MISSIONS["thesis"]] * LOGS),
            (log_seeds[LOGS:], None),
        )
        for lanes, missions in halves:
            fleet = Fleet(LOGS, vehicle, healthy_band=0.0)
            rollout = roll_out(fleet, lanes, n_samples, schedules=[()] * LOGS, missions=missions)
            for lane in range(LOGS):
                path = folder / f"{lanes[lane]}.csv"
                write_foreign_log(path, rollout.observations[1:, lane])
                logs.append(read_log(path, file))
    return logs, file


def foreign_file(vehicle: Vehicle) -> VehicleFile:
    """The file of a vehicle that logs the `FOREIGN_COLUMNS`."""
    columns = {
        channel: Column(name, UNITS[CHANNELS[channel].unit][unit])
        for channel, (name, unit) in FOREIGN_COLUMNS.items()
    }
    return VehicleFile(vehicle, columns, Column("zeit", 1e-3))


def write_foreign_log(path: Path, observations: np.ndarray) -> None:
    """Write observations (n_samples, n_channels) float32 as CSV in the `FOREIGN_COLUMNS`."""
    time = np.arange(1, 1 + len(observations)) / SAMPLE_RATE
    table = {"zeit": 1000.0 * time}
    for channel, (name, unit) in FOREIGN_COLUMNS.items():
        # the shortest decimal numbers that stand for the float32 readings
        readings = observations[:, INDEX[channel]].astype(str).astype(float)
        table[name] = readings / UNITS[CHANNELS[channel].unit][unit]
    options = pyarrow.csv.WriteOptions(delimiter=";")
    pyarrow.csv.write_csv(pa.table(table), path, options)


def compared_with_truth(calibration: Calibration, truth: Vehicle) -> dict[str, dict[str, Any]]:
    """By sampled parameter: value, interval, and whether it contains the truth.

    A parameter that was not identified counts as outside.
    """
    comparison = {}
    for name in SAMPLED:
        estimate = calibration.parameter(name)
        true = getattr(truth, name)
        is_fitted = calibration.is_fitted(name)
        comparison[name] = {
            "true": true,
            "value": estimate.value,
            "interval": [estimate.low, estimate.high] if is_fitted else None,
            "inside": bool(is_fitted and estimate.low <= true <= estimate.high),
            "before": estimate.before,
        }
    return comparison


def summary(vehicles: Sequence[Mapping[str, Mapping[str, Any]]]) -> dict[str, Any]:
    """Counts inside, median half-widths of the intervals, median errors (relative), and `all`.

    `all` counts the vehicles whose parameters are all inside.
    """
    rows = {name: _summary_row([vehicle[name] for vehicle in vehicles]) for name in SAMPLED}
    all_inside = [all(vehicle[name]["inside"] for name in SAMPLED) for vehicle in vehicles]
    return rows | {"all": {"inside": sum(all_inside)}}


def _summary_row(results: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The summary of one parameter over all vehicles."""
    fitted = [result for result in results if result["interval"]]
    half_widths = [np.ptp(result["interval"]) / 2 / abs(result["true"]) for result in fitted]
    errors = [abs(result["value"] / result["true"] - 1.0) for result in results]
    errors_before = [abs(result["before"] / result["true"] - 1.0) for result in results]
    return {
        "inside": sum(result["inside"] for result in results),
        "half_width": float(np.median(half_widths)),
        "error": float(np.median(errors)),
        "error_before": float(np.median(errors_before)),
    }


def page(rows: Mapping[str, Mapping[str, Any]], n_vehicles: int) -> dict[str, Any]:
    """The report's sections."""
    shares = ("half_width", "error", "error_before")
    cells = []
    for name, row in rows.items():
        share_cells = [f"{100 * row[key]:.2f} %" if key in row else "" for key in shares]
        cells.append([name, str(row["inside"]), *share_cells])
    columns = [
        "parameter",
        f"inside, of {n_vehicles}",
        "median half-width",
        "median error",
    ]
    of_parameters = [row for name, row in rows.items() if name != "all"]
    least = 100.0 * min(row["inside"] for row in of_parameters) / n_vehicles
    before = 100.0 * statistics.mean(row["error_before"] for row in of_parameters)
    after = 100.0 * statistics.mean(row["error"] for row in of_parameters)
    intro = (
        f"{n_vehicles} vehicles with {', '.join(SAMPLED)} within {100 * HALF_WIDTH:.0f} % of the "
        f"preset. Each is calibrated on {2 * LOGS} logs of {DURATION:g} s with default noise and "
        "disturbance; half of the logs follow the thesis' speed steps. Inside: the true value "
        "lies in the 95 % interval."
    )
    return {
        "title": "Does a calibration find vehicles far from the preset?",
        "summary": [
            f"{n_vehicles} simulated vehicles up to {100 * HALF_WIDTH:.0f} % from the preset were "
            "calibrated on their healthy logs.",
            f"{rows['all']['inside']} of them have every parameter within its 95 % interval. One "
            f"interval should hold in 95 % of the cases; the least does in {least:.0f} %.",
            f"The median error falls from {before:.1f} % (the preset's values) to {after:.1f} %, "
            "mean of the parameters.",
        ],
        "intro": [intro],
        "sections": [table_section("Intervals", [*columns, "error of the preset"], cells)],
    }


if __name__ == "__main__":
    command_line(main)
