import numpy as np
import pytest

from diagnosers.consistency import consistency_band
from training.thesis.filter_consistency import FILTERS, N_TRUE, SETTLED, run, summary


@pytest.mark.parametrize("name", FILTERS)
def test_errors_and_innovations_stay_in_their_bands_over_200_seeds(name):
    result = summary(name, seeds=200, seed=0)
    for key in ("NEES", "NIS"):
        assert result[key]["low"] < result[key]["mean"] < result[key]["high"]
        assert result[key]["inside"] > 0.8


@pytest.mark.parametrize("name", FILTERS)
def test_time_mean_over_many_seeds_is_the_number_of_states(name):
    errors, innovations = run(name, seeds=600, seed=10_000, steps=300)
    assert errors[SETTLED:].mean() == pytest.approx(N_TRUE[name], rel=0.05)
    assert innovations[SETTLED:].mean() == pytest.approx(1.0, rel=0.02)


def test_a_filter_that_knows_too_little_noise_leaves_the_band(monkeypatch):
    from training.thesis import filter_consistency

    kind, disturbance = FILTERS["surge filter"]
    monkeypatch.setitem(
        filter_consistency.FILTERS,
        "surge filter",
        (lambda **given: kind(sensor_noise=0.8, **given), disturbance),
    )
    _, innovations = run("surge filter", seeds=100, steps=200)
    assert not np.prod(np.subtract(consistency_band(1, 100), innovations[SETTLED:].mean())) < 0
