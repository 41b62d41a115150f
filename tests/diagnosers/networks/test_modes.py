import numpy as np

from diagnosers.networks.modes import LEAST, class_log_probability, class_shares, log_softmax

LABELS = {"normal": "normal", "a": "one", "b": "one", "c": "two", "d": None}
MODES = ("normal", "one", "two")


def test_shares_by_hand():
    # one fault of four is unknown: a quarter of any fault's probability is its
    table = class_shares(LABELS, MODES)
    np.testing.assert_allclose(table[0], [1, 0, 0, 0, 0])
    np.testing.assert_allclose(table[1], [0, 0.375, 0.375, 0, 0.25])
    np.testing.assert_allclose(table[2], [0, 0, 0, 0.75, 0.25])


def test_classes_are_equally_likely_if_modes_are_as_likely_as_their_classes():
    modes = np.log([[0.2, 0.8 * 2 / 3, 0.8 / 3]])
    np.testing.assert_allclose(
        np.exp(class_log_probability(modes, class_shares(LABELS, MODES))),
        [[0.2, 0.2, 0.2, 0.2, 0.2]],
    )


def test_small_probabilities_stay_apart():
    scores = np.array([[-100.0, 0.0, 0.0], [-300.0, 0.0, 0.0]])
    log_probability = class_log_probability(log_softmax(scores), class_shares(LABELS, MODES))
    np.testing.assert_allclose(log_probability[:, 0], [-100.0 - np.log(2), -300.0 - np.log(2)])


def test_impossible_modes_stay_finite():
    log_probability = class_log_probability(
        log_softmax(np.array([[-1e6, 0.0, 0.0]])), class_shares(LABELS, MODES)
    )
    assert np.isclose(log_probability[0, 0], LEAST)
