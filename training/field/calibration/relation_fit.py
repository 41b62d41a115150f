"""The fit of a vehicle's relations to healthy logs: coefficients, scatter and limits."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.errors import refusal
from diagnosers.relations.model import (
    LEAST_LIMIT,
    RelationModel,
    Scatter,
    residuals_of,
    tolerance,
)
from diagnosers.relations.windows import DURATION, PUSH, Layout, Typical, Windows, windows_of
from diagnosers.residuals import LASTING, SETTLED
from training.field.logs.log import Log
from training.field.vehicle_file import VehicleFile

MARGIN = 1.5  # factor on what healthy windows reach, which are few
FLOOR = 0.3  # of the median size, below which an error counts as one of that size
FREE_SHARE = 0.3  # of zeros or repeated values, however few the healthy logs have
MORE_SHARE = 0.15  # than in the healthy logs
LEAST_WINDOWS = 120  # two minutes under way


class LogWindows(NamedTuple):
    """The windows of a segment, a second apart, under way."""

    windows: Windows
    is_steady: np.ndarray  # (n,)


def layout_of(vehicle: VehicleFile) -> Layout | None:
    """The layout of the vehicle's readings; None without speed, voltage or current."""
    sides = ("port", "starboard")[: vehicle.shafts]
    needed = {"speed", *(f"{side}_{kind}" for side in sides for kind in ("voltage", "current"))}
    if not needed <= vehicle.columns.keys():
        return None
    has_shaft_speed = {f"{side}_rpm" for side in sides} <= vehicle.columns.keys()
    return Layout(sides, has_shaft_speed, min(vehicle.sample_rate, 10.0))


def fit_relations(logs: Sequence[Log], others: Sequence[Log], layout: Layout) -> RelationModel:
    """Relations fitted to healthy logs; limits from these logs and others that are healthy too."""
    rows = [part for log in logs for part in under_way(log, layout)]
    typical = {side: typical_of(rows, side) for side in layout.sides}
    fitted = [log_windows(part, layout, typical) for part in rows]
    fitted = [part for part in fitted if part is not None]
    n_windows = sum(len(part.is_steady) for part in fitted)
    if n_windows < LEAST_WINDOWS:
        allowed = f"at least {LEAST_WINDOWS} s under way"
        raise refusal("healthy logs", f"{n_windows} s", allowed, "add logs")
    coefficients = {name: fit_relation(name, fitted, layout) for name in layout.relations}
    more = [log_windows(part, layout, typical) for log in others for part in under_way(log, layout)]
    judged = fitted + [part for part in more if part is not None]
    steady, changing = (scatter(judged, coefficients, layout, of) for of in (True, False))
    model = RelationModel(
        layout=layout,
        typical=typical,
        coefficients=coefficients,
        steady=steady,
        changing=changing,
        lasting=dict.fromkeys(layout.residuals, LEAST_LIMIT),
        shares=share_limits(judged, layout),
    )
    return _with_lasting(model, judged)


def under_way(log: Log, layout: Layout) -> list[np.ndarray]:
    """The readings (n, n_channels) of each segment, without the rows in which none arrived."""
    parts = []
    for segment in log.segments:
        observation = log.observation[segment]
        has_speed = np.isfinite(observation[:, INDEX["speed"]])
        part = observation[has_speed].astype(np.float64)
        if len(part) > layout.n_rows:
            parts.append(filled(part))
    return parts


def filled(rows: np.ndarray) -> np.ndarray:
    """The rows with the last reading where one is missing."""
    last = np.where(np.isnan(rows), 0, np.arange(len(rows))[:, None])
    return np.take_along_axis(rows, np.maximum.accumulate(last, axis=0), axis=0)


def typical_of(rows: Sequence[np.ndarray], side: str) -> Typical:
    """Median readings of a side under way."""
    together = np.concatenate(rows)
    moving = together[together[:, INDEX["mission_speed"]] > 0.0]
    if not len(moving):
        raise refusal("healthy logs", "no speed command above 0", "a vehicle under way", "add logs")
    current, voltage = (
        float(np.nanmedian(moving[:, INDEX[f"{side}_{kind}"]])) for kind in ("current", "voltage")
    )
    return Typical(current, voltage)


def log_windows(
    rows: np.ndarray, layout: Layout, typical: Mapping[str, Typical]
) -> LogWindows | None:
    """The windows of a segment's rows; None if the vehicle was not under way."""
    n_rows = layout.n_rows
    every = max(1, round(layout.sample_rate))
    command = rows[:, INDEX["mission_speed"]]
    changed = np.concatenate([[True], np.diff(command) != 0.0])
    index = np.arange(len(rows))
    held = index - np.maximum.accumulate(np.where(changed, index, 0))
    ends = np.arange(n_rows - 1, len(rows), every)
    views = np.lib.stride_tricks.sliding_window_view(rows, n_rows, axis=0)[:: every]
    chosen = (np.lib.stride_tricks.sliding_window_view(command, n_rows)[::every] > 0.0).all(axis=1)
    if not chosen.any():
        return None
    windows = windows_of(np.swapaxes(views[chosen], 1, 2), layout, dict(typical))
    is_steady = held[ends[chosen]] >= (SETTLED + DURATION) * layout.sample_rate
    return LogWindows(windows, is_steady)


def fit_relation(name: str, parts: Sequence[LogWindows], layout: Layout) -> np.ndarray:
    """Coefficients of a relation by weighted least squares of relative errors.

    Those of net force and load have signs by physics, where a shaft speed is read.
    """
    chosen = [part.windows.is_valid[name] for part in parts]
    terms = np.concatenate([p.windows.terms[name][c] for p, c in zip(parts, chosen, strict=True)])
    values = np.concatenate([p.windows.values[name][c] for p, c in zip(parts, chosen, strict=True)])
    size = terms[:, 2] if name == PUSH else values
    size = np.abs(size)
    weight = 1.0 / np.maximum(size, FLOOR * np.median(size))
    weighted = terms * weight[:, None]
    scale = np.maximum(np.abs(weighted).mean(axis=0), 1e-12)
    has_signs = name == PUSH or (layout.has_shaft_speed and name.endswith("load"))
    if has_signs:
        solution, _ = nnls(weighted / scale, values * weight)
    else:
        solution, *_ = np.linalg.lstsq(weighted / scale, values * weight, rcond=None)
    return solution / scale


def scatter(
    parts: Sequence[LogWindows],
    coefficients: Mapping[str, np.ndarray],
    layout: Layout,
    steady: bool,
) -> dict[str, Scatter]:
    """Scatter of each residual over the steady windows, or over the others."""
    pairs = [residuals_of(layout, coefficients, part.windows) for part in parts]
    chosen = [part.is_steady == steady for part in parts]
    residual = np.concatenate([pair[0][c] for pair, c in zip(pairs, chosen, strict=True)])
    size = np.concatenate([pair[1][c] for pair, c in zip(pairs, chosen, strict=True)])
    found = {}
    for k, name in enumerate(layout.residuals):
        least_share = tolerance(layout, name) / LEAST_LIMIT
        found[name] = _scatter(residual[:, k], size[:, k], least_share)
    return found


def _scatter(residual: np.ndarray, size: np.ndarray, least_share: float) -> Scatter:
    if not len(residual):
        return Scatter(0.0, least_share, LEAST_LIMIT)
    squares = np.stack([np.ones(len(size)), size**2], axis=1)
    scale = squares.mean(axis=0)
    weight = 1.0 / (size**2 + 0.05 * scale[1])
    variances, _ = nnls(squares / scale * weight[:, None], residual**2 * weight)
    constant, share = np.sqrt(variances / scale)
    share = max(float(share), least_share)
    std = np.hypot(constant, share * size)
    limit = max(LEAST_LIMIT, MARGIN * float((np.abs(residual) / std).max()))
    return Scatter(float(constant), share, limit)


def share_limits(parts: Sequence[LogWindows], layout: Layout) -> dict[str, tuple[float, float]]:
    """Limits on the shares of zeros and repeated values, by reading."""
    most = np.max([part.windows.shares.max(axis=0) for part in parts], axis=0)
    limits = np.maximum(most + MORE_SHARE, FREE_SHARE)
    return {
        name: (float(zeros), float(repeated))
        for name, (zeros, repeated) in zip(layout.counted, limits, strict=True)
    }


def _with_lasting(model: RelationModel, parts: Sequence[LogWindows]) -> RelationModel:
    """The model with limits on means over `LASTING` windows in a row."""
    largest = np.zeros(len(model.layout.residuals))
    for part in parts:
        residual = model.standardised(part.windows, part.is_steady).residual
        if len(residual) >= LASTING:
            total = np.cumsum(np.vstack([np.zeros(residual.shape[1]), residual]), axis=0)
            mean = (total[LASTING:] - total[:-LASTING]) / LASTING
            largest = np.maximum(largest, np.abs(mean).max(axis=0))
    lasting = np.maximum(LEAST_LIMIT, MARGIN * largest)
    names = model.layout.residuals
    limits = {name: float(limit) for name, limit in zip(names, lasting, strict=True)}
    return RelationModel(**{**vars(model), "lasting": limits})
