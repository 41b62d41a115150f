"""The detection of one faulty mission among thirty healthy ones.

Run ``python -m training.studies.faulty_mission``. A vehicle of one shaft logs speed, motor command
and current once a second, and no shaft speed. Every mission has another vehicle of the healthy
band; on the last one the propeller's torque is three times as large from the start.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
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
from training.report.sections import table_section
from training.seeds import seeds
from training.studies.run import command_line, run_study

COLUMNS = {  # of the log, by channel, with the decimals that are written
    "speed_command": ("set_mps", 3),
    "speed": ("v_mps", 3),
    "port_voltage": ("motor_cmd_V", 2),
    "port_current": ("motor_A", 2),
}
VEHICLE = VehicleFile(
    vehicle=replace(PRESETS["thesis1992"], shafts=1),
    columns={channel: Column(name) for channel, (name, _) in COLUMNS.items()},
    time=Column("t_s"),
    sample_rate=1.0,
)
TORQUE = ("port_c1", "port_c2")
LEGS = MissionSampler(speed=(0.2, 0.6), duration=(15.0, 40.0), n_legs=16)
FOLDS = 5  # calibrations, each without a fifth of the healthy missions
DECIMATION = round(SAMPLE_RATE / VEHICLE.sample_rate)
FIRST_SEED = 700_000_000  # within those of tests


@dataclass(frozen=True)
class FaultyMissionStudy:
    """Diagnose a faulty mission, and each healthy one, calibrated on other healthy missions."""

    output: Path = Path("runs/faulty-mission")
    """Folder of the logs, the vehicle files and the results; an earlier run there is replaced."""
    missions: int = 30
    """Healthy missions; one more is faulty."""
    duration: float = 240.0
    """Length of a mission [s]."""
    load: float = 3.0
    """Factor on the propeller's torque in the faulty mission."""
    seed: int = 0
    """Offset within the seeds of tests."""


def main(arguments: FaultyMissionStudy) -> None:
    """Simulate, calibrate, diagnose, and write the results."""
    finite_in_range("missions", arguments.missions, FOLDS, 1000)
    finite_in_range("duration", arguments.duration, 30.0, 1e4)
    finite_in_range("load", arguments.load, 0.0, 20.0)

    def results_of(folder: Path) -> dict[str, Any]:
        write_vehicle(folder / "vehicle.toml", VEHICLE)
        paths = write_missions(folder, arguments)
        return study([read_log(path, VEHICLE) for path in paths], folder)

    run_study("faulty_mission", arguments, results_of)


def write_missions(folder: Path, arguments: FaultyMissionStudy) -> list[Path]:
    """Write every mission's log as CSV, the faulty one last."""
    count = arguments.missions + 1
    lanes = seeds("test", count, FIRST_SEED + arguments.seed)
    n_samples = round(arguments.duration * SAMPLE_RATE)
    observations = simulated_missions(lanes, n_samples, arguments.load).astype(np.float64)
    paths = [folder / f"mission-{k:03d}.csv" for k in range(count)]
    for path, rows in zip(paths, observations[::DECIMATION].swapaxes(0, 1), strict=True):
        columns = {"t_s": np.arange(len(rows)) / VEHICLE.sample_rate}
        for channel, (name, decimals) in COLUMNS.items():
            columns[name] = rows[:, INDEX[channel]].round(decimals)
        pyarrow.csv.write_csv(pa.table(columns), path)
    return paths


def simulated_missions(lanes: Sequence[int], n_samples: int, load: float) -> np.ndarray:
    """Observations (n_samples, n_lanes, n_channels) at 10 Hz; `load` multiplies the last torque."""
    fleet = Fleet(len(lanes), VEHICLE.vehicle, missions=LEGS)
    observations = [fleet.reset(lanes, schedules=[()] * len(lanes))]
    healthy = fleet.plan.healthy.copy()
    torque = [list(PARAMETERS).index(name) for name in TORQUE]
    healthy[-1, torque] *= load
    fleet.set_healthy(healthy)
    while len(observations) < n_samples:
        observations.append(fleet.step(follow_mission(observations[-1])))
    return np.array(observations)


def study(logs: Sequence[Log], folder: Path) -> dict[str, Any]:
    """Verdicts on all logs, as plain data.

    The vehicle file calibrated on all healthy logs is written to the folder.
    """
    healthy = logs[:-1]
    verdicts = []
    for fold in tqdm(range(FOLDS), unit="fold"):
        others = [log for k, log in enumerate(healthy) if k % FOLDS != fold]
        vehicle = calibrate(others, VEHICLE).vehicle
        verdicts += verdicts_on(healthy[fold::FOLDS], others, vehicle)
    vehicle = calibrate(healthy, VEHICLE).vehicle
    write_vehicle(folder / "calibrated.toml", vehicle)
    (faulty,) = verdicts_on(logs[-1:], healthy, vehicle)
    rows = [
        ["healthy, calibrated without it", *summary_cells(verdicts)],
        ["faulty", *summary_cells([faulty])],
    ]
    columns = [
        "missions",
        "number",
        "with alarm",
        "first alarm [s]",
        "fault",
        "load of the shaft",
    ]
    n_false = sum(bool(verdict.alarms) for verdict in verdicts)
    found = "not found: it raised no alarm"
    if faulty.alarms:
        found = f"found after {faulty.alarm_time:.0f} s and named `{faulty.fault}`"
    return {
        "title": "Is one faulty mission found among healthy ones?",
        "summary": [
            f"{len(healthy)} healthy missions and one with a fault were diagnosed, each healthy "
            "one with a calibration on others.",
            f"The faulty mission is {found}.",
            f"{n_false} of {len(healthy)} healthy missions raised an alarm; none should.",
        ],
        "intro": [],
        "verdicts": {verdict.log: verdict.verdict for verdict in (*verdicts, faulty)},
        "alarm_time": faulty.alarm_time,
        "false_alarms": n_false,
        "sections": [table_section("One faulty mission", columns, rows)],
    }


def verdicts_on(logs: Sequence[Log], healthy: Sequence[Log], vehicle: VehicleFile) -> list[Verdict]:
    """Verdicts by the filter bank and by the limits on the load from the healthy logs."""
    limits = load_limits(healthy, vehicle)
    verdicts = []
    for log in logs:
        belief = beliefs(log, "filter_bank", vehicle)
        alarmed = is_alarmed(log, belief, THRESHOLDS["filter_bank"], persistence(vehicle))
        alarmed |= is_overloaded(log, vehicle, limits)
        verdicts.append(verdict(log.name, log, belief, alarmed, vehicle))
    return verdicts


def summary_cells(verdicts: Sequence[Verdict]) -> list[str]:
    """Number of missions, number with an alarm, and time, class and load of the first alarm."""
    alarmed = [verdict for verdict in verdicts if verdict.alarms]
    if not alarmed:
        return [str(len(verdicts)), "0", "", "", ""]
    first = min(alarmed, key=lambda verdict: verdict.alarm_time)
    loads = [f"{side} {load:+.0%}" for side, load in (first.load or {}).items()]
    counts = [str(len(verdicts)), str(len(alarmed))]
    return [*counts, f"{first.alarm_time:.1f}", first.fault, ", ".join(loads)]


if __name__ == "__main__":
    command_line(main)
