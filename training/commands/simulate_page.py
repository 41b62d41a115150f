"""The page of `auv-fault simulate`: the files, the vehicles with their faults, and the first vehicle's run."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from auv_fault_env.schedules import Schedule
from training.report.lines import line_without_band

SHOWN = 100  # vehicles in the page's table; all are in schedules.json
PANELS = {
    "surge speed [m/s]": (("speed", "speed"), ("commanded", "speed_command")),
    "shaft speed [rpm]": (("port", "port_rpm"), ("starboard", "starboard_rpm")),
    "motor voltage [V]": (("port", "port_voltage"), ("starboard", "starboard_voltage")),
    "motor current [A]": (("port", "port_current"), ("starboard", "starboard_current")),
}


def page(
    command: str,
    names: Sequence[str],
    schedules: Mapping[int, Schedule],
    seed: int,
    first: Mapping[str, np.ndarray],
) -> dict[str, Any]:
    """The report as plain data; `names` are the tables' columns, `first` the first vehicle's columns (n_samples,)."""
    shown = list(schedules.items())[:SHOWN]
    rows = [[str(vehicle), str(seed + vehicle), faults(schedule)] for vehicle, schedule in shown]
    onset = min((event.onset for event in schedules[0]), default=None)
    return {
        "title": "Simulated episodes",
        "command": command,
        "intro": [
            f"{len(schedules)} vehicles, one row per vehicle and sample of 0.1 s, in the order of the vehicles. "
            "Channels are what the vehicle's instruments tell; columns that begin with truth_ are for scoring "
            "only.",
            "Columns: " + ", ".join(names) + ".",
        ],
        "sections": [
            {
                "heading": "The first vehicle",
                "text": [],
                "figures": [
                    {
                        "plot": "transients",
                        "name": "first-vehicle",
                        "caption": f"Readings of vehicle 0: {faults(schedules[0])}.",
                        "data": {
                            "time": first["time"].tolist(),
                            "panels": panels(first),
                            "onset": onset,
                        },
                    }
                ],
            },
            {
                "heading": "Faults",
                "text": [f"The first {len(rows)} vehicles; every schedule is in schedules.json."],
                "table": {"columns": ["vehicle", "seed", "faults"], "rows": rows},
            },
        ],
    }


def faults(schedule: Schedule) -> str:
    """A schedule in words."""
    words = [
        f"{event.fault} from {event.onset:.1f} s, severity {event.severity:.2f}"
        for event in schedule
    ]
    return "; ".join(words) or "healthy"


def panels(columns: Mapping[str, np.ndarray]) -> dict[str, dict[str, dict[str, list[float]]]]:
    """Lines of the figure by panel; one run has no scatter."""
    return {
        label: {name: line_without_band(columns[channel]) for name, channel in lines}
        for label, lines in PANELS.items()
    }
