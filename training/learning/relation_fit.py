"""The fit of relations to healthy missions: coefficients, scatter, shares of odd readings."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import nnls

from auv_fault_env.channels import INDEX
from diagnosers.relations.episode import EpisodeWindows, episode_windows
from diagnosers.relations.model import (
    LEAST_LIMIT,
    RelationModel,
    Scatter,
    residuals_of,
    tolerance,
)
from diagnosers.relations.windows import (
    PUSH,
    Layout,
    Typical,
    is_under_way,
)
from diagnosers.residuals import LASTING

FLOOR = 0.3  # of the median size, below which an error counts as one of that size
FREE_SHARE = 0.3  # of zeros or repeated values, however few healthy missions have
MORE_SHARE = 0.15  # than on the healthy missions


def model_with(
    coefficients: Mapping[str, np.ndarray],
    parts: Sequence[EpisodeWindows],
    layout: Layout,
    typical: Mapping[str, Typical],
) -> RelationModel:
    """The model with these coefficients: scatter of these windows, limits at their least."""
    return RelationModel(
        layout=layout,
        typical=typical,
        coefficients=coefficients,
        steady=scatter(parts, coefficients, layout, steady=True),
        changing=scatter(parts, coefficients, layout, steady=False),
        lasting=dict.fromkeys(layout.residuals, LEAST_LIMIT),
        sizes=median_sizes(parts, coefficients, layout),
        shares={name: (FREE_SHARE, FREE_SHARE) for name in layout.counted},
    )


def with_shares(model: RelationModel, parts: Sequence[EpisodeWindows]) -> RelationModel:
    """The model with shares of zeros and repeated values beyond those of these windows."""
    shares = dict(model.shares)
    for part in parts:
        most = part.windows.shares.max(axis=0) + MORE_SHARE
        for name, (zeros, repeated) in zip(model.layout.counted, most, strict=True):
            most_zeros, most_repeated = shares[name]
            shares[name] = (max(most_zeros, float(zeros)), max(most_repeated, float(repeated)))
    return replace(model, shares=shares)


def standardised_residual(model: RelationModel, part: EpisodeWindows) -> np.ndarray:
    """Residuals of the windows in standard deviations, (n, n_residuals)."""
    return model.standardised(part.windows, part.is_steady).residual


def lasting_medians(residual: np.ndarray) -> np.ndarray:
    """Medians over `LASTING` windows in a row, (n - LASTING + 1, n_residuals)."""
    if len(residual) < LASTING:
        return np.zeros((0, residual.shape[1]))
    return np.median(np.lib.stride_tricks.sliding_window_view(residual, LASTING, axis=0), axis=-1)


def typical_of(rows: Sequence[np.ndarray], side: str) -> Typical:
    """Median readings of a side under way."""
    together = np.concatenate(rows)
    moving = together[is_under_way(together)]
    medians = (np.nanmedian(moving[:, INDEX[f"{side}_{kind}"]]) for kind in Typical._fields)
    return Typical(*map(float, medians))


def all_windows(
    rows: Iterable[np.ndarray], layout: Layout, typical: Mapping[str, Typical]
) -> list[EpisodeWindows]:
    """The windows of every mission that has any."""
    parts = [episode_windows(one, layout, typical) for one in rows]
    return [part for part in parts if part.last.size]


def fit_relation(name: str, parts: Sequence[EpisodeWindows], layout: Layout) -> np.ndarray:
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


def median_sizes(
    parts: Sequence[EpisodeWindows], coefficients: Mapping[str, np.ndarray], layout: Layout
) -> dict[str, float]:
    """Median size of what each residual's relation predicts."""
    sizes = [residuals_of(layout, coefficients, part.windows)[1] for part in parts]
    medians = np.median(np.concatenate(sizes), axis=0)
    return dict(zip(layout.residuals, medians.tolist(), strict=True))


def scatter(
    parts: Sequence[EpisodeWindows],
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
    return Scatter(float(constant), share, LEAST_LIMIT)
