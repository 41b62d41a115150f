"""The relations of one healthy vehicle: coefficients, scatter and limits."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from diagnosers.relations.windows import BALANCE, PUSH, Layout, Typical, Windows

# Changes of a healthy vehicle between missions, relative, that raise no alarm: a payload, fouling,
# water temperature, the state of the battery.
TOLERANCE = {"push": 0.2, "load": 0.05, "voltage": 0.1, "balance": 0.05}
LOAD_BY_SPEED_TOLERANCE = 0.15  # of a load without a shaft speed, which the drag enters
LEAST_LIMIT = 3.5  # standard deviations
LEAST_SIZE = 1e-6  # of what a relation predicts


class Scatter(NamedTuple):
    """How far a residual of healthy windows is from zero: std^2 = constant^2 + (share size)^2."""

    constant: float  # in the unit of the residual
    share: float  # of the size of what the relation predicts
    limit: float  # standard deviations, beyond which no healthy window was, with a margin


@dataclass(frozen=True)
class RelationModel:
    """The relations of a healthy vehicle, see `diagnosers.relations.windows`.

    Attributes
    ----------
    layout
        Readings of the vehicle.
    typical
        Readings of each side under way.
    coefficients
        Of each relation's terms.
    steady, changing
        Scatter of each residual, at a speed command that has not changed for a while and otherwise.
    lasting
        Limit of the median of each residual over the last 45 windows [standard deviations].
    sizes
        Median size of what each relation predicts, in the unit of its residual.
    shares
        Largest shares of zeros and of repeated values, by reading.
    """

    layout: Layout
    typical: Mapping[str, Typical]
    coefficients: Mapping[str, np.ndarray]
    steady: Mapping[str, Scatter]
    changing: Mapping[str, Scatter]
    lasting: Mapping[str, float]
    sizes: Mapping[str, float]
    shares: Mapping[str, tuple[float, float]]

    def standardised(self, windows: Windows, is_steady: np.ndarray) -> "Standardised":
        """Residuals in standard deviations; is_steady (n,) bool."""
        residual, size = residuals_of(self.layout, self.coefficients, windows)
        names = self.layout.residuals
        steady = np.array([self.steady[name] for name in names])
        changing = np.array([self.changing[name] for name in names])
        scatter = np.where(is_steady[:, None, None], steady, changing)
        constant, share, limit = np.moveaxis(scatter, -1, 0)
        std = np.hypot(constant, share * size)
        return Standardised(residual / std, limit, size / std)

    def smallest_changes(self) -> dict[str, float]:
        """Smallest lasting change that crosses a limit at a steady command, relative, by residual.

        A change of the net force is relative to the drag, one of the others to current and voltage.
        """
        changes = {}
        for name in self.layout.residuals:
            scatter = self.steady[name]
            size = self.sizes[name]
            std = math.hypot(scatter.constant, scatter.share * size)
            changes[name] = min(scatter.limit, self.lasting[name]) * std / size
        return changes


class Standardised(NamedTuple):
    """Residuals of windows in standard deviations, (n, n_residuals) each."""

    residual: np.ndarray
    limit: np.ndarray  # of its absolute value
    per_size: np.ndarray  # residual of a relative change of 1

    def part(self, chosen: np.ndarray) -> "Standardised":
        """Those of some windows, by number or as a mask."""
        return Standardised(*(values[chosen] for values in self))


def residuals_of(
    layout: Layout, coefficients: Mapping[str, np.ndarray], windows: Windows
) -> tuple[np.ndarray, np.ndarray]:
    """Residuals and sizes of what is predicted, (n, n_residuals), about 0 where no relation holds.

    The size of the net force is the drag; the balance of voltages is the difference of their
    relative residuals, times its size, the mean of both.
    """
    residual = {}
    size = {}
    for name in layout.relations:
        residual[name], predicted = residual_of(name, coefficients, windows)
        if name == PUSH:  # the terms after the two of the thrust
            drag = windows.terms[name][:, 2:4] @ coefficients[name][2:4]
            predicted = np.where(windows.is_valid[name], drag, 0.0)
        size[name] = np.maximum(np.abs(predicted), LEAST_SIZE)
    if BALANCE in layout.residuals:
        voltages = [f"{side}_voltage" for side in layout.sides]
        are_valid = np.all([windows.is_valid[name] for name in voltages], axis=0)
        port, starboard = (residual[name] / size[name] for name in voltages)
        size[BALANCE] = np.where(are_valid, 0.5 * sum(map(size.get, voltages)), LEAST_SIZE)
        residual[BALANCE] = np.where(are_valid, port - starboard, 0.0) * size[BALANCE]
    names = layout.residuals
    return (
        np.stack([residual[name] for name in names], axis=1),
        np.stack([size[name] for name in names], axis=1),
    )


def residual_of(
    name: str, coefficients: Mapping[str, np.ndarray], windows: Windows
) -> tuple[np.ndarray, np.ndarray]:
    """Residual of a relation and what it predicts, (n,) each, 0 where it does not hold."""
    is_valid = windows.is_valid[name]
    predicted = np.where(is_valid, windows.terms[name] @ coefficients[name], 0.0)
    return np.where(is_valid, windows.values[name] - predicted, 0.0), predicted


def tolerance(layout: Layout, residual: str) -> float:
    """Relative change of a healthy vehicle that raises no alarm."""
    kind = kind_of(residual)
    if kind == "load" and not layout.has_shaft_speed:
        return LOAD_BY_SPEED_TOLERANCE
    return TOLERANCE[kind]


def kind_of(residual: str) -> str:
    """The key of `TOLERANCE` for a residual.

    >>> kind_of("port_load"), kind_of("balance")
    ('load', 'balance')
    """
    return residual.rpartition("_")[2]
