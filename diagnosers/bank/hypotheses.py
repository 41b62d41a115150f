"""What a filter bank holds possible: the normal vehicle, and every fault of the catalogue in some grades of severity.

The vehicle falls into three subsystems, surge and the two motors. Each is observed by a small
filter of its own, and a hypothesis has one in every subsystem that its fault touches; elsewhere it
shares the filter of the normal vehicle.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from auv_fault_env.faults import CATALOGUE, classes, matrices
from auv_fault_env.parameters import HULL, PARAMETERS, SENSOR, SHAFT, SIDES

SURGE, PORT, STARBOARD = range(3)


def _sensors(*channels: str) -> tuple[str, ...]:
    return tuple(f"{channel}_{name}" for channel in channels for name in SENSOR)


# The parameters of a subsystem, in the order in which its filter reads them, and those that it sees
# through the others.
OWN: dict[int, tuple[str, ...]] = {
    SURGE: (*HULL, *(f"{side}_beta" for side in SIDES), *_sensors("speed", "acceleration")),
    **{
        subsystem: (
            *(f"{side}_{name}" for name in SHAFT if name != "beta"),
            *_sensors(f"{side}_voltage", f"{side}_current", f"{side}_rpm"),
        )
        for subsystem, side in zip((PORT, STARBOARD), SIDES, strict=True)
    },
}
SEEN: dict[int, tuple[str, ...]] = {
    SURGE: _sensors(*(f"{side}_rpm" for side in SIDES)),
    PORT: _sensors("speed"),
    STARBOARD: _sensors("speed"),
}
N_ROWS = max(map(len, OWN.values()))


class HypothesisTable(NamedTuple):
    """The hypotheses as the kernel reads them.

    Hypothesis 0 is the normal vehicle, as is the first filter of each subsystem.
    log_hazard (n_hypotheses,): logarithm of the chance per sample that a normal vehicle turns to
    it. diagnosis (n_hypotheses,): index of its class. grade (n_hypotheses,): index of its grade of
    severity. first (4,): the filters of subsystem m are first[m] to first[m + 1]. hypothesis
    (n_filters,): whose filter it is. slot (3, n_hypotheses): the filter of each hypothesis in each
    subsystem. rows (3, N_ROWS): which of `PARAMETERS` a subsystem reads. slope, offset (N_ROWS,
    n_filters): what severity 1 adds to these parameters, as a share of the healthy value and
    plainly. owns_speed (n_filters,): a motor's filter takes the surge speed from its own
    hypothesis, whose paddle wheel fails.
    """

    log_hazard: np.ndarray
    diagnosis: np.ndarray
    grade: np.ndarray
    first: np.ndarray
    hypothesis: np.ndarray
    slot: np.ndarray
    rows: np.ndarray
    slope: np.ndarray
    offset: np.ndarray
    owns_speed: np.ndarray


def _log_hazard(diagnoses: list[str], n_grades: int, hazard: float) -> np.ndarray:
    """Hazard shared evenly by the classes, then by the faults of a class, then by the grades."""
    share = [
        hazard / (len(set(diagnoses)) * diagnoses.count(name) * n_grades) for name in diagnoses
    ]
    return np.log(np.concatenate([[1.0 - hazard], np.repeat(share, n_grades)]))


def _touched(faults: Sequence[str], names: tuple[str, ...]) -> np.ndarray:
    """Which faults change one of these parameters, (n_faults,)."""
    changed = ({*CATALOGUE[name].scale, *CATALOGUE[name].offset} for name in faults)
    return np.array([not parameters.isdisjoint(names) for parameters in changed])


def hypothesis_table(n_grades: int, hazard: float, faults: Sequence[str]) -> HypothesisTable:
    """The hypotheses of these faults, ``1 + n_faults * n_grades``; hazard is that of all of them per sample."""
    order = list(PARAMETERS)
    diagnoses = [CATALOGUE[name].diagnosis for name in faults]
    chosen = [list(CATALOGUE).index(name) for name in faults]
    scale, shift = (effect[chosen] for effect in matrices()[:2])
    n_hypotheses = 1 + len(faults) * n_grades
    fault = np.repeat(np.arange(len(faults)), n_grades)
    slot = np.zeros((3, n_hypotheses), np.int64)
    rows = np.zeros((3, N_ROWS), np.int64)
    first = [0]
    hypothesis = []
    slope = []
    offset = []
    owns_speed = []
    for subsystem, names in OWN.items():
        owners = np.concatenate(
            [[0], 1 + np.flatnonzero(_touched(faults, names + SEEN[subsystem])[fault])]
        )
        slot[subsystem] = first[-1]
        slot[subsystem, owners] = first[-1] + np.arange(owners.size)
        rows[subsystem, : len(names)] = [order.index(name) for name in names]
        effects = np.zeros((2, owners.size, N_ROWS))
        effects[0, 1:, : len(names)] = (scale - 1.0)[fault[owners[1:] - 1]][
            :, rows[subsystem, : len(names)]
        ]
        effects[1, 1:, : len(names)] = shift[fault[owners[1:] - 1]][
            :, rows[subsystem, : len(names)]
        ]
        slope.append(effects[0])
        offset.append(effects[1])
        owns_speed.append(
            np.concatenate([[False], _touched(faults, _sensors("speed"))[fault[owners[1:] - 1]]])
        )
        hypothesis.append(owners)
        first.append(first[-1] + owners.size)
    names = list(classes())
    return HypothesisTable(
        _log_hazard(diagnoses, n_grades, hazard),
        np.concatenate([[0], np.array([names.index(name) for name in diagnoses])[fault]]),
        np.concatenate([[0], np.tile(np.arange(n_grades), len(faults))]),
        np.array(first, np.uint64),  # unsigned, so that loops over filters vectorise
        np.concatenate(hypothesis),
        slot,
        rows,
        *(np.concatenate(parts).T.copy() for parts in (slope, offset, owns_speed)),
    )
