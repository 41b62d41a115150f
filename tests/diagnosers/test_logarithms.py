"""Functions of logarithms that vectorise, against those of numpy."""

import numpy as np

from diagnosers.bank.logarithms import exponential, log_one_plus, log_sum, share_of_second

EXPONENTS = -np.concatenate([np.linspace(0.0, 2.0, 500), np.logspace(-20.0, 2.85, 500)])


def test_the_exponential_is_that_of_numpy_and_zero_far_below():
    values = [exponential(x) for x in EXPONENTS]
    np.testing.assert_allclose(values, np.exp(EXPONENTS), rtol=1e-15)
    assert [exponential(x) for x in (-709.0, -1e30, -np.inf)] == [0.0, 0.0, 0.0]


def test_the_logarithm_of_one_plus_a_share_is_that_of_numpy():
    shares = np.concatenate([np.linspace(0.0, 1.0, 500), np.logspace(-300.0, 0.0, 500)])
    values = [log_one_plus(x) for x in shares]
    np.testing.assert_allclose(values, np.log1p(shares), rtol=1e-15)


def test_sums_and_shares_by_their_logarithms():
    for other in (-800.0, -2.0, 0.0):
        for log_a in (-np.inf, -1e30, *EXPONENTS[::50]):
            total = np.logaddexp(log_a, other)
            assert np.isclose(log_sum(log_a, other), total, rtol=1e-15, atol=1e-15)
            assert log_sum(other, log_a) == log_sum(log_a, other)
            share = share_of_second(log_a, other)
            assert np.isclose(share, np.exp(other - total), rtol=1e-12)
