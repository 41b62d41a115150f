import numpy as np
import pytest
from tqdm import tqdm

from diagnosers.networks.fault_map import MODES_5_2
from training.thesis import kalman_networks as study
from training.thesis import kalman_page as page
from training.thesis.backpropagation import Networks, evaluate, rms_error
from training.thesis.comparison import Comparison
from training.thesis.runs import TEST_RUNS, record

VERDICT = 5
NO_BAR = tqdm(disable=True)


@pytest.fixture(scope="module")
def comparison():
    return Comparison(
        record(0.0, [0], NO_BAR), record(1.0, [0, 1], NO_BAR), list(TEST_RUNS), "a command"
    )


@pytest.fixture(scope="module")
def trained():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study, "CHECKPOINTS", (100_000, 400_000))
        return study.run_study(range(2), NO_BAR)


def response_of(*named, n_samples=601):
    """A response in which mode k is named from its sample on; three networks, all alike."""
    outputs = np.zeros((3, n_samples, 5))
    for first, mode in named:
        outputs[:, first:] = np.eye(5)[mode]
    return study.Response(np.full((3, n_samples, 2), 0.5), outputs)


def test_times_and_shares_by_hand():
    response = response_of((0, 0), (150, 1), (160, 0), (173, 1))
    assert study.time_to_identification(response, "increased drag") == pytest.approx([7.3] * 3)
    assert study.time_to_identification(response_of((0, 1)), "increased drag") == pytest.approx(
        [-10.0] * 3
    )
    assert study.time_to_identification(response_of((0, 0)), "increased drag") == pytest.approx(
        [50.1] * 3
    )
    assert study.share_normal_before_onset(response) == pytest.approx([1.0] * 3)
    assert study.share_normal_before_onset(response_of((0, 1), (10, 0))) == pytest.approx(
        [91 / 101] * 3
    )


def test_exact_outputs_have_no_error():
    exact = study.TARGETS[None]
    assert study.severity_error(exact) == pytest.approx([0.0])
    assert study.accuracy_by_mode(exact) == pytest.approx(np.ones((1, 5)))


def test_the_weights_of_the_least_error_are_used():
    random = np.random.default_rng(0)
    several = Networks(
        random.normal(size=(4, 2, 3, 3)), random.normal(size=(4, 2, 5, 4)), np.array([3, 3])
    )
    errors = rms_error(evaluate(several, study.POINTS), study.TARGETS)
    least = rms_error(evaluate(study.least_error(several), study.POINTS), study.TARGETS)
    assert least == pytest.approx(errors.min(axis=0))


@pytest.mark.parametrize(("at", "verdict"), [(150, "agrees"), (205, "differs")])
def test_identified_in_time_or_not(comparison, at, verdict):
    response = response_of((0, 0), (at, 1))
    assert page.identified_row(comparison, (response, response))[VERDICT] == verdict


@pytest.mark.parametrize(("mode", "verdict"), [(4, "agrees"), (0, "differs")])
def test_a_lost_propeller_has_a_high_fault_value_or_not(comparison, mode, verdict):
    response = response_of((0, 0), (120, mode))
    assert page.loss_rows(comparison, (response, response))[0][VERDICT] == verdict


def test_eight_nodes_grade_better_than_four(trained):
    few, enough = (study.severity_error(trained.outputs[size]).mean() for size in study.SIZES)
    assert enough < few
    assert study.accuracy_by_mode(trained.outputs[8]).mean() > 0.9


def test_networks_follow_the_test_runs(comparison, trained):
    clean, noisy = study.responses(comparison, "loss", trained.networks[8])
    assert clean.outputs.shape == (2, 601, len(MODES_5_2))
    assert np.array_equal(clean.points[0], clean.points[1])
    assert not np.array_equal(noisy.points[0], noisy.points[1])
    assert clean.points[0, -1] == pytest.approx([0.5, 0.45], abs=0.01)
    assert np.all(
        clean.outputs[:, -1].argmax(axis=-1) == MODES_5_2.index("severe propulsion failure")
    )


def test_the_page_names_every_figure(comparison, trained):
    sections = page.sections(comparison, trained)
    where = " ".join(row[0] for part in sections for row in part["table"]["rows"])
    for figure in ("5.1", "5.12", "5.14", "5.15", "5.16", "5.17", "5.20"):
        assert f"Fig. {figure}" in where
    assert [row[0] for row in sections[1]["table"]["rows"]] == list(MODES_5_2)
    windows = sections[0]["table"]["rows"][:2]
    assert [row[VERDICT] for row in windows] == ["agrees", "agrees"]
