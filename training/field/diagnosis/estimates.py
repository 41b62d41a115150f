"""Estimates along a log: drag and thrust by a Kalman filter, and each shaft's load."""

from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.parameters import SIDES
from diagnosers.diagnoser import fill_missing
from diagnosers.kalman import PARAMETERS, ParameterFilter, SurgeFilter
from training.field.diagnosis.shaft_load import excess_load, healthy_current
from training.field.logs.log import Log
from training.field.vehicle_file import VehicleFile

# states of both filters
STATES = {"drag": 1 + PARAMETERS.index("alpha"), "thrust": 1 + PARAMETERS.index("beta")}


class ParameterHistory(NamedTuple):
    """A parameter along a log, relative to the vehicle's own (1 = healthy); (n_samples,) each."""

    mean: np.ndarray
    std: np.ndarray


def hull_history(log: Log, vehicle: VehicleFile) -> dict[str, ParameterHistory]:
    """Drag and thrust along a log by the thesis' parameter filter.

    Without an accelerometer a filter without it takes over. Empty where speed or a shaft's speed is
    not logged. A missing reading is the last one. Misleads at constant speed, where drag and thrust
    cannot be distinguished and only their ratio is estimated.
    """
    shafts = [f"{side}_rpm" for side in SIDES[: vehicle.shafts]]
    if not {"speed", *shafts} <= vehicle.columns.keys():
        return {}
    filter_class = ParameterFilter if "acceleration" in vehicle.columns else SurgeFilter
    parameter_filter = filter_class(vehicle.vehicle)
    n_samples = len(log.time)
    histories = {name: ParameterHistory(np.ones(n_samples), np.zeros(n_samples)) for name in STATES}
    for segment in log.segments:
        estimate = parameter_filter.initial(1)
        readings = np.zeros((1, len(CHANNELS)))
        for k in range(segment.start, segment.stop):
            readings = fill_missing(log.observation[k : k + 1], readings)
            estimate = parameter_filter.update(estimate, on_both_shafts(readings, vehicle))
            for name, state in STATES.items():
                histories[name].mean[k] = estimate.mean[0, state]
                histories[name].std[k] = estimate.covariance[0, state, state] ** 0.5
    return histories


def on_both_shafts(observation: np.ndarray, vehicle: VehicleFile) -> np.ndarray:
    """The observation (1, n_channels), a single shaft's speed copied to both sides.

    The thrust in the vehicle file is that of all shafts.
    """
    if vehicle.shafts == 1:
        observation = observation.copy()
        observation[:, INDEX["starboard_rpm"]] = observation[:, INDEX["port_rpm"]]
    return observation


def healthy_currents(log: Log, vehicle: VehicleFile) -> dict[str, np.ndarray]:
    """Current [A] of each side's motor if it were healthy, (n_samples,); by side with a voltage."""
    speed = log.observation[:, INDEX["speed"]]
    currents = {}
    for side in SIDES:
        if f"{side}_voltage" in vehicle.columns:
            voltage = log.observation[:, INDEX[f"{side}_voltage"]]
            current = np.empty(len(log.time))
            for segment in log.segments:
                current[segment] = healthy_current(
                    voltage[segment], speed[segment], vehicle.vehicle
                )
            currents[side] = current
    return currents


def excess_loads(
    log: Log,
    chosen: np.ndarray,
    vehicle: VehicleFile,
) -> dict[str, float]:
    """Excess load of each shaft over the chosen samples (n_samples,), where it is known.

    It is the current against that of a healthy motor at the same voltage and speed, so a wrong
    current or voltage reading shows as load.
    """
    loads = {}
    for side, healthy in healthy_currents(log, vehicle).items():
        if f"{side}_current" in vehicle.columns:
            measured = log.observation[chosen, INDEX[f"{side}_current"]]
            load = excess_load(measured, healthy[chosen])
            if load is not None:
                loads[side] = load
    return loads
