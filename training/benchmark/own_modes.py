"""A diagnoser on the operating modes of a table of the thesis, which are all that it must know.

Its belief over classes is merged into the modes of the table, whose probabilities are the sums of
those of their classes. Neither table has sides, so port and starboard are one mode. Classes without
a mode there have no episodes, and the modes of faults share their probability in proportion to
their own: so p(normal), and with it the alarm, is that of the diagnoser.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from auv_fault_env.faults import classes, labels
from diagnosers import Belief, Diagnoser
from diagnosers.diagnoser import IMPOSSIBLE
from diagnosers.networks.fault_map import MODES_5_1, MODES_5_2
from training.benchmark.open_loop import (
    Halves,
    OpenLoopEpisodes,
    OpenLoopSample,
    assessed,
    both_halves,
    lanes_of,
    true_of,
)
from training.benchmark.scores import time_figures
from training.benchmark.suites import ONE_FAULT
from training.metrics import class_order, confusion, macro_f1, severity_error
from training.metrics.intervals import f1_interval
from training.seeds import seeds


class Table(NamedTuple):
    """Classes of the diagnosers by the modes of a table; a mode stands at its first class."""

    modes: tuple[str, ...]
    classes: tuple[np.ndarray, ...]  # by mode: the indices of its classes

    @property
    def first(self) -> np.ndarray:
        """The first class of every mode, (n_modes,)."""
        return np.array([members[0] for members in self.classes])

    @property
    def first_of_class(self) -> np.ndarray:
        """The first class of the mode of every class, -1 without a mode, (n_classes,)."""
        first = np.full(len(classes()), -1)
        for members in self.classes:
            first[members] = members[0]
        return first


def _table(column: int, modes: tuple[str, ...]) -> Table:
    of_class = np.array([row[column] for row in labels().values()], dtype=object)
    return Table(modes, tuple(np.flatnonzero(of_class == mode) for mode in modes))


def tables() -> dict[str, Table]:
    """The tables of the thesis by number."""
    return {"5.1": _table(0, MODES_5_1), "5.2": _table(1, MODES_5_2)}


class OnModes:
    """A diagnoser whose belief is merged into the modes of a table, each at its first class.

    The severity of a mode is that of its classes, weighed with their probabilities.
    """

    def __init__(self, diagnoser: Diagnoser, table: Table):
        self.classes = classes()
        self.diagnoser = diagnoser
        self.table = table
        self.order = class_order(diagnoser.classes, self.classes)

    def reset(self, n_lanes: int) -> None:
        """Start an episode of n_lanes vehicles."""
        self.diagnoser.reset(n_lanes)

    def update(self, observation: np.ndarray) -> Belief:
        """The merged belief after the next observation (n_lanes, n_channels)."""
        belief = Belief(*(values[:, self.order] for values in self.diagnoser.update(observation)))
        return merged(belief, self.table)


def merged(belief: Belief, table: Table) -> Belief:
    """The belief over classes, (n_lanes, n_classes), merged as the module says."""
    result = Belief(*map(np.zeros_like, belief))
    result.log_probability[:] = IMPOSSIBLE
    for members in table.classes:
        parts = [values[:, members] for values in belief]
        for values, mixed in zip(result, _mixture(*parts), strict=True):
            values[:, members[0]] = mixed
    log_faults = np.logaddexp.reduce(belief.log_probability[:, 1:], axis=1)
    of_modes = result.log_probability[:, 1:]
    of_modes += (log_faults - np.logaddexp.reduce(of_modes, axis=1))[:, None]
    return result


def _mixture(log_probability: np.ndarray, mean: np.ndarray, std: np.ndarray) -> Belief:
    """Log probability, mean and standard deviation (n_lanes,) of classes (n_lanes, n) as one."""
    total = np.logaddexp.reduce(log_probability, axis=1)
    share = np.exp(log_probability - total[:, None])
    mean_of_all = (share * mean).sum(axis=1)
    square = (share * (std**2 + mean**2)).sum(axis=1)
    return Belief(total, mean_of_all, np.sqrt(np.maximum(square - mean_of_all**2, 0.0)))


class Episodes(NamedTuple):
    """Which episodes are taken: purpose and first of their seeds, how many, and the realism."""

    purpose: str
    first: int
    n_faulty: int
    hours: float  # of healthy operation, for the threshold and for counting each
    realism: float


def sample_for(table: Table, episodes: Episodes) -> OpenLoopSample:
    """Faulty lanes whose classes have a mode in the table, equally likely, and healthy ones."""
    with_mode = np.flatnonzero(table.first_of_class > 0)
    prior = {classes()[k]: 1.0 for k in with_mode}
    faults = replace(ONE_FAULT, prior=prior)
    n_healthy = lanes_of(episodes.hours)
    first = episodes.first
    halves: list[Halves] = []
    for count in (episodes.n_faulty, n_healthy, n_healthy):
        chosen = seeds(episodes.purpose, count, first)
        is_faulty = not halves
        halves.append(both_halves(chosen, is_faulty, faults=faults, realism=episodes.realism))
        first += count
    faulty = tuple(_with_modes(half, table) for half in halves[0])
    return OpenLoopSample(faulty, *halves[1:])


def _with_modes(episodes: OpenLoopEpisodes, table: Table) -> OpenLoopEpisodes:
    truth = episodes.truth
    fault = table.first_of_class[truth.fault]
    label = table.first_of_class[truth.label]
    return episodes._replace(truth=truth._replace(fault=fault, label=label))


def scores_on(
    diagnoser: Diagnoser, table: Table, sample: OpenLoopSample, seed: int
) -> dict[str, Any]:
    """Scores on the modes of a table, plain data; `seed` is that of the bootstrap.

    `confusion` counts true modes (rows) against named ones, ten seconds after the onset. By true
    mode of a fault, `named` counts the lanes whose most probable fault then is the true one, in
    alarm or not, and `in_alarm` those in alarm.
    """
    assessment = assessed(OnModes(diagnoser, table), sample)
    n_classes = len(classes())
    modes = np.ix_(table.first, table.first)
    matrix = confusion(assessment.label, assessment.decision, n_classes)
    truth = true_of(sample.faulty)
    error = severity_error(assessment.severity, truth.severity[0])
    in_alarm = assessment.decision[: len(truth.fault)] > 0
    is_named = assessment.named == truth.fault
    return {
        "detection": time_figures(assessment.detection, seed),
        "isolation": time_figures(assessment.isolation, seed),
        "macro_f1": float(macro_f1(matrix)),
        "macro_f1_interval": f1_interval(assessment.label, assessment.decision, n_classes, seed),
        "confusion": matrix[modes].astype(int).tolist(),
        "named": _by_mode(truth.fault[is_named], table),
        "in_alarm": _by_mode(truth.fault[in_alarm], table),
        "severity_mae": float(error.mean()),
        "false_alarms": assessment.false_alarms,
        "hours": assessment.hours,
    }


def _by_mode(fault: np.ndarray, table: Table) -> list[int]:
    """How many of these lanes, (n,), have each mode of a fault."""
    return np.bincount(fault, minlength=len(classes()))[table.first[1:]].tolist()
