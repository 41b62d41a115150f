"""Scores of perfect beliefs and of silence, and the table that they are computed from."""

import numpy as np
import pytest

from auv_fault_env.faults import classes
from training.benchmark import results, scores
from training.benchmark.assessment import healthy_beside
from training.benchmark.scores import METRICS, RATE_METRICS, ScoreInputs, TrialOutcomes
from training.benchmark.suites import load
from training.benchmark.trials import FaultyOutcome, lane_truth
from training.metrics.records import Record, healthy_outcome

STANDARD = load("standard")
WITH_UNKNOWN = load("unknown_faults")
FAULTY = STANDARD.episodes[:40]
HEALTHY = tuple(episode._replace(schedule=()) for episode in STANDARD.episodes[40:60])
DOUBT = 1e-6


def record(truth, is_perfect):
    """What a diagnoser believes that knows the truth, or that always says normal."""
    n_classes = len(classes())
    label = truth.label if is_perfect else np.zeros_like(truth.label)
    at_instants = truth.at_instants.label if is_perfect else np.zeros_like(truth.instants)
    belief = np.full((*truth.instants.shape, n_classes), np.log(DOUBT / (n_classes - 1)))
    np.put_along_axis(belief, at_instants[:, :, None], np.log1p(-DOUBT), axis=2)
    severity = np.repeat(truth.at_instants.severity[:, :, None], n_classes, axis=2)
    severity[:, :, -1] = 0.0  # no diagnoser has a severity of `unknown`
    log_normal = np.where(label == 0, np.log1p(-DOUBT), np.log(DOUBT / (n_classes - 1)))
    fault = np.where(label == 0, 1, label)
    log_fault = np.where(label == 0, np.log(DOUBT), np.log1p(-DOUBT))
    return Record(log_normal, fault, log_fault, belief, severity, np.full(severity.shape, 0.01))


def score(is_perfect, suite=STANDARD, faulty_lanes=FAULTY):
    truth = lane_truth(suite.conditions, faulty_lanes)
    healthy_truth = lane_truth(STANDARD.conditions, HEALTHY)
    onset = healthy_truth.at_instants.onset
    healthy = healthy_outcome(record(healthy_truth, is_perfect), onset)
    energy = np.ones(len(faulty_lanes))
    faulty = FaultyOutcome(*record(truth, is_perfect), energy, energy)
    outcomes = TrialOutcomes(healthy, healthy, faulty, None)
    assessments = scores.assess_at_rates(outcomes, truth)
    return scores.score(ScoreInputs(assessments, truth, outcomes, [], 0))


def test_perfect_beliefs_score_perfectly():
    perfect = score(is_perfect=True)
    # the fault shows in the sample after the one it begins in, and an alarm takes 3 samples
    assert 0.2 < perfect["isolation"]["restricted_mean"] < 0.4
    assert perfect["isolation"] == perfect["detection"]
    assert perfect["isolation"]["probability"] == 1.0
    assert perfect["macro_f1"] == perfect["severity_coverage"] == 1.0
    assert perfect["severity_mae"] == pytest.approx(0.0, abs=1e-6)
    assert perfect["ece"] == pytest.approx(0.0, abs=1e-5)
    assert perfect["log_loss"] == pytest.approx(1e-6, rel=1e-2)
    assert perfect["false_alarms"] == perfect["time_in_alarm"] == 0
    assert perfect["abstention"]["area"] == perfect["abstention"]["risk"] == 0.0
    # a class is declared a second after it shows
    assert perfect["declared"]["right"] == 1.0
    assert 0.9 < perfect["declared"]["time_to_right"] < 1.2
    by_onset = perfect["isolation_by_onset"]
    abrupt = np.mean([episode.schedule[0].ramp == 0.0 for episode in FAULTY])
    means = [by_onset[kind]["restricted_mean"] for kind in ("abrupt", "ramped")]
    assert np.dot([abrupt, 1.0 - abrupt], means) == pytest.approx(
        perfect["isolation"]["restricted_mean"]
    )
    # all faults are those of the catalogue
    assert perfect["naming"] is None


def test_severities_are_those_of_known_faults():
    mixed = WITH_UNKNOWN.episodes[::10]
    pairs = [episode for episode in mixed if len(episode.schedule) == 2]
    found = score(True, WITH_UNKNOWN, mixed)
    assert 0 < len(pairs) < len(mixed)
    assert found["severity_mae"] == pytest.approx(0.0, abs=1e-6)
    assert found["severity_coverage"] == 1.0
    assert len(found["severity_scatter"]["truth"]) == len(pairs)
    alone = [episode for episode in mixed if len(episode.schedule) == 1]
    none = score(True, WITH_UNKNOWN, alone)
    for key in ("severity_mae", "severity_mae_interval", "severity_coverage"):
        assert none[key] is None
    cells = [column.cell(none) for metric in METRICS for column in metric.columns]
    assert cells.count("–") == 2


def test_silence_is_censored():
    silent = score(is_perfect=False)
    assert silent["isolation"] == {
        "restricted_mean": 30.0,
        "interval": (30.0, 30.0),
        "probability": 0.0,
        "median": None,
    }
    assert silent["detection"]["probability"] == 0.0
    assert set(silent["isolation_by_class"].values()) == {30.0}
    assert silent["declared"]["never"] == 1.0
    assert silent["declared"]["time_to_right"] == 30.0
    assert silent["cost"]["energy"] == 1.0 and silent["cost"]["energy_ratio"] is None


@pytest.mark.parametrize("table", [METRICS, RATE_METRICS])
def test_every_metric_stands_once_and_says_what_it_is(table):
    keys = [metric.key for metric in table]
    assert len(set(keys)) == len(keys)
    assert all(metric.meaning for metric in table)
    columns = [column.heading for metric in table for column in metric.columns]
    assert len(set(columns)) == len(columns)
    assert all(metric.misleads for metric in table if metric.columns)


def test_no_key_of_the_results_is_a_metric_as_well():
    assert not results.RESULTS.keys() & {metric.key for metric in METRICS}


def test_share_of_healthy_lanes_among_the_decisions():
    lanes = healthy_beside(1000, 1108)
    # one healthy lane to four faulty ones, as the sampler of schedules draws them
    assert lanes.size == 250
    assert (lanes < 554).sum() == 125
    assert healthy_beside(1000, 12).size == 12
