"""The relations of a vehicle from its healthy logs, with limits beyond what these reach."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import INDEX
from auv_fault_env.parameters import SAMPLE_RATE, SIDES
from diagnosers.diagnoser import last_values
from diagnosers.relations.episode import EpisodeWindows
from diagnosers.relations.model import RelationModel
from diagnosers.relations.windows import DURATION, Layout, Typical, is_under_way
from training.field.logs.log import Log
from training.field.vehicle_file import VehicleFile
from training.learning.relation_fit import (
    all_windows,
    fit_relation,
    lasting_medians,
    model_with,
    standardised_residual,
    typical_of,
    with_shares,
)

MARGIN = 1.8  # factor on what healthy windows reach, which are few
LEAST_WINDOWS = 120  # two minutes under way


class Rows(NamedTuple):
    """The rows of a segment in which readings arrived."""

    time: np.ndarray  # s from the log's start, (n,)
    reading: np.ndarray  # (n, n_channels), a missing one as the last before it


def lacking_channels(vehicle: VehicleFile) -> list[str]:
    """The channels that relations need and the vehicle does not log."""
    sides = SIDES[: vehicle.shafts]
    needed = ["speed", *(f"{side}_{kind}" for side in sides for kind in ("voltage", "current"))]
    return [name for name in needed if name not in vehicle.columns]


def layout_of(vehicle: VehicleFile) -> Layout | None:
    """The layout of the vehicle's readings; None without speed, voltage or current."""
    if lacking_channels(vehicle):
        return None
    sides = SIDES[: vehicle.shafts]
    has_shaft_speed = {f"{side}_rpm" for side in sides} <= vehicle.columns.keys()
    return Layout(sides, has_shaft_speed, min(vehicle.sample_rate, SAMPLE_RATE))


def fit_relations(logs: Sequence[Log], vehicle: VehicleFile) -> RelationModel | None:
    """Relations fitted to healthy logs, with limits from the same logs.

    None without the channels, or without two minutes under way.
    """
    layout = layout_of(vehicle)
    if layout is None:
        return None
    typical, parts = windows_under_way(logs, layout)
    if n_windows(parts) < LEAST_WINDOWS:
        return None
    coefficients = {name: fit_relation(name, parts, layout) for name in layout.relations}
    return widened(model_with(coefficients, parts, layout, typical), parts)


def why_no_relations(logs: Sequence[Log], vehicle: VehicleFile) -> tuple[str, str]:
    """Why `fit_relations` gives None, and the remedy."""
    lacking = lacking_channels(vehicle)
    if lacking:
        return f"no relations without {', '.join(lacking)}", "log what is lacking"
    _, parts = windows_under_way(logs, layout_of(vehicle))
    why = (
        f"no relations from {n_windows(parts)} s under way, each stretch counted from its "
        f"{DURATION:g}th second; {LEAST_WINDOWS} s are the least"
    )
    return why, "add healthy missions"


def windows_under_way(
    logs: Sequence[Log], layout: Layout
) -> tuple[dict[str, Typical], list[EpisodeWindows]]:
    """Typical readings by side, and all windows; both empty if the vehicle never was under way."""
    rows = [part.reading for log in logs for part in rows_of(log, layout)]
    if not any(is_under_way(part).any() for part in rows):
        return {}, []
    typical = {side: typical_of(rows, side) for side in layout.sides}
    return typical, all_windows(rows, layout, typical)


def n_windows(parts: Sequence[EpisodeWindows]) -> int:
    """Number of windows, which are a second apart."""
    return sum(len(part.is_steady) for part in parts)


def widened(model: RelationModel, parts: Sequence[EpisodeWindows]) -> RelationModel:
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


def rows_of(log: Log, layout: Layout) -> list[Rows]:
    """The rows of each segment that is longer than a window."""
    parts = []
    for segment in log.segments:
        observation = log.observation[segment]
        has_speed = np.isfinite(observation[:, INDEX["speed"]])
        reading = observation[has_speed].astype(np.float64)
        if len(reading) > layout.n_rows:
            parts.append(Rows(log.time[segment][has_speed], last_values(reading)))
    return parts
