"""Estimates along a log: drag and thrust by a Kalman filter, and each shaft's load."""

import numpy as np

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.parameters import SIDES
from diagnosers.diagnoser import fill_missing
from diagnosers.kalman import PARAMETERS, ParameterFilter, SurgeFilter
from training.field.diagnosis.shaft_load import excess_load, healthy_current
from training.field.logs.log import Log
from training.field.vehicle_file import VehicleFile

# states of both filters
STATES = {
    "drag": 1 + PARAMETERS.index("alpha"),
    "thrust": 1 + PARAMETERS.index("beta"),
}


def hull_history(log: Log, vehicle: VehicleFile) -> dict[str, np.ndarray]:
    """Drag and thrust relative to the vehicle's own (1 = healthy): mean and std, (2, n_samples).

    By the thesis' parameter filter, or one without acceleration where that is not logged. Empty
    where speed or a shaft's speed is not logged. A missing reading is the last one. Misleads at
    constant speed, where drag and thrust cannot be distinguished and only their ratio is estimated.
    """
    shafts = [f"{side}_rpm" for side in SIDES[: vehicle.shafts]]
    if not {"speed", *shafts} <= vehicle.columns.keys():
        return {}
    filter_class = ParameterFilter if "acceleration" in vehicle.columns else SurgeFilter
    parameter_filter = filter_class(vehicle.vehicle)
    histories = {name: np.zeros((2, len(log.time))) for name in STATES}
    for history in histories.values():
        history[0] = 1.0
    for segment in log.segments:
        estimate = parameter_filter.initial(1)
        readings = np.zeros((1, len(CHANNELS)))
        for k in range(segment.start, segment.stop):
            readings = fill_missing(log.observation[k : k + 1], readings)
            if vehicle.shafts == 1:  # its beta is the thrust of both shafts
                readings[:, INDEX["starboard_rpm"]] = readings[:, INDEX["port_rpm"]]
            estimate = parameter_filter.update(estimate, readings)
            for name, state in STATES.items():
                std = estimate.covariance[0, state, state] ** 0.5
                histories[name][:, k] = estimate.mean[0, state], std
    return histories


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


def excess_loads(log: Log, chosen: np.ndarray, vehicle: VehicleFile) -> dict[str, float]:
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
