"""Report of `auv-fault simulate`: the vehicles with their faults, and the run of the first."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from auv_fault_env.schedules import Schedule
from training.report.lines import line_without_band

N_SHOWN = 100  # vehicles in the table of the page; all are in schedules.json
PANELS = {
    "surge speed [m/s]": {"speed": "speed", "commanded": "speed_command"},
    "shaft speed [rpm]": {"port": "port_rpm", "starboard": "starboard_rpm"},
    "motor voltage [V]": {"port": "port_voltage", "starboard": "starboard_voltage"},
    "motor current [A]": {"port": "port_current", "starboard": "starboard_current"},
}


def report(
    command: str,
    names: Sequence[str],
    schedules: Mapping[int, Schedule],
    seed: int,
    first_vehicle: Mapping[str, np.ndarray],
) -> dict[str, Any]:
    """The report as plain data.

    Parameters
    ----------
    command
        The command that simulated.
    names
        Columns of the tables.
    schedules
        By number of the vehicle.
    seed
        Of the first vehicle.
    first_vehicle
        Its time and channels, (n_samples,) each.
    """
    intro = (
        f"{len(schedules)} vehicles, one row per vehicle and sample of 0.1 s, in the order of the "
        "vehicles. Channels are commands and readings of the vehicle; columns that begin with "
        "truth_ are for scoring only."
    )
    rows = []
    for vehicle, schedule in list(schedules.items())[:N_SHOWN]:
        rows.append([str(vehicle), str(seed + vehicle), schedule_text(schedule)])
    return {
        "title": "Simulated episodes",
        "command": command,
        "intro": [intro, f"Columns: {', '.join(names)}."],
        "sections": [
            {
                "heading": "The first vehicle",
                "text": [],
                "figures": [reading_figure(schedules[0], first_vehicle)],
            },
            {
                "heading": "Faults",
                "text": [f"The first {len(rows)} vehicles; every schedule is in schedules.json."],
                "table": {"columns": ["vehicle", "seed", "faults"], "rows": rows},
            },
        ],
    }


def reading_figure(schedule: Schedule, columns: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Readings of the first vehicle."""
    panels = {}
    for label, channels in PANELS.items():
        panels[label] = {
            name: line_without_band(columns[channel]) for name, channel in channels.items()
        }
    onset = min((event.onset for event in schedule), default=None)
    return {
        "plot": "transients",
        "name": "first-vehicle",
        "caption": f"Readings of vehicle 0: {schedule_text(schedule)}.",
        "data": {"time": columns["time"].tolist(), "panels": panels, "onset": onset},
    }


def schedule_text(schedule: Schedule) -> str:
    """The faults with onset and severity."""
    faults = []
    for event in schedule:
        faults.append(f"{event.fault} from {event.onset:.1f} s, severity {event.severity:.2f}")
    return "; ".join(faults) or "healthy"
