"""What a log says of the vehicle's parameters: drag and thrust by a Kalman filter, and each shaft's load."""

from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS
from auv_fault_env.parameters import SIDES
from diagnosers.diagnoser import fill_missing
from diagnosers.kalman import PARAMETERS, ParameterFilter, SurgeFilter
from training.field.diagnosis.shaft_load import excess_load, healthy_current
from training.field.logs.log import Log
from training.field.vehicle_file import VehicleFile

NAMES = list(CHANNELS)
# states of both filters
ESTIMATED = {"drag": 1 + PARAMETERS.index("alpha"), "thrust": 1 + PARAMETERS.index("beta")}


class Estimates(NamedTuple):
    """Relative to the vehicle's own value, 1 = healthy, with standard deviation; (n_samples,) each."""

    mean: np.ndarray
    std: np.ndarray


def hull_estimates(log: Log, vehicle: VehicleFile) -> dict[str, Estimates]:
    """Drag and thrust by the thesis' parameter filter, or by that without accelerometer where there is none.

    Empty where speed or a shaft's speed is not logged. Readings are held until the next one.
    Misleads at constant speed, where drag and thrust cannot be told apart and only their ratio is
    estimated.
    """
    shafts = [f"{side}_rpm" for side in SIDES[: vehicle.shafts]]
    if not {"speed", *shafts} <= vehicle.columns.keys():
        return {}
    kind = ParameterFilter if "acceleration" in vehicle.columns else SurgeFilter
    estimator = kind(vehicle.vehicle)
    n_samples = len(log.time)
    along = {name: Estimates(np.ones(n_samples), np.zeros(n_samples)) for name in ESTIMATED}
    for segment in log.segments:
        estimate = estimator.initial(1)
        held = np.zeros((1, len(NAMES)))
        for k in range(segment.start, segment.stop):
            held = fill_missing(log.observation[k : k + 1], held)
            estimate = estimator.update(estimate, both_shafts(held, vehicle))
            for name, state in ESTIMATED.items():
                along[name].mean[k] = estimate.mean[0, state]
                along[name].std[k] = estimate.covariance[0, state, state] ** 0.5
    return along


def both_shafts(observation: np.ndarray, vehicle: VehicleFile) -> np.ndarray:
    """The observation (1, n_channels) with a single shaft's speed on both sides, as thrust is that of all shafts."""
    if vehicle.shafts == 1:
        observation = observation.copy()
        observation[:, NAMES.index("starboard_rpm")] = observation[:, NAMES.index("port_rpm")]
    return observation


def healthy_currents(log: Log, vehicle: VehicleFile) -> dict[str, np.ndarray]:
    """Current [A] that each side's motor would draw if it were healthy, (n_samples,), where its voltage is logged."""
    speed = log.observation[:, NAMES.index("speed")]
    sides = [side for side in SIDES if f"{side}_voltage" in vehicle.columns]
    drawn = {side: np.empty(len(log.time)) for side in sides}
    for side, current in drawn.items():
        voltage = log.observation[:, NAMES.index(f"{side}_voltage")]
        for segment in log.segments:
            current[segment] = healthy_current(voltage[segment], speed[segment], vehicle.vehicle)
    return drawn


def shaft_loads(log: Log, during: np.ndarray, vehicle: VehicleFile) -> dict[str, float]:
    """Load of each shaft against a healthy one, less one, over some of the samples (n_samples,), where it can be told.

    It is the current against that of a healthy motor at the same voltage and speed, so a wrong
    current or voltage reading shows as load.
    """
    loads = {
        side: excess_load(log.observation[during, NAMES.index(f"{side}_current")], drawn[during])
        for side, drawn in healthy_currents(log, vehicle).items()
        if f"{side}_current" in vehicle.columns
    }
    return {side: load for side, load in loads.items() if load is not None}
