import numpy as np

from auv_fault_env.parameters import SAMPLE_TIME
from diagnosers import make
from training.benchmark.open_loop import believed, both_halves, true_of
from training.metrics.records import SEVERITY_AT
from training.seeds import seeds

SEEDS = seeds("validation", 40, 100_000_000)


def test_half_of_the_lanes_run_the_thesis_stimulus():
    halves = both_halves(SEEDS, faulty=True)
    truth = true_of(halves)
    assert [len(half.truth.fault) for half in halves] == [20, 20]
    assert (truth.fault > 0).all() and np.unique(truth.fault).size > 8
    assert (truth.onset >= 5.0).all() and (truth.onset <= 30.0).all()
    missions = [half.observations[:, :, 0].round(3) for half in halves]
    assert [np.unique(mission, axis=1).shape[1] for mission in missions] == [1, 20]
    for half in halves:
        judged_at = half.truth.onset + SEVERITY_AT
        np.testing.assert_allclose(half.instants[0] * SAMPLE_TIME, judged_at, atol=0.1)
        assert (half.truth.label[0] == half.truth.fault).all()


def test_healthy_lanes_have_stand_in_onsets():
    truth = true_of(both_halves(SEEDS[:6], faulty=False))
    assert not truth.fault.any() and not truth.label.any()
    assert np.isfinite(truth.onset).all()


def test_beliefs_of_both_halves_are_one_record():
    halves = both_halves(SEEDS[:5], faulty=True)
    record = believed(make("null"), halves)
    assert record.log_normal.shape == (650, 5)
    assert record.log_probability.shape[:2] == (5, 5)
