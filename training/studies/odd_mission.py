"""Is one bad mission found among thirty good ones? ``python -m training.studies.odd_mission``.

A vehicle of one shaft logs speed, motor command and current once a second, and no shaft speed.
Every mission is by another vehicle of the healthy band; on the last one the propeller asks for
three times its torque from the start.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
import tyro
from tqdm import tqdm

from auv_fault_env.channels import INDEX
from auv_fault_env.errors import finite_in_range
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MissionSampler, follow_mission
from auv_fault_env.parameters import PARAMETERS, PRESETS, SAMPLE_RATE
from training.field.calibration.calibration import calibrate
from training.field.diagnosis.diagnosis import (
    THRESHOLDS,
    Verdict,
    beliefs,
    is_alarmed,
    persistence,
    verdict,
)
from training.field.diagnosis.load_limits import is_overloaded, load_limits
from training.field.logs.log import Log, read_log
from training.field.vehicle_file import Column, VehicleFile, write_vehicle
from training.report.page import print_tables
from training.report.run_folder import run_folder, write_json
from training.seeds import seeds

COLUMNS = {  # of the log, by channel, with the decimals that are written
    "speed_command": ("set_mps", 3),
    "speed": ("v_mps", 3),
    "port_voltage": ("motor_cmd_V", 2),
    "port_current": ("motor_A", 2),
}
VEHICLE = VehicleFile(
    vehicle=PRESETS["thesis1992"],
    columns={channel: Column(name) for channel, (name, _) in COLUMNS.items()},
    time=Column("t_s"),
    sample_rate=1.0,
    shafts=1,
)
TRIPLED = ("port_c1", "port_c2")
LEGS = MissionSampler(speed=(0.2, 0.6), duration=(15.0, 40.0), n_legs=16)
FOLDS = 5  # calibrations, each without a fifth of the healthy missions
DECIMATION = round(SAMPLE_RATE / VEHICLE.sample_rate)
FIRST_SEED = 700_000_000  # within those of tests


@dataclass(frozen=True)
class OddMission:
    """Calibrate on healthy missions and diagnose others: the faulty one, and each healthy one left out for it."""

    output: Path = Path("runs/odd-mission")
    """Folder of the logs, the vehicle files and the results; an earlier run there is replaced."""
    missions: int = 30
    """Healthy missions; one more is faulty."""
    duration: float = 240.0
    """Length of a mission [s]."""
    load: float = 3.0
    """Factor on the propeller's torque in the faulty mission."""
    seed: int = 0
    """Offset within the seeds of tests."""


def main(arguments: OddMission) -> None:
    """Simulate, calibrate, diagnose, and write the results."""
    finite_in_range("missions", arguments.missions, FOLDS, 1000)
    finite_in_range("duration", arguments.duration, 30.0, 1e4)
    finite_in_range("load", arguments.load, 0.0, 20.0)
    with run_folder(arguments.output, "odd-mission", arguments) as folder:
        write_vehicle(folder / "vehicle.toml", VEHICLE)
        logs = [read_log(path, VEHICLE) for path in write_missions(folder, arguments)]
        results = study(logs, folder)
        write_json(folder / "results.json", results)
    print_tables(results["sections"])


def write_missions(folder: Path, arguments: OddMission) -> list[Path]:
    """Write every mission's log as CSV, the faulty one last."""
    count = arguments.missions + 1
    lanes = seeds("test", count, FIRST_SEED + arguments.seed)
    observations = np.asarray(
        simulated(lanes, round(arguments.duration * SAMPLE_RATE), arguments.load), np.float64
    )
    paths = [folder / f"mission-{k:03d}.csv" for k in range(count)]
    for path, rows in zip(paths, observations[::DECIMATION].swapaxes(0, 1), strict=True):
        columns = {"t_s": np.arange(len(rows)) / VEHICLE.sample_rate}
        for channel, (name, decimals) in COLUMNS.items():
            columns[name] = rows[:, INDEX[channel]].round(decimals)
        pyarrow.csv.write_csv(pa.table(columns), path)
    return paths


def simulated(lanes: Sequence[int], n_samples: int, load: float) -> np.ndarray:
    """Observations (n_samples, n_lanes, n_channels) at 10 Hz; the last lane's propeller asks for `load` times."""
    fleet = Fleet(len(lanes), VEHICLE.vehicle, missions=LEGS)
    observations = [fleet.reset(lanes, schedules=[()] * len(lanes))]
    healthy = fleet.plan.healthy.copy()
    healthy[-1, [list(PARAMETERS).index(name) for name in TRIPLED]] *= load
    fleet.set_healthy(healthy)
    while len(observations) < n_samples:
        observations.append(fleet.step(follow_mission(observations[-1])))
    return np.array(observations)


def study(logs: Sequence[Log], folder: Path) -> dict[str, Any]:
    """Verdicts on all logs, as plain data; the vehicle file calibrated on all healthy ones goes into the folder."""
    healthy = logs[:-1]
    verdicts = []
    for fold in tqdm(range(FOLDS), unit="fold"):
        others = [log for k, log in enumerate(healthy) if k % FOLDS != fold]
        verdicts += judged(healthy[fold::FOLDS], others, calibrate(others, VEHICLE).vehicle)
    whole = calibrate(healthy, VEHICLE).vehicle
    write_vehicle(folder / "calibrated.toml", whole)
    (odd,) = judged(logs[-1:], healthy, whole)
    rows = [["healthy, calibrated without it", *counted(verdicts)], ["faulty", *counted([odd])]]
    columns = ["missions", "number", "with alarm", "first alarm [s]", "fault", "load of the shaft"]
    return {
        "verdicts": {one.log: one.verdict for one in (*verdicts, odd)},
        "alarm_time": odd.alarm_time,
        "false_alarms": sum(bool(one.alarms) for one in verdicts),
        "sections": [{"heading": "One odd mission", "table": {"columns": columns, "rows": rows}}],
    }


def judged(logs: Sequence[Log], healthy: Sequence[Log], vehicle: VehicleFile) -> list[Verdict]:
    """Verdicts by the filter bank and by the limits on the load that the healthy logs set."""
    limits = load_limits(healthy, vehicle)
    verdicts = []
    for log in logs:
        belief = beliefs(log, "filter_bank", vehicle)
        standing = is_alarmed(log, belief, THRESHOLDS["filter_bank"], persistence(vehicle))
        standing |= is_overloaded(log, vehicle, limits)
        verdicts.append(verdict(log.name, log, belief, standing, vehicle))
    return verdicts


def counted(verdicts: Sequence[Verdict]) -> list[str]:
    """Cells of a row: how many, how many with an alarm, the first one's time, class and load."""
    alarmed = [one for one in verdicts if one.alarms]
    first = min(alarmed, key=lambda one: one.alarms[0][0], default=None)
    if first is None:
        return [str(len(verdicts)), "0", "", "", ""]
    load = ", ".join(f"{side} {share:+.0%}" for side, share in (first.load or {}).items())
    return [str(len(verdicts)), str(len(alarmed)), f"{first.alarm_time:.1f}", first.fault, load]


if __name__ == "__main__":
    main(tyro.cli(OddMission))
