"""The hypotheses of the filter bank: those of `diagnosers.bank.hypotheses`, and some others.

`OTHERS` are a change of the water's current, in which a vehicle is normal, and changes of a
subsystem, or of all, that no fault of the catalogue makes, which are the class `unknown`. A
hypothesis may also end.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from auv_fault_env.faults import CATALOGUE, NORMAL, UNKNOWN, classes
from auv_fault_env.light import light
from auv_fault_env.parameters import SAMPLE_TIME
from auv_fault_env.realism import SURROUNDINGS
from diagnosers.bank.hypotheses import (
    INDEX,
    N_PARAMETER_ROWS,
    OWN_PARAMETERS,
    PORT,
    STARBOARD,
    SURGE,
    Filters,
    filters_of_faults,
    joined,
    shares,
)

FORGETTING = SAMPLE_TIME / 45.0  # of evidence per sample: within a minute


class Other(NamedTuple):
    """A hypothesis that is no fault of the catalogue."""

    diagnosis: str
    subsystems: tuple[int, ...]  # those that it changes
    spread: float = 0.0  # variance that it adds to their deviations, in variances of healthy ones
    water: float = 0.0  # m/s, by which the speed through the water may change in a sample
    rate: float = 0.0  # 1/h, at which it begins
    duration: float = math.inf  # s, mean


def _changed(*subsystems: int) -> Other:
    """A change of the parameters of subsystems that no fault makes."""
    return Other(UNKNOWN, subsystems, spread=100.0, rate=0.002)


WATER_CURRENT = "water_current"
WATER_CURRENT_RATE = 3600.0 * SURROUNDINGS["current_rate"].value  # 1/h
OTHERS: dict[str, Other] = {
    WATER_CURRENT: Other(NORMAL, (SURGE,), water=0.005, rate=WATER_CURRENT_RATE, duration=4.0),
    "unknown": _changed(*OWN_PARAMETERS),
    "unknown_surge": _changed(SURGE),
    "unknown_port": _changed(PORT),
    "unknown_starboard": _changed(STARBOARD),
}


@light
class HypothesisTable(NamedTuple):
    """The hypotheses for the kernel; the first, and each subsystem's first filter, is normal.

    `first_filter` holds the first filter of each subsystem and the number of all. Severity 1 adds
    `slope`, a share of the healthy value, and `offset` to a parameter.
    """

    log_hazard: np.ndarray  # (n_hypotheses,), log probability per sample that it begins
    log_end: np.ndarray  # (n_hypotheses,), log probability per sample that it ends
    log_stay: np.ndarray  # (n_hypotheses,), log probability per sample that it does not
    log_odds: np.ndarray  # (n_hypotheses,), to normal if readings never distinguish it from that
    forgetting: float  # share of the log odds above these that is lost per sample
    class_index: np.ndarray  # (n_hypotheses,), of its diagnosis class
    grade: np.ndarray  # (n_hypotheses,), index of its grade of severity
    first_filter: np.ndarray  # (4,)
    hypothesis: np.ndarray  # (n_filters,), of each filter
    filter: np.ndarray  # (3, n_hypotheses), of each hypothesis in each subsystem
    parameter: np.ndarray  # (3, N_PARAMETER_ROWS), index in `PARAMETERS` of each row
    slope: np.ndarray  # (N_PARAMETER_ROWS, n_filters)
    offset: np.ndarray  # (N_PARAMETER_ROWS, n_filters)
    spread: np.ndarray  # (n_filters,), see `Other`
    water: np.ndarray  # (n_filters,), variance by `Other.water` [m^2/s^2]


def hypothesis_table(
    highest: Sequence[float],
    hazard: float,
    repair: float,
    faults: Sequence[str],
) -> HypothesisTable:
    """The table of the normal vehicle, the faults in their grades, and all of `OTHERS`.

    Of a fault there are the grades of which `highest`, the highest severity, is more than half of
    its least one, because a blade may break. hazard is the probability per sample that a normal
    vehicle gets any of the faults, repair that a fault ends. A hypothesis without severity has the
    grade after the last.
    """
    n_grades = len(highest)
    fault, grade = _faults_and_grades(highest, faults)
    others = list(OTHERS.values())
    diagnoses = [CATALOGUE[faults[k]].diagnosis for k in fault]
    diagnoses += [other.diagnosis for other in others]
    begin = hazard * shares(faults, fault)
    begin = np.concatenate([begin, [other.rate * SAMPLE_TIME / 3600 for other in others]])
    end = [repair] * fault.size
    for other in others:
        end.append(repair if other.duration == math.inf else SAMPLE_TIME / other.duration)
    parts = [_filters(subsystem, faults, fault) for subsystem in OWN_PARAMETERS]
    of_filters = joined(parts, 1 + len(diagnoses))
    without_change = np.zeros(1 + fault.size)
    spread = np.concatenate([without_change, [other.spread for other in others]])
    water = np.concatenate([without_change, [other.water**2 for other in others]])
    names = classes()
    return HypothesisTable(
        log_hazard=np.log(np.concatenate([[1.0 - begin.sum()], begin])),
        log_end=np.log([1.0, *end]),
        log_stay=np.log1p(-np.array([0.0, *end])),
        log_odds=np.log(np.concatenate([[1.0], begin / FORGETTING])),
        forgetting=FORGETTING,
        class_index=np.array([0, *map(names.index, diagnoses)]),
        grade=np.array([n_grades, *grade, *[n_grades] * len(others)], INDEX),
        **of_filters,
        spread=spread[of_filters["hypothesis"]],
        water=water[of_filters["hypothesis"]],
    )


def _faults_and_grades(
    highest: Sequence[float], faults: Sequence[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Fault and grade of the hypotheses that are faults, as indices, (n_hypotheses,) each."""
    pairs = []
    for k, name in enumerate(faults):
        least = CATALOGUE[name].least_severity
        pairs += [(k, g) for g, severity in enumerate(highest) if severity > 0.5 * least]
    fault, grade = np.array(pairs, np.int64).reshape(-1, 2).T
    return fault, grade


def _filters(subsystem: int, faults: Sequence[str], fault: np.ndarray) -> Filters:
    """The filters of the hypotheses whose fault, or other change, touches the subsystem."""
    of_faults = filters_of_faults(subsystem, faults, fault)
    is_changed = [subsystem in other.subsystems for other in OTHERS.values()]
    of_others = 1 + fault.size + np.flatnonzero(is_changed)
    without_effect = np.zeros((of_others.size, N_PARAMETER_ROWS))
    return Filters(
        hypothesis=np.concatenate([of_faults.hypothesis, of_others]),
        slope=np.concatenate([of_faults.slope, without_effect]),
        offset=np.concatenate([of_faults.offset, without_effect]),
    )
