"""Two-sided limits on each shaft's load from healthy logs.

They find faults that are not in the catalogue and faults that are present from the start.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from auv_fault_env.channels import INDEX
from auv_fault_env.parameters import SAMPLE_RATE
from training.field.diagnosis.estimates import healthy_currents
from training.field.logs.log import Log
from training.field.vehicle_file import VehicleFile

Limits = Mapping[str, tuple[float, float]]  # lowest and highest healthy load, by side

WINDOW = round(20.0 * SAMPLE_RATE)  # samples over which the load is computed
MARGIN = 1.5  # factor on the loads of the healthy logs, which are few
LEAST_LIMIT = 0.1  # of a load, relative


def running_loads(log: Log, vehicle: VehicleFile) -> dict[str, np.ndarray]:
    """Excess load of each shaft over the last `WINDOW` samples, (n_samples,); NaN before."""
    loads = {}
    for side, healthy in healthy_currents(log, vehicle).items():
        if f"{side}_current" in vehicle.columns:
            measured = log.observation[:, INDEX[f"{side}_current"]]
            load = np.full(len(log.time), np.nan)
            for segment in log.segments:
                load[segment] = _running_load(measured[segment], healthy[segment])
            loads[side] = load
    return loads


def _running_load(measured: np.ndarray, healthy: np.ndarray) -> np.ndarray:
    is_available = ~np.isnan(measured)
    measured_sum = _running_sum(np.where(is_available, measured, 0.0))
    healthy_sum = _running_sum(np.where(is_available, healthy, 0.0))
    ratio = np.full(len(measured), np.nan)
    np.divide(measured_sum, healthy_sum, out=ratio, where=healthy_sum > 0.0)
    load = ratio - 1.0
    load[: WINDOW - 1] = np.nan
    return load


def _running_sum(values: np.ndarray) -> np.ndarray:
    total = np.cumsum(values)
    return np.concatenate([total[:WINDOW], total[WINDOW:] - total[:-WINDOW]])


def load_limits(logs: Sequence[Log], vehicle: VehicleFile) -> dict[str, tuple[float, float]]:
    """Lowest and highest healthy load of each side, from healthy logs; empty without logs.

    Misleads if later missions differ from the logs: other speeds, colder water, a fouled propeller.
    """
    by_side: dict[str, list[np.ndarray]] = {}
    for log in logs:
        for side, load in running_loads(log, vehicle).items():
            by_side.setdefault(side, []).append(load[~np.isnan(load)])
    limits = {}
    for side, loads in by_side.items():
        load = np.concatenate(loads)
        if load.size:
            low = min(-LEAST_LIMIT, MARGIN * float(load.min()))
            high = max(LEAST_LIMIT, MARGIN * float(load.max()))
            limits[side] = (low, high)
    return limits


def is_overloaded(log: Log, vehicle: VehicleFile, limits: Limits) -> np.ndarray:
    """Whether a shaft's load is beyond its limits, (n_samples,)."""
    is_beyond = np.zeros(len(log.time), bool)
    for side, load in running_loads(log, vehicle).items():
        low, high = limits.get(side, (-np.inf, np.inf))
        is_beyond |= (load < low) | (load > high)
    return is_beyond
