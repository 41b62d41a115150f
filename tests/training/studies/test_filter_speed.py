import numpy as np
import pytest

from diagnosers.bank.hypotheses import SURGE
from training.studies.filter_speed import SurgeBank, observations


@pytest.mark.parametrize("f", [0, 2, 30], ids=["normal", "drag", "sensor"])
def test_the_banks_surge_filter_is_filterpys(f):
    pytest.importorskip("filterpy")
    assert SURGE == 0
    bank = SurgeBank(2)
    samples = observations(2, 12)
    kalman, update = bank.filterpy_filter(1, f)
    for sample in samples:
        bank.update(sample)
        update(sample[1])
        mean, covariance = bank.moments(1, f)
        np.testing.assert_allclose(kalman.x, mean, rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(kalman.P, covariance, rtol=1e-7, atol=1e-12)
