"""Report of `auv-fault simulate`: the vehicles with their faults, and the run of the first."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from auv_fault_env.parameters import SAMPLE_TIME
from auv_fault_env.schedules import Schedule
from training.formats.columns import COLUMNS, DICTIONARY, dictionary_rows
from training.report.cells import counted
from training.report.lines import line_without_band
from training.report.sections import figure_section, table_section

N_SHOWN = 100  # vehicles in the table of the page; all are in schedules.json
N_FAULTS = 5  # in the summary
PANELS = {
    "surge speed [m/s]": {"speed": "speed", "commanded": "speed_command"},
    "shaft speed [rpm]": {"port": "port_rpm", "starboard": "starboard_rpm"},
    "motor voltage [V]": {"port": "port_voltage", "starboard": "starboard_voltage"},
    "motor current [A]": {"port": "port_current", "starboard": "starboard_current"},
}


def report(
    command: str,
    schedules: Mapping[int, Schedule],
    seeds: Sequence[int],
    first_vehicle: Mapping[str, np.ndarray],
) -> dict[str, Any]:
    """The report as plain data.

    `schedules` and `seeds` are by number of the vehicle, `first_vehicle` has the time and the
    channels of the first, (n_samples,) each.
    """
    rows = []
    for vehicle, schedule in list(schedules.items())[:N_SHOWN]:
        rows.append([str(vehicle), str(seeds[vehicle]), schedule_text(schedule)])
    faults = f"The first {len(rows)} vehicles; every schedule is in schedules.json."
    columns = f"As in {DICTIONARY}; the files of Parquet have the same as metadata of the fields."
    return {
        "title": "Simulated episodes",
        "command": command,
        "summary": summary(schedules, first_vehicle["time"]),
        "intro": [],
        "sections": [
            first_vehicle_section(schedules[0], first_vehicle),
            table_section("Faults", ["vehicle", "seed", "faults"], rows, faults),
            table_section("Columns", COLUMNS, list(dictionary_rows()), columns),
        ],
    }


def summary(schedules: Mapping[int, Schedule], time: np.ndarray) -> list[str]:
    """How many vehicles, with which faults, and what the rows are."""
    n_faulty = sum(bool(schedule) for schedule in schedules.values())
    faults = Counter(event.fault for schedule in schedules.values() for event in schedule)
    commonest = ", ".join(f"{name} ({count})" for name, count in faults.most_common(N_FAULTS))
    return [
        f"{counted(len(schedules), 'vehicle')}, simulated for {len(time) * SAMPLE_TIME:g} s each: "
        f"{n_faulty} with a fault, {len(schedules) - n_faulty} healthy.",
        *([f"The most frequent faults and their numbers: {commonest}."] if faults else []),
        "The tables have one row per vehicle and sample of 0.1 s, in the order of the vehicles.",
        "Channels are commands and readings; columns that begin with `truth_` are for scoring "
        "only, and no diagnoser may read them.",
    ]


def first_vehicle_section(schedule: Schedule, columns: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Readings of the first vehicle."""
    panels = {}
    for label, channels in PANELS.items():
        panels[label] = {
            name: line_without_band(columns[channel]) for name, channel in channels.items()
        }
    onset = min((event.onset for event in schedule), default=None)
    caption = f"Readings of vehicle 0: {schedule_text(schedule)}."
    data = {"time": columns["time"].tolist(), "panels": panels, "onset": onset}
    return figure_section("The first vehicle", "transients", "first-vehicle", caption, data)


def schedule_text(schedule: Schedule) -> str:
    """The faults with onset and severity."""
    faults = []
    for event in schedule:
        faults.append(f"{event.fault} from {event.onset:.1f} s, severity {event.severity:.2f}")
    return "; ".join(faults) or "healthy"
