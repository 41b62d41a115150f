"""Two-sided limits on each shaft's load, learnt from healthy logs: for faults of no catalogue, there from the start."""

from collections.abc import Mapping, Sequence

import numpy as np

from auv_fault_env.parameters import SAMPLE_RATE
from training.field.diagnosis.estimates import NAMES, healthy_currents
from training.field.logs.log import Log
from training.field.vehicle_file import VehicleFile

WINDOW = round(20.0 * SAMPLE_RATE)  # samples over which the load is taken
MARGIN = 1.5  # of the loads of the healthy logs, which are few
LEAST = 0.1  # of a load, relative: below, it is no finding


def running_loads(log: Log, vehicle: VehicleFile) -> dict[str, np.ndarray]:
    """Load of each shaft against a healthy one, less one, over the last `WINDOW`, (n_samples,); NaN before."""
    loads = {}
    for side, healthy in healthy_currents(log, vehicle).items():
        if f"{side}_current" in vehicle.columns:
            loads[side] = np.full(len(log.time), np.nan)
            measured = log.observation[:, NAMES.index(f"{side}_current")]
            for segment in log.segments:
                loads[side][segment] = _running(measured[segment], healthy[segment])
    return loads


def _running(measured: np.ndarray, healthy: np.ndarray) -> np.ndarray:
    heard = ~np.isnan(measured)
    sums = [np.cumsum(np.where(heard, values, 0.0)) for values in (measured, healthy)]
    measured, healthy = (
        np.concatenate([total[:WINDOW], total[WINDOW:] - total[:-WINDOW]]) for total in sums
    )
    load = (
        np.divide(measured, healthy, out=np.full(len(measured), np.nan), where=healthy > 0.0) - 1.0
    )
    load[: WINDOW - 1] = np.nan
    return load


def load_limits(logs: Sequence[Log], vehicle: VehicleFile) -> dict[str, tuple[float, float]]:
    """Lowest and highest load of each side that is still healthy, from healthy logs; empty without logs.

    Misleads if the logs went through less than the missions to come: other speeds, colder water, a
    fouled propeller.
    """
    seen: dict[str, list[np.ndarray]] = {}
    for log in logs:
        for side, load in running_loads(log, vehicle).items():
            seen.setdefault(side, []).append(load[~np.isnan(load)])
    loads = {side: np.concatenate(parts) for side, parts in seen.items()}
    return {
        side: (-max(LEAST, -MARGIN * float(load.min())), max(LEAST, MARGIN * float(load.max())))
        for side, load in loads.items()
        if load.size
    }


def overloaded(
    log: Log, vehicle: VehicleFile, limits: Mapping[str, tuple[float, float]]
) -> np.ndarray:
    """Where a shaft's load is beyond its limits, (n_samples,) bool."""
    beyond = np.zeros(len(log.time), bool)
    for side, load in running_loads(log, vehicle).items():
        low, high = limits.get(side, (-np.inf, np.inf))
        beyond |= (load < low) | (load > high)
    return beyond
