"""The windows of whole logs, on which relations are fitted and judged."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import INDEX
from diagnosers.relations.episode import EpisodeWindows, episode_windows
from diagnosers.relations.windows import DURATION, Layout, is_under_way
from training.field.calibration.relation_fit import rows_of
from training.field.logs.log import Log
from training.learning.relation_fit import typical_of

LEAST_WINDOWS = 60  # a minute before and after a step
LEAST_SHARE = 0.6  # of the rows under way, in which a reading is there and not zero


class LogWindows(NamedTuple):
    """The windows of one log."""

    name: str
    parts: list[EpisodeWindows]
    times: list[np.ndarray]  # of the middle of each part's windows [s]
    commands: list[np.ndarray]  # at the end of each part's windows [m/s]; without any, the speed


def windows_of_logs(logs: Sequence[Log], layout: Layout) -> list[LogWindows]:
    """The windows of the logs that have enough of them."""
    rows_by_log = [rows_of(log, layout) for log in logs]
    readings = [rows.reading for parts in rows_by_log for rows in parts]
    found: list[LogWindows] = []
    if not _has_relations(readings, layout):
        return found
    typical = {side: typical_of(readings, side) for side in layout.sides}
    for log, log_rows in zip(logs, rows_by_log, strict=True):
        parts = []
        times = []
        commands = []
        for rows in log_rows:
            part = episode_windows(rows.reading, layout, typical)
            if part.last.size:
                parts.append(part)
                times.append(rows.time[part.last] - DURATION / 2.0)
                command = rows.reading[part.last, INDEX["mission_speed"]]
                commands.append(np.where(np.isnan(command), part.windows.speed, command))
        if sum(map(len, times)) >= 2 * LEAST_WINDOWS:
            found.append(LogWindows(log.name, parts, times, commands))
    return found


def _has_relations(readings: Sequence[np.ndarray], layout: Layout) -> bool:
    """Whether every reading of the relations is usually there and not zero under way."""
    moving = [reading[is_under_way(reading)] for reading in readings]
    together = np.concatenate([np.zeros((0, len(INDEX))), *moving])
    kinds = ("voltage", "current", "rpm") if layout.has_shaft_speed else ("voltage", "current")
    names = ["speed", *(f"{side}_{kind}" for side in layout.sides for kind in kinds)]
    columns = together[:, [INDEX[name] for name in names]]
    is_there = np.isfinite(columns) & (columns != 0.0)
    return len(columns) > 0 and bool((is_there.mean(axis=0) > LEAST_SHARE).all())
