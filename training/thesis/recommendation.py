"""The diagnosers that follow the thesis' recommendation, compared on validation episodes."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from auv_fault_env.faults import classes, labels
from diagnosers import make
from training import metrics
from training.benchmark.assessment import Assessment
from training.benchmark.failures import note_failure, one_line
from training.benchmark.open_loop import (
    OpenLoopSample,
    assessed,
    both_halves,
    lanes_of,
    true_of,
)
from training.benchmark.scores import calibration_error, macro_f1, time_figures
from training.benchmark.validation_suite import FIRST_SEED
from training.metrics.intervals import Interval, paired_bootstrap
from training.metrics.records import Truth
from training.seeds import seeds
from training.thesis.comparison import AGREES, DIFFERS, IN_PART

PARALLEL = "parallel"
ALONE = ("raw_network", "kalman_network")  # its parts
CAPABLE = 0.5  # least share of the faults of its modes that a capable diagnoser isolates


class RecommendationResults(NamedTuple):
    """What the diagnosers did and their scores by name, and why others could not take part."""

    assessments: dict[str, Assessment]
    scores: dict[str, dict[str, Any]]
    failures: dict[str, str]


def compare(names: Iterable[str], n_faulty: int, hours: float, seed: int) -> RecommendationResults:
    """Run these diagnosers on the same episodes: faulty lanes, and twice `hours` of healthy ones.

    One half of the healthy operation sets the thresholds, the other counts alarms. `seed` is the
    offset within the seeds of validation, and the seed of the bootstrap.
    """
    n_healthy = lanes_of(hours)
    counts = {"faulty": n_faulty, "threshold": n_healthy, "counting": n_healthy}
    episodes = {}
    for part, count in counts.items():
        lane_seeds = seeds("validation", count, FIRST_SEED[part] + seed)
        episodes[part] = both_halves(lane_seeds, part == "faulty")
    sample = OpenLoopSample(**episodes)
    results = RecommendationResults({}, {}, {})
    for name in tqdm(names, desc="recommendation", unit="diagnoser"):
        try:
            assessment = assessed(make(name), sample)
        # whatever fails in one diagnoser, the others are compared
        except Exception as error:
            note_failure(results.failures, name, one_line(error))
            continue
        results.assessments[name] = assessment
        results.scores[name] = _score(assessment, true_of(sample.faulty), seed)
    return results


def _score(assessment: Assessment, truth: Truth, seed: int) -> dict[str, Any]:
    severity_error = metrics.severity_error(assessment.severity, truth.severity[0])
    return {
        "isolation": time_figures(assessment.isolation, seed),
        "false_alarms_per_hour": assessment.false_alarms / assessment.hours,
        "macro_f1": macro_f1(assessment),
        "severity_mae": float(severity_error.mean()),
        "ece": calibration_error(assessment),
    }


class Capability(NamedTuple):
    """How many faults of the tables' modes `parallel` isolates, and what it gains on its parts."""

    share: float
    better: str  # the part that isolates more of them
    gain: float  # in the share, on that part
    interval: Interval  # of the gain on the part on which it is the least sure

    @property
    def verdict(self) -> str:
        """Whether the networks in parallel are capable, as the thesis expects."""
        is_more = self.interval[0] > 0.0
        is_enough = self.share >= CAPABLE
        if is_more and is_enough:
            return AGREES
        return IN_PART if is_more or is_enough else DIFFERS

    @property
    def why(self) -> str:
        """The reason of the verdict."""
        low, high = self.interval
        more = "surely more" if low > 0.0 else "not surely more"
        enough = "at least" if self.share >= CAPABLE else "less than"
        return (
            f"It isolates {more} than the better part, {self.better}, alone (95 % paired interval "
            f"of the gain {100 * low:+.0f} to {100 * high:+.0f} points), and {enough} half of "
            "the faults that have a mode in Table 5.1 or 5.2."
        )


def capability(assessments: Mapping[str, Assessment], seed: int) -> Capability | None:
    """What `parallel` isolates of the faults of its modes; None without it or one of its parts.

    `seed` is that of the bootstrap.
    """
    if not {PARALLEL, *ALONE} <= assessments.keys():
        return None
    isolated = {name: _isolated_of_modes(assessments[name]) for name in (PARALLEL, *ALONE)}
    better = max(ALONE, key=lambda name: isolated[name].mean())
    intervals = [paired_bootstrap(isolated[PARALLEL], isolated[name], seed) for name in ALONE]
    share = float(isolated[PARALLEL].mean())
    return Capability(share, better, share - float(isolated[better].mean()), min(intervals))


def _isolated_of_modes(assessment: Assessment) -> np.ndarray:
    """Whether each fault that has a mode in a table was isolated, (n,)."""
    of_tables = labels()
    has_mode = np.array([any(of_tables[name]) for name in classes()])
    isolated = ~assessment.isolation.censored
    fault = assessment.label[: isolated.size]  # those of the faulty lanes come first
    return isolated[has_mode[fault]].astype(np.float64)
