import numpy as np
import pytest
from tqdm import tqdm

from training.thesis import raw_networks as study
from training.thesis import raw_page as page
from training.thesis.comparison import Comparison
from training.thesis.runs import TEST_RUNS, record

VERDICT = 5
NO_BAR = tqdm(disable=True)
N_NETWORKS = 3
N_CHECKPOINTS = len(study.CHECKPOINTS)
NORMAL, FRICTION, DRAG, PROPELLER = range(4)


@pytest.fixture(scope="module")
def comparison():
    clean = record(0.0, [0], NO_BAR)
    return Comparison(clean, clean, list(TEST_RUNS), "a command")


def outputs(*changes):
    """Perfect outputs, but for changes (first point, last point, mode that is named there)."""
    perfect = np.tile(0.9 * study.TARGETS + 0.05, (N_CHECKPOINTS, N_NETWORKS, 1, 1))
    for first, last, mode in changes:
        perfect[:, :, first:last] = 0.05
        perfect[:, :, first:last, mode] = 0.95
    return perfect


def studied(base):
    return study.RawStudy(
        dict.fromkeys(study.SIZES, base),
        base,
        {(0.5, 0.4): base},
        dict.fromkeys(study.VARIANTS, base),
    )


def verdicts(section, quantity):
    found = [row[VERDICT] for row in section["table"]["rows"] if quantity in row[1]]
    assert found, quantity
    return set(found)


def test_training_set_has_the_modes_in_the_order_of_table_5_1(comparison):
    (inputs,) = study.training_sets(comparison.clean.readings, comparison.runs)
    assert inputs.shape == (1600, 4)
    assert 0.0 <= inputs.min() and inputs.max() <= 1.0
    current = inputs[:, list(study.FULL_SCALE).index("port_current")].reshape(4, 400)[:, -1]
    assert current[FRICTION] > current[DRAG] > current[NORMAL] > current[PROPELLER]
    speed = inputs[:, list(study.FULL_SCALE).index("speed")].reshape(4, 400)[:, -1]
    assert speed[NORMAL] == pytest.approx(speed[FRICTION], rel=1e-3)
    assert speed[DRAG] < 0.97 * speed[NORMAL]


def test_the_variant_of_the_test_runs_is_the_training_set_itself(comparison):
    sets = dict(zip(study.VARIANTS, study.variant_sets(), strict=True))
    (inputs,) = study.training_sets(comparison.clean.readings, comparison.runs)
    np.testing.assert_allclose(
        sets[0.35, "port damaged: thrust −50 %, torque −40 %"], inputs, atol=1e-6
    )


def test_thrust_alone_leaves_the_motor_as_it_is_at_the_same_speeds(comparison):
    inputs = dict(zip(study.VARIANTS, study.variant_sets(), strict=True))[
        study.THRUST_ALONE
    ].reshape(4, 400, 4)
    normal = inputs[NORMAL]
    propeller = inputs[PROPELLER]
    speed = list(study.FULL_SCALE).index("speed")
    for column in range(3):
        there = np.interp(normal[20:100, speed], propeller[:, speed], propeller[:, column])
        np.testing.assert_allclose(there, normal[20:100, column], atol=0.01)


def test_measures_by_hand():
    late_drag = outputs((800, 900, PROPELLER), (950, 951, NORMAL))
    assert np.all(study.first_drag_points_named(late_drag, "degraded propeller") == 100)
    assert np.all(study.first_drag_points_named(late_drag, "normal") == 0)
    assert np.all(study.points_until_drag(late_drag) == 151)
    assert np.all(study.points_until_drag(outputs()) == 0)
    assert np.all(study.points_until_drag(outputs((1199, 1200, NORMAL))) == 400)
    np.testing.assert_allclose(study.accuracy_by_mode(late_drag)[0, 0], [1, 1, 1 - 101 / 400, 1])
    assert np.all(study.accuracy_by_mode(late_drag, late=True) == 1)
    np.testing.assert_allclose(study.friction_accuracy(outputs((400, 480, NORMAL))), 0.9)
    np.testing.assert_allclose(study.rms_errors(outputs()), 0.05)


def test_the_thesis_findings_are_found_where_they_are(comparison):
    section = page.output_section(comparison, studied(outputs((800, 900, PROPELLER))))
    assert verdicts(section, "named degraded propeller") == {"agrees"}
    assert verdicts(section, "stays the largest") == {"agrees"}
    assert verdicts(section, "distinguished after 24,000") == {"agrees"}


def test_and_not_where_they_are_not(comparison):
    section = page.output_section(comparison, studied(outputs((0, 400, FRICTION))))
    assert verdicts(section, "named degraded propeller") == {"differs"}
    assert verdicts(section, "stays the largest") == {"differs"}
    assert verdicts(section, "distinguished after 24,000") == {"differs"}
    assert verdicts(section, "second half") == {"differs"}


@pytest.mark.parametrize(("best", "verdict"), [(1, "agrees"), (3, "differs")])
def test_the_better_response_must_exceed_its_error(comparison, best, verdict):
    base = outputs((0, 100, DRAG))
    base[best] = outputs()[best]
    assert page.response_row(comparison, studied(base))[VERDICT] == verdict


@pytest.mark.parametrize(("best", "verdict"), [(3, "agrees"), (2, "differs")])
def test_where_the_error_is_least(comparison, best, verdict):
    base = outputs((0, 100, DRAG))
    base[best] = outputs()[best]
    assert page.least_error_row(comparison, studied(base))[VERDICT] == verdict


def test_fewer_nodes_that_suffice_differ_from_the_thesis(comparison):
    blind = outputs((0, 400, DRAG))
    seeing = outputs()
    sizes = {size: blind if size < 4 else seeing for size in study.SIZES}
    section = page.sizes_section(comparison, studied(seeing)._replace(by_size=sizes))
    by_size = {row[1][:5]: row[VERDICT] for row in section["table"]["rows"]}
    assert by_size == {
        f"4-{size}-4": "differs" if size in (4, 5) else "agrees" for size in study.SIZES
    }


def test_a_short_study_trains_every_group(comparison, monkeypatch):
    monkeypatch.setattr(study, "CHECKPOINTS", (50, 100))
    short = study.run_study(comparison, range(4, 6), NO_BAR)
    assert short.noisy.shape == (2, 2, 1600, 4)
    assert set(short.by_size) == set(study.SIZES)
    assert set(short.by_variant) == set(study.VARIANTS)
    assert np.array_equal(short.by_settings[0.5, 0.4], short.by_size[6])
