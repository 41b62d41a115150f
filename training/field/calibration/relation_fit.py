"""The relations of a vehicle from its healthy logs, with limits beyond what these reach."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from auv_fault_env.channels import INDEX
from auv_fault_env.parameters import SAMPLE_RATE, SIDES
from diagnosers.relations.model import RelationModel
from diagnosers.relations.windows import Layout, is_under_way
from training.field.logs.log import Log, last_values
from training.field.vehicle_file import VehicleFile
from training.learning.relation_fit import (
    MissionWindows,
    all_windows,
    fit_relation,
    lasting_medians,
    model_with,
    standardised_residual,
    typical_of,
    with_shares,
)

MARGIN = 1.5  # factor on what healthy windows reach, which are few
LEAST_WINDOWS = 120  # two minutes under way


def layout_of(vehicle: VehicleFile) -> Layout | None:
    """The layout of the vehicle's readings; None without speed, voltage or current."""
    sides = SIDES[: vehicle.shafts]
    needed = {"speed", *(f"{side}_{kind}" for side in sides for kind in ("voltage", "current"))}
    if not needed <= vehicle.columns.keys():
        return None
    has_shaft_speed = {f"{side}_rpm" for side in sides} <= vehicle.columns.keys()
    return Layout(sides, has_shaft_speed, min(vehicle.sample_rate, SAMPLE_RATE))


def fit_relations(logs: Sequence[Log], vehicle: VehicleFile) -> RelationModel | None:
    """Relations fitted to healthy logs, with limits from the same logs.

    None without the channels, or without two minutes under way.
    """
    layout = layout_of(vehicle)
    rows = [part for log in logs for part in under_way(log, layout)] if layout else []
    if layout is None or not any(is_under_way(part).any() for part in rows):
        return None
    typical = {side: typical_of(rows, side) for side in layout.sides}
    parts = all_windows(rows, layout, typical)
    if sum(len(part.is_steady) for part in parts) < LEAST_WINDOWS:
        return None
    coefficients = {name: fit_relation(name, parts, layout) for name in layout.relations}
    return widened(model_with(coefficients, parts, layout, typical), parts)


def with_healthy_logs(model: RelationModel, logs: Sequence[Log]) -> RelationModel:
    """The model with limits that the windows of more healthy logs do not cross."""
    rows = [part for log in logs for part in under_way(log, model.layout)]
    return widened(model, all_windows(rows, model.layout, model.typical))


def widened(model: RelationModel, parts: Sequence[MissionWindows]) -> RelationModel:
    """The model with limits beyond what these healthy windows reach, by the factor `MARGIN`."""
    names = model.layout.residuals
    regimes = {}
    for key, steady in (("steady", True), ("changing", False)):
        largest = np.zeros(len(names))
        for part in parts:
            residual = standardised_residual(model, part)[part.is_steady == steady]
            largest = np.maximum(largest, np.abs(residual).max(axis=0, initial=0.0))
        regimes[key] = {
            name: one._replace(limit=max(one.limit, MARGIN * float(largest[k])))
            for k, (name, one) in enumerate(getattr(model, key).items())
        }
    lasting = dict(model.lasting)
    for part in parts:
        medians = lasting_medians(standardised_residual(model, part))
        for name, value in zip(names, np.abs(medians).max(axis=0, initial=0.0), strict=True):
            lasting[name] = max(lasting[name], MARGIN * float(value))
    return replace(with_shares(model, parts), lasting=lasting, **regimes)


def under_way(log: Log, layout: Layout) -> list[np.ndarray]:
    """The readings (n, n_channels) of each segment, without the rows in which none arrived."""
    parts = []
    for segment in log.segments:
        observation = log.observation[segment]
        has_speed = np.isfinite(observation[:, INDEX["speed"]])
        part = observation[has_speed].astype(np.float64)
        if len(part) > layout.n_rows:
            parts.append(last_values(part))
    return parts
