"""Report of `auv-fault simulate`: the vehicles with their faults, and the run of the first."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from auv_fault_env.schedules import Schedule
from training.formats.columns import COLUMNS, DICTIONARY, dictionary_rows
from training.report.lines import line_without_band
from training.report.sections import figure_section, table_section

N_SHOWN = 100  # vehicles in the table of the page; all are in schedules.json
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
    intro = (
        f"{len(schedules)} vehicles, one row per vehicle and sample of 0.1 s, in the order of the "
        "vehicles. Channels are commands and readings of the vehicle; columns that begin with "
        "truth_ are for scoring only."
    )
    rows = []
    for vehicle, schedule in list(schedules.items())[:N_SHOWN]:
        rows.append([str(vehicle), str(seeds[vehicle]), schedule_text(schedule)])
    faults = f"The first {len(rows)} vehicles; every schedule is in schedules.json."
    columns = f"As in {DICTIONARY}; the files of Parquet have the same as metadata of the fields."
    return {
        "title": "Simulated episodes",
        "command": command,
        "intro": [intro],
        "sections": [
            first_vehicle_section(schedules[0], first_vehicle),
            table_section("Faults", ["vehicle", "seed", "faults"], rows, faults),
            table_section("Columns", COLUMNS, list(dictionary_rows()), columns),
        ],
    }


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
