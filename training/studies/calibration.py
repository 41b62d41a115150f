"""Does a calibration find vehicles far from the preset? ``python -m training.studies.calibration``.

Vehicles are drawn around a preset and simulated by `training.commands.simulate`; its CSV is
rewritten as a stranger would log it (other names, units and separator) and read back by a vehicle
file that knows the preset only.
"""

import contextlib
import io
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute
import pyarrow.csv
import tyro
from tqdm import tqdm

from auv_fault_env.channels import CHANNELS
from auv_fault_env.errors import finite_in_range
from auv_fault_env.missions import MISSIONS
from auv_fault_env.parameters import PRESETS, SAMPLE_RATE, Vehicle
from training.arguments import Simulate
from training.commands.simulate import write_tables
from training.field.calibration.calibration import Calibration, calibrated
from training.field.logs.log import Log, read_log
from training.field.units import UNITS
from training.field.vehicle_file import Column, VehicleFile, read_vehicle, write_vehicle
from training.report.page import print_tables, write_report
from training.report.run_folder import run_folder, write_json
from training.seeds import seeds

DRAWN = ("alpha", "beta", "torque_constant", "resistance", "coulomb_friction")
SPREAD = 0.3  # of the drawn parameters around the preset, relative
DURATION = 120.0  # s, of a log
LOGS = 3  # with the thesis' speed steps, and as many with random missions
FIRST_SEED = 600_000_000  # within those of tests
STRANGE = {  # of the stranger's log: column and unit by channel
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
    """Calibrate vehicles drawn around a preset and count how often their parameters are within the 95 % intervals."""

    output: Path = Path("runs/calibration-study")
    """Folder of the report; an earlier run there is replaced."""
    vehicles: int = 100
    """Number of vehicles, six logs of 120 s each."""
    preset: str = "npsnet1995"
    """Preset that the vehicles are drawn around, and the one that the calibration starts from."""
    seed: int = 0
    """Offset of the vehicles, and within the seeds of tests."""


def main(arguments: CalibrationStudy) -> None:
    """Calibrate, count, and write the results."""
    finite_in_range("vehicles", arguments.vehicles, 2, 10_000)
    finite_in_range("seed", arguments.seed, 0, 1_000_000)
    with run_folder(arguments.output, "calibration-study", arguments) as folder:
        results = study(arguments)
        write_json(folder / "results.json", results)
        write_report(results, folder)
    print_tables(results["sections"])
    print(f"\nreport: {arguments.output / 'index.html'}")


def study(arguments: CalibrationStudy) -> dict[str, Any]:
    """Counts, widths and errors, as plain data and as a page."""
    numbers = range(arguments.seed, arguments.seed + arguments.vehicles)
    found = []
    for number in tqdm(numbers, unit="vehicle"):
        vehicle = drawn(PRESETS[arguments.preset], number)
        found.append(judged(calibrated(*logged(vehicle, number)), vehicle))
    command = f"python -m training.studies.calibration --vehicles {arguments.vehicles} --seed {arguments.seed}"
    return page(summary(found), found) | {
        "command": command,
        "summary": summary(found),
        "vehicles": found,
    }


def drawn(preset: Vehicle, seed: int) -> Vehicle:
    """A vehicle whose `DRAWN` parameters are anywhere within `SPREAD` of the preset's."""
    factors = 1.0 + SPREAD * np.random.default_rng(seed).uniform(-1.0, 1.0, len(DRAWN))
    values = {
        name: getattr(preset, name) * float(factor)
        for name, factor in zip(DRAWN, factors, strict=True)
    }
    return replace(preset, **values)


def logged(vehicle: Vehicle, seed: int) -> tuple[list[Log], VehicleFile]:
    """Healthy logs of the vehicle, simulated, rewritten and read back; and the file of its preset that reads them."""
    first = seeds("test", 2 * LOGS, FIRST_SEED + 2 * LOGS * seed)[0]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_vehicle(folder / "vehicle.toml", stranger(PRESETS[vehicle.name]))
        file = read_vehicle(folder / "vehicle.toml")
        paths = []
        for k, mission in enumerate((MISSIONS["thesis"], None)):
            given = dict(
                vehicles=LOGS,
                duration=DURATION,
                seed=first + k * LOGS,
                preset=vehicle,
                formats=("csv",),
            )
            arguments = Simulate(output=folder, healthy_band=0.0, **given)
            with contextlib.redirect_stderr(io.StringIO()):  # its progress bar
                write_tables(folder, arguments, round(DURATION * SAMPLE_RATE), (), mission)
            paths += rewritten(folder / "episodes.csv", folder / f"{k}")
        return [read_log(path, file) for path in paths], file


def stranger(vehicle: Vehicle) -> VehicleFile:
    """The file of a vehicle that logs as `STRANGE` says."""
    columns = {name: Column(*strange(name)) for name in STRANGE}
    return VehicleFile(vehicle, columns, Column("zeit", 1e-3))


def strange(channel: str) -> tuple[str, float]:
    """The stranger's column for a channel, and the factor from its unit to the channel's."""
    name, unit = STRANGE[channel]
    return name, UNITS[CHANNELS[channel].unit][unit]


def rewritten(episodes: Path, folder: Path) -> list[Path]:
    """The episodes of a simulated CSV as a stranger's, one file each."""
    folder.mkdir()
    table = pyarrow.csv.read_csv(episodes)
    paths = []
    for vehicle in table["vehicle"].unique().to_pylist():
        rows = table.filter(pyarrow.compute.equal(table["vehicle"], vehicle))
        columns = {"zeit": 1000.0 * rows["time"].to_numpy()}
        columns |= {
            strange(channel)[0]: rows[channel].to_numpy() / strange(channel)[1]
            for channel in STRANGE
        }
        paths.append(folder / f"fahrt-{vehicle}.csv")
        pyarrow.csv.write_csv(pa.table(columns), paths[-1], pyarrow.csv.WriteOptions(delimiter=";"))
    return paths


def judged(calibration: Calibration, truth: Vehicle) -> dict[str, dict[str, Any]]:
    """By drawn parameter: value, interval, and whether the truth is inside; a parameter not identified is outside."""
    found = {}
    for name in DRAWN:
        estimate = calibration.estimate(name)
        true = getattr(truth, name)
        known = name in calibration.part(name).fit.names
        found[name] = {
            "true": true,
            "value": estimate.value,
            "interval": [estimate.low, estimate.high] if known else None,
            "inside": bool(known and estimate.low <= true <= estimate.high),
            "before": estimate.before,
        }
    return found


def summary(found: Sequence[Mapping[str, Mapping[str, Any]]]) -> dict[str, Any]:
    """Counts inside, median half-widths of the intervals and median errors, relative; and how often all are inside."""
    rows = {}
    for name in DRAWN:
        ones = [one[name] for one in found]
        known = [one for one in ones if one["interval"]]
        rows[name] = {
            "inside": sum(one["inside"] for one in ones),
            "half_width": float(
                np.median([np.ptp(one["interval"]) / 2 / abs(one["true"]) for one in known])
            ),
            "error": float(np.median([abs(one["value"] / one["true"] - 1.0) for one in ones])),
            "error_before": float(
                np.median([abs(one["before"] / one["true"] - 1.0) for one in ones])
            ),
        }
    return rows | {
        "all": {"inside": sum(all(one[name]["inside"] for name in DRAWN) for one in found)}
    }


def page(rows: Mapping[str, Mapping[str, Any]], found: Sequence[Any]) -> dict[str, Any]:
    """The report's sections."""
    cells = [
        [
            name,
            str(row["inside"]),
            *(
                f"{100 * row[key]:.2f} %" if key in row else ""
                for key in ("half_width", "error", "error_before")
            ),
        ]
        for name, row in rows.items()
    ]
    columns = [
        "parameter",
        f"inside, of {len(found)}",
        "median half-width",
        "median error",
        "error of the preset",
    ]
    return {
        "title": "Does a calibration find vehicles far from the preset?",
        "intro": [
            f"{len(found)} vehicles with {', '.join(DRAWN)} within {100 * SPREAD:.0f} % of the preset, each calibrated "
            f"on {2 * LOGS} logs of {DURATION:g} s, half of them the thesis' speed steps, with default noise and "
            "disturbance. Inside: the true value lies in the 95 % interval."
        ],
        "sections": [
            {"heading": "Intervals", "text": [], "table": {"columns": columns, "rows": cells}}
        ],
    }


if __name__ == "__main__":
    main(tyro.cli(CalibrationStudy))
