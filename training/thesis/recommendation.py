"""The diagnosers that follow the thesis' recommendation, compared on validation episodes."""

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

from tqdm import tqdm

from auv_fault_env.parameters import SAMPLE_TIME
from diagnosers import make
from training import metrics
from training.benchmark.assessment import Assessment, assess
from training.benchmark.failures import note_failure, one_line
from training.benchmark.open_loop import N_SAMPLES, believed, both_halves, true_of
from training.benchmark.scores import (
    MEAN_TIMES,
    RANKED_AT,
    calibration_error,
    macro_f1,
    time_figures,
)
from training.benchmark.validation_suite import FIRST_SEED
from training.metrics.records import PERSISTENCE, Truth, healthy_outcome
from training.seeds import seeds


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
    n_healthy = math.ceil(hours * 3600.0 / (N_SAMPLES * SAMPLE_TIME))
    counts = {"faulty": n_faulty, "threshold": n_healthy, "counting": n_healthy}
    episodes = {}
    for part, count in counts.items():
        lane_seeds = seeds("validation", count, FIRST_SEED[part] + seed)
        episodes[part] = both_halves(lane_seeds, part == "faulty")
    truth = {part: true_of(halves) for part, halves in episodes.items()}
    results = RecommendationResults({}, {}, {})
    for name in tqdm(names, desc="recommendation", unit="diagnoser"):
        try:
            diagnoser = make(name)
            records = {part: believed(diagnoser, halves) for part, halves in episodes.items()}
        # whatever fails in one diagnoser, the others are compared
        except Exception as error:
            note_failure(results.failures, name, one_line(error))
            continue
        setting = records["threshold"].log_normal
        threshold = metrics.threshold_for(setting, MEAN_TIMES[RANKED_AT], PERSISTENCE)
        healthy = healthy_outcome(records["counting"], truth["counting"].onset)
        assessment = assess(threshold, records["faulty"], truth["faulty"], healthy)
        results.assessments[name] = assessment
        results.scores[name] = _score(assessment, truth["faulty"], seed)
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
