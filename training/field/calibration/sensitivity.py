"""The smallest lasting changes that `residuals` finds, and healthy logs that would hide more."""

from collections.abc import Mapping, Sequence

import numpy as np

from auv_fault_env.errors import InputError, refusal
from diagnosers.relations.episode import episode_windows
from diagnosers.relations.model import RelationModel, kind_of
from diagnosers.relations.names import name_of
from diagnosers.residuals import LASTING
from training.field.calibration.relation_fit import MARGIN, rows_of, widened
from training.field.logs.log import Log
from training.learning.relation_fit import (
    all_windows,
    lasting_medians,
    standardised_residual,
)

# Relative, by kind of residual: where no smaller lasting change is found, the residual is blind. A
# line on a propeller doubles a load, a fouled hull the drag; voltages hardly change by a fault.
LARGEST_CHANGE = {"push": 1.5, "load": 1.0, "voltage": 0.5, "balance": 0.5}


def described(changes: Mapping[str, float]) -> str:
    """Relative changes by residual, in per cent.

    >>> described({"push": 0.42, "port_load": 0.061})
    'drag 42 %, port load 6 %'
    """
    return ", ".join(f"{name_of(name)} {100 * change:.0f} %" for name, change in changes.items())


def largest_change(residual: str) -> float:
    """The bound of `LARGEST_CHANGE` for a residual."""
    return LARGEST_CHANGE[kind_of(residual)]


def blind_residuals(model: RelationModel) -> list[str]:
    """The residuals that find no lasting change up to their bound."""
    changes = model.smallest_changes()
    return [name for name, change in changes.items() if change > largest_change(name)]


def with_healthy_logs(model: RelationModel, logs: Sequence[Log]) -> RelationModel:
    """The model with limits that the windows of more healthy logs do not cross.

    `InputError` for a log that makes a residual blind.
    """
    for log in logs:
        rows = [part.reading for part in rows_of(log, model.layout)]
        wider = widened(model, all_windows(rows, model.layout, model.typical))
        newly_blind = set(blind_residuals(wider)) - set(blind_residuals(model))
        for residual in model.layout.residuals:
            if residual in newly_blind:
                raise _blinding(residual, log, model, wider)
        model = wider
    return model


def _blinding(residual: str, log: Log, model: RelationModel, wider: RelationModel) -> InputError:
    """The refusal of a log that widens the limits of the model too far."""
    usual = 100 * model.smallest_changes()[residual]
    needed = 100 * wider.smallest_changes()[residual]
    bound = 100 * largest_change(residual)
    is_lasting = wider.lasting[residual] > model.lasting[residual]
    time = _time_of_largest(residual, log, model, is_lasting)
    name = name_of(residual)
    got = f"{name} {needed / MARGIN:.0f} % off at {time:.0f} s"
    allowed = (
        f"up to {bound / MARGIN:.0f} % off, where the healthy logs so far reach "
        f"{usual / MARGIN:.0f} %; with this log, residuals would find no lasting change of the "
        f"{name} below {needed:.0f} %"
    )
    remedy = "leave the log out of --healthy, or calibrate with it if it is healthy"
    return refusal(f"healthy log {log.name}", got, allowed, remedy)


def _time_of_largest(residual: str, log: Log, model: RelationModel, is_lasting: bool) -> float:
    """When a residual is largest [s]: its median, in the middle, or that of a steady window."""
    k = model.layout.residuals.index(residual)
    largest = 0.0
    time = np.nan
    for rows in rows_of(log, model.layout):
        part = episode_windows(rows.reading, model.layout, model.typical)
        if not part.last.size:
            continue
        values = standardised_residual(model, part)
        times = rows.time[part.last]
        if is_lasting:
            size = np.abs(lasting_medians(values)[:, k])
            times = times[LASTING // 2 :]
        else:
            size = np.abs(values[:, k]) * part.is_steady
        if size.max(initial=0.0) > largest:
            largest = size.max()
            time = times[size.argmax()]
    return float(time)
