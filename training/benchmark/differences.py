"""How one diagnoser differs from another on the same lanes."""

from typing import NamedTuple

import numpy as np

from auv_fault_env.faults import classes
from training.benchmark.assessment import Assessment
from training.metrics import Times, confusion, macro_f1, restricted_mean
from training.metrics.intervals import paired_bootstrap, paired_f1


class Difference(NamedTuple):
    """One diagnoser minus another: value and 95 % paired bootstrap interval (value, low, high)."""

    isolation: tuple[float, float, float]
    macro_f1: tuple[float, float, float]

    @property
    def is_better(self) -> bool:
        """Isolates sooner and has the higher macro-F1, both intervals apart from zero."""
        _, _, highest_isolation = self.isolation
        _, lowest_f1, _ = self.macro_f1
        return highest_isolation < 0.0 < lowest_f1


class LaneResults(NamedTuple):
    """What a paired comparison needs of a diagnoser."""

    isolation: Times  # of faulty lanes
    label: np.ndarray  # (n_decided,) true class, also of some healthy lanes
    decision: np.ndarray  # (n_decided,) at an instant


def difference(
    first: Assessment | LaneResults, second: Assessment | LaneResults, seed: int
) -> Difference:
    """How the first differs from the second on the same lanes; `seed` is that of the bootstrap."""
    n_classes = len(classes())
    label = first.label
    first_f1 = macro_f1(confusion(label, first.decision, n_classes))
    second_f1 = macro_f1(confusion(label, second.decision, n_classes))
    mean_difference = restricted_mean(first.isolation) - restricted_mean(second.isolation)
    time_interval = paired_bootstrap(first.isolation.time, second.isolation.time, seed)
    f1_interval = paired_f1(label, first.decision, second.decision, n_classes, seed)
    return Difference(
        isolation=(mean_difference, *time_interval),
        macro_f1=(float(first_f1) - float(second_f1), *f1_interval),
    )
