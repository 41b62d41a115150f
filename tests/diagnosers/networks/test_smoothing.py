"""The steadied belief: a fault stays, and one sample does not rename it."""

import numpy as np

from diagnosers.networks.smoothing import ODDS_SMOOTHING, initial_smoothing


def belief_of(fault, probability):
    """Log probabilities (1, 4) of normal and three faults; only `fault` shares with normal."""
    shares = np.full(3, 1e-6)
    shares[fault] = 1.0
    return np.log(np.concatenate([[1.0 - probability], probability * shares / shares.sum()]))[None]


def test_the_odds_of_a_fault_rise_at_once_and_fall_slowly():
    steady = initial_smoothing(1, 3).after(belief_of(0, 0.01))
    assert np.allclose(np.exp(steady.log_probability()[0, 0]), 0.99)
    steady = steady.after(belief_of(1, 0.999))
    assert np.allclose(np.exp(steady.log_probability()[0, 0]), 0.001)
    for _ in range(round(10 * ODDS_SMOOTHING)):
        steady = steady.after(belief_of(1, 0.01))
    risen = np.log(0.999 / 0.001)
    fallen = np.log(0.01 / 0.99)
    assert np.isclose((steady.odds[0] - fallen) / (risen - fallen), np.exp(-1.0), rtol=0.05)
    assert np.isclose(np.exp(steady.log_probability()).sum(), 1.0)


def test_one_odd_sample_does_not_rename_a_fault():
    steady = initial_smoothing(1, 3)
    for fault in (2, 2, 2, 2, 0, 2):
        steady = steady.after(belief_of(fault, 0.99))
        assert steady.log_probability()[0, 1:].argmax() == 2
    for _ in range(20):
        steady = steady.after(belief_of(0, 0.99))
    assert steady.log_probability()[0, 1:].argmax() == 0
