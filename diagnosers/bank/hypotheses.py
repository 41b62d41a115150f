"""The hypotheses of a filter bank: the normal vehicle, and every fault in some grades of severity.

The vehicle has three subsystems, surge and the two motors. A hypothesis has a small filter in each
that its fault touches; elsewhere it shares the filter of the normal vehicle.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from auv_fault_env.faults import CATALOGUE, Fault, classes, matrices
from auv_fault_env.light import light
from auv_fault_env.parameters import HULL, PARAMETERS, SENSOR, SHAFT, SIDES, Vehicle

SURGE, PORT, STARBOARD = range(3)
N_SUBSYSTEMS = 3


def of_sensors(*channels: str) -> tuple[str, ...]:
    """The names of the parameters of these channels' sensors."""
    return tuple(f"{channel}_{name}" for channel in channels for name in SENSOR)


def _of_motor(side: str) -> tuple[str, ...]:
    """The parameters of a motor with its propeller and its sensors."""
    shaft = tuple(f"{side}_{name}" for name in SHAFT if name != "beta")
    return shaft + of_sensors(f"{side}_voltage", f"{side}_current", f"{side}_rpm")


# the parameters of each subsystem, in the order of the rows of its filters
OWN_PARAMETERS: dict[int, tuple[str, ...]] = {
    SURGE: (
        *HULL,
        *(f"{side}_beta" for side in SIDES),
        *of_sensors("speed", "acceleration"),
    ),
    PORT: _of_motor("port"),
    STARBOARD: _of_motor("starboard"),
}
# the parameters of the sensors from which a subsystem takes what another one determines
INPUT_PARAMETERS: dict[int, tuple[str, ...]] = {
    SURGE: of_sensors(*(f"{side}_rpm" for side in SIDES)),
    PORT: of_sensors("speed"),
    STARBOARD: of_sensors("speed"),
}
INDEX = np.uint64  # of the kernel's filters: unsigned, so that loops vectorise
N_PARAMETER_ROWS = max(map(len, OWN_PARAMETERS.values()))


@light
class HypothesisTable(NamedTuple):
    """The hypotheses for the kernel; the first, and each subsystem's first filter, is normal.

    `first_filter` holds the first filter of each subsystem and the number of all. Severity 1 adds
    `slope`, a share of the healthy value, and `offset` to a parameter. `estimates_speed`: whether
    a motor's filter takes the surge speed from the surge filter of its hypothesis, because the
    paddle wheel is faulty.
    """

    log_hazard: np.ndarray  # (n_hypotheses,), log probability per sample that it begins
    class_index: np.ndarray  # (n_hypotheses,), of its diagnosis class
    grade: np.ndarray  # (n_hypotheses,), index of its grade of severity
    first_filter: np.ndarray  # (4,)
    hypothesis: np.ndarray  # (n_filters,), of each filter
    filter: np.ndarray  # (3, n_hypotheses), of each hypothesis in each subsystem
    parameter: np.ndarray  # (3, N_PARAMETER_ROWS), index in `PARAMETERS` of each row
    slope: np.ndarray  # (N_PARAMETER_ROWS, n_filters)
    offset: np.ndarray  # (N_PARAMETER_ROWS, n_filters)
    estimates_speed: np.ndarray  # (n_filters,)


_cache: dict[tuple, tuple[tuple[Fault, ...], Any]] = {}  # catalogue and what was built of it


def of_catalogue(build: Callable[..., Any], *settings: Any) -> Any:
    """``build(*settings)`` of the catalogue as it is now, built anew only when that has changed."""
    key = build, *settings
    catalogue = tuple(CATALOGUE.values())
    if key not in _cache or _cache[key][0] != catalogue:
        _cache[key] = catalogue, build(*settings)
    return _cache[key][1]


def possible_faults(vehicle: Vehicle) -> tuple[str, ...]:
    """Names of the faults of the catalogue that a vehicle can have."""
    return tuple(fault.name for fault in CATALOGUE.values() if fault.is_possible(vehicle))


def hypothesis_table(n_grades: int, hazard: float, faults: Sequence[str]) -> HypothesisTable:
    """The table of ``1 + n_faults * n_grades`` hypotheses.

    hazard is the probability per sample that a normal vehicle gets any of the faults.
    """
    class_of_fault = [classes().index(CATALOGUE[name].diagnosis) for name in faults]
    fault = np.repeat(np.arange(len(faults)), n_grades)
    grade = np.tile(np.arange(n_grades), len(faults))
    speed_fault = touched(faults, of_sensors("speed"))
    parts = [filters_of_faults(subsystem, faults, fault) for subsystem in OWN_PARAMETERS]
    of_filters = joined(parts, 1 + fault.size)
    estimates_speed = np.concatenate([[False], speed_fault[fault]])
    return HypothesisTable(
        log_hazard=np.log(np.concatenate([[1.0 - hazard], hazard * shares(faults, fault)])),
        class_index=np.concatenate([[0], np.array(class_of_fault)[fault]]),
        grade=np.concatenate([[0], grade]).astype(INDEX),
        **of_filters,
        estimates_speed=estimates_speed[of_filters["hypothesis"]],
    )


class Filters(NamedTuple):
    """The filters of a subsystem, the first that of the normal vehicle; filter first."""

    hypothesis: np.ndarray
    slope: np.ndarray
    offset: np.ndarray


def filters_of_faults(subsystem: int, faults: Sequence[str], fault: np.ndarray) -> Filters:
    """The filters of the hypotheses whose fault, (n_hypotheses - 1,), touches the subsystem."""
    names = OWN_PARAMETERS[subsystem]
    is_touched = touched(faults, names + INPUT_PARAMETERS[subsystem])
    hypothesis = np.flatnonzero(np.concatenate([[True], is_touched[fault]]))
    order = list(CATALOGUE)
    of_filters = [order.index(faults[k]) for k in fault[hypothesis[1:] - 1]]
    rows = np.array(of_filters, np.int64)[:, None]
    columns = parameter_indices(names)
    effects = matrices()
    slope = np.zeros((hypothesis.size, N_PARAMETER_ROWS))
    offset = np.zeros_like(slope)
    slope[1:, : len(names)] = effects.scale[rows, columns] - 1.0
    offset[1:, : len(names)] = effects.offset[rows, columns]
    return Filters(hypothesis, slope, offset)


def joined(parts: Sequence[Filters], n_hypotheses: int) -> dict[str, np.ndarray]:
    """What a table, such as `HypothesisTable`, says of the filters of all subsystems."""
    first_filter = np.cumsum([0, *(part.hypothesis.size for part in parts)])
    filter_of = np.zeros((N_SUBSYSTEMS, n_hypotheses), INDEX)
    parameter = np.zeros((N_SUBSYSTEMS, N_PARAMETER_ROWS), np.int64)
    for subsystem, names in OWN_PARAMETERS.items():
        first, last = first_filter[subsystem : subsystem + 2]
        filter_of[subsystem] = first
        filter_of[subsystem, parts[subsystem].hypothesis] = range(first, last)
        parameter[subsystem, : len(names)] = parameter_indices(names)
    return dict(
        first_filter=first_filter.astype(INDEX),
        hypothesis=np.concatenate([part.hypothesis for part in parts]).astype(INDEX),
        filter=filter_of,
        parameter=parameter,
        slope=np.concatenate([part.slope for part in parts]).T.copy(),
        offset=np.concatenate([part.offset for part in parts]).T.copy(),
    )


def shares(faults: Sequence[str], fault: np.ndarray) -> np.ndarray:
    """Shares of the hazard: even by class, then by fault of a class, then by grade of a fault.

    fault: that of each hypothesis but the normal one.
    """
    diagnoses = [CATALOGUE[name].diagnosis for name in faults]
    n_classes = len(set(diagnoses))
    n_members = np.array([diagnoses.count(name) for name in diagnoses])
    n_grades = np.bincount(fault, minlength=len(faults))
    return 1.0 / (n_classes * n_members * n_grades)[fault]


def touched(faults: Sequence[str], names: tuple[str, ...]) -> np.ndarray:
    """Whether each fault changes one of these parameters, (n_faults,)."""
    changes_any = []
    for name in faults:
        fault = CATALOGUE[name]
        changed = {*fault.scale, *fault.offset}
        changes_any.append(not changed.isdisjoint(names))
    return np.array(changes_any)


def parameter_indices(names: tuple[str, ...]) -> list[int]:
    """Indices of these parameters in `PARAMETERS`."""
    order = list(PARAMETERS)
    return [order.index(name) for name in names]
