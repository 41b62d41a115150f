"""The readings of a window as the terms of relations that hold on a healthy vehicle.

Each relation is linear in averages over the window, weighted by the square of a sine, which is zero
at both ends. By partial integration the average of a derivative is one of the readings themselves,
so that no reading is differentiated (weak form; Messenger & Bortz, "Weak SINDy for partial
differential equations", J. Comput. Phys. 443, 2021, doi:10.1016/j.jcp.2021.110525).
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import INDEX
from auv_fault_env.parameters import SIDES

DURATION = 15.0  # s, of a window
SETTLED = 15.0  # s before a window, in which the speed command of a steady one has not changed
PER_THOUSAND = 1e-3  # shaft speeds are in 1000 rpm, so that coefficients are of similar size
LEAST_CURRENT = 0.05  # of the typical one, below which a motor does not drive its shaft
LEAST_DRIVEN = 0.5  # share of a window in which a motor has to drive its shaft
LEAST_VOLTAGE = 0.2  # of the typical one, above which a shaft has to turn

PUSH = "push"
BALANCE = "balance"


class Layout(NamedTuple):
    """Which readings a vehicle has."""

    sides: tuple[str, ...]
    has_shaft_speed: bool
    sample_rate: float  # of the readings [Hz]

    @property
    def n_rows(self) -> int:
        """Readings in a window."""
        return max(4, round(DURATION * self.sample_rate))

    @property
    def every(self) -> int:
        """Readings from one judged window to the next, a second later."""
        return max(1, round(self.sample_rate))

    @property
    def relations(self) -> tuple[str, ...]:
        """Names of the relations."""
        of_hull = (PUSH,) if self.has_shaft_speed else ()
        of_sides = (f"{side}_{kind}" for kind in ("load", "voltage") for side in self.sides)
        return (*of_hull, *of_sides)

    @property
    def residuals(self) -> tuple[str, ...]:
        """Names of the residuals that are judged.

        Voltages of two sides are judged by their difference, because they share the supply.
        """
        if len(self.sides) < len(SIDES) or not self.has_shaft_speed:
            return self.relations
        loads = (f"{side}_load" for side in self.sides)
        return (PUSH, *loads, BALANCE)

    @property
    def counted(self) -> tuple[str, ...]:
        """Readings of which zeros and repeated values are counted, the likelier culprit first."""
        if not self.has_shaft_speed:
            return ("speed",)
        kinds = ("rpm", "current", "voltage")
        return (*(f"{side}_{kind}" for side in self.sides for kind in kinds), "speed")


class Typical(NamedTuple):
    """Typical readings of a side under way."""

    current: float  # A
    voltage: float  # V


class Windows(NamedTuple):
    """Windows as terms of the relations, window first."""

    terms: dict[str, np.ndarray]  # (n, n_terms) by relation
    values: dict[str, np.ndarray]  # (n,), what the terms have to explain
    is_valid: dict[str, np.ndarray]  # (n,) bool, whether the relation holds in the window
    speed: np.ndarray  # (n,), m/s
    shaft_speed: dict[str, np.ndarray]  # (n,) by side, 1000 rpm
    shares: np.ndarray  # (n, n_counted, 2), of zeros and of repeated values

    def part(self, chosen: np.ndarray) -> "Windows":
        """Some of the windows, by number or as a mask."""

        def of(part: np.ndarray | dict[str, np.ndarray]) -> np.ndarray | dict[str, np.ndarray]:
            if isinstance(part, dict):
                return {name: values[chosen] for name, values in part.items()}
            return part[chosen]

        return Windows(*map(of, self))


def is_under_way(rows: np.ndarray) -> np.ndarray:
    """Where the speed command, or without one the speed, is above zero; rows (..., n_channels)."""
    command = rows[..., INDEX["mission_speed"]]
    return np.where(np.isnan(command), rows[..., INDEX["speed"]], command) > 0.0


def is_steady(held: np.ndarray, layout: Layout) -> np.ndarray:
    """Whether windows are steady, from the number of rows for which the command has been held."""
    return held >= (SETTLED + DURATION) * layout.sample_rate


def n_terms(layout: Layout) -> dict[str, int]:
    """Number of terms by relation."""
    by_kind = {PUSH: 5, "load": 5, "voltage": 3 if layout.has_shaft_speed else 4}
    return {name: by_kind[name.rpartition("_")[2]] for name in layout.relations}


def weights(n_rows: int, sample_rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Weights (n_rows,) of an average, and of the average of a derivative [1/s]."""
    phase = (np.arange(n_rows) + 0.5) / n_rows
    weight = np.sin(np.pi * phase) ** 2
    derivative = -np.pi * np.sin(2.0 * np.pi * phase) * sample_rate / n_rows
    return weight / weight.sum(), derivative / weight.sum()


class Average(NamedTuple):
    """Averages over windows, and of derivatives over them."""

    weight: np.ndarray  # (n_rows,)
    derivative: np.ndarray  # (n_rows,) [1/s]

    def of(self, values: np.ndarray) -> np.ndarray:
        """Average of values (n, n_rows), (n,)."""
        return values @ self.weight

    def rate(self, values: np.ndarray) -> np.ndarray:
        """Average of the derivative of values (n, n_rows), (n,) [1/s]."""
        return values @ self.derivative


class Relation(NamedTuple):
    """One relation in windows, see `Windows`."""

    terms: np.ndarray
    values: np.ndarray
    is_valid: np.ndarray


def windows_of(rows: np.ndarray, layout: Layout, typical: Mapping[str, Typical]) -> Windows:
    """Windows from their readings (n, n_rows, n_channels), all finite where the layout has them."""
    shares = shares_of(rows, layout, typical)
    rows = without_spikes(rows)
    average = Average(*weights(layout.n_rows, layout.sample_rate))
    found: dict[str, Relation] = {}
    for side in layout.sides:
        if layout.has_shaft_speed:
            found |= _of_shaft(rows, side, typical[side], average)
        else:
            found |= _of_speed(rows, side, average)
    if layout.has_shaft_speed:
        found[PUSH] = _of_force(rows, layout, average)
    return Windows(
        terms={name: relation.terms for name, relation in found.items()},
        values={name: relation.values for name, relation in found.items()},
        is_valid={name: relation.is_valid for name, relation in found.items()},
        speed=average.of(rows[:, :, INDEX["speed"]]),
        shaft_speed={side: average.of(_shaft_speed(rows, side)) for side in layout.sides},
        shares=shares,
    )


def without_spikes(rows: np.ndarray) -> np.ndarray:
    """Rows (n, n_rows, n_channels) of which a single odd value is gone: medians of three in a row.

    The first and the last, whose weights are about zero, stay as they are.
    """
    before = rows[:, :-2]
    present = rows[:, 1:-1]
    after = rows[:, 2:]
    upper = np.minimum(np.maximum(before, present), after)
    median = np.maximum(np.minimum(before, present), upper)
    return np.concatenate([rows[:, :1], median, rows[:, -1:]], axis=1)


def _shaft_speed(rows: np.ndarray, side: str) -> np.ndarray:
    """Shaft speed (n, n_rows) [1000 rpm]."""
    return rows[:, :, INDEX[f"{side}_rpm"]] * PER_THOUSAND


def _of_shaft(
    rows: np.ndarray, side: str, typical: Typical, average: Average
) -> dict[str, Relation]:
    """Load and voltage of a side whose shaft speed is read."""
    speed = rows[:, :, INDEX["speed"]]
    current = rows[:, :, INDEX[f"{side}_current"]]
    voltage = rows[:, :, INDEX[f"{side}_voltage"]]
    shaft = _shaft_speed(rows, side)
    ones = np.ones(len(rows))
    load_terms = [
        ones,
        average.of(shaft),
        average.of(shaft**2),
        -average.of(shaft * speed),
        average.rate(shaft),
    ]
    # a motor that brakes or coasts is no motor of Ohm's law: its controller opens the circuit
    drives = current > LEAST_CURRENT * typical.current
    driven = average.of(drives.astype(float))
    scale = 1.0 / np.maximum(driven, 1e-3)
    voltage_terms = [
        ones,
        average.of(shaft * drives) * scale,
        average.of(current * drives) * scale,
    ]
    of_voltage = _wherever_read(voltage_terms, average.of(voltage * drives) * scale)
    is_valid = of_voltage.is_valid & (driven > LEAST_DRIVEN)
    return {
        f"{side}_load": _wherever_read(load_terms, average.of(current)),
        f"{side}_voltage": of_voltage._replace(is_valid=is_valid),
    }


def _of_speed(rows: np.ndarray, side: str, average: Average) -> dict[str, Relation]:
    """Load and voltage of a side whose shaft speed is not read: by the speed of the vehicle."""
    speed = rows[:, :, INDEX["speed"]]
    current = rows[:, :, INDEX[f"{side}_current"]]
    voltage = rows[:, :, INDEX[f"{side}_voltage"]]
    ones = np.ones(len(rows))
    powers = [average.of(speed**k) for k in (1, 2, 3)]
    rate = average.rate(speed)
    return {
        f"{side}_load": _wherever_read([ones, *powers, rate], average.of(current)),
        f"{side}_voltage": _wherever_read([ones, *powers[:2], rate], average.of(voltage)),
    }


def _of_force(rows: np.ndarray, layout: Layout, average: Average) -> Relation:
    """Net force: thrust by shaft speed and advance, drag quadratic, linear, and of the rudder."""
    speed = rows[:, :, INDEX["speed"]]
    shafts = [_shaft_speed(rows, side) for side in layout.sides]
    turn = np.nan_to_num(rows[:, :, INDEX["rudder"]]) * speed
    terms = [
        sum(average.of(shaft**2) for shaft in shafts),
        -sum(average.of(shaft * speed) for shaft in shafts),
        -average.of(speed**2),
        -average.of(speed),
        -average.of(turn**2),
    ]
    return _wherever_read(terms, average.rate(speed))


def _wherever_read(terms: Sequence[np.ndarray], values: np.ndarray) -> Relation:
    """A relation that holds wherever its terms and its value are read."""
    stacked = np.stack(terms, axis=1)
    is_valid = np.isfinite(values) & np.isfinite(stacked).all(axis=1)
    return Relation(stacked, values, is_valid)


def shares_of(rows: np.ndarray, layout: Layout, typical: Mapping[str, Typical]) -> np.ndarray:
    """Shares of zeros and of repeated values, (n, n_counted, 2).

    Readings of a motor count where its voltage is high enough to turn the shaft.
    """
    counted = []
    for name in layout.counted:
        side, _, kind = name.partition("_")
        is_counted = True
        if kind:
            voltage = rows[:, :, INDEX[f"{side}_voltage"]]
            is_counted = voltage > LEAST_VOLTAGE * typical[side].voltage
        reading = rows[:, :, INDEX[name]]
        is_zero = (reading == 0.0) & is_counted
        is_repeated = np.diff(reading, axis=1, prepend=math.inf) == 0.0
        is_repeated &= (reading != 0.0) & is_counted
        counted.append(np.stack([is_zero.mean(axis=1), is_repeated.mean(axis=1)], axis=1))
    return np.stack(counted, axis=1)
