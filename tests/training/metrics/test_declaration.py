import numpy as np

from training.metrics import declaration
from training.metrics.declaration import Declared, declare, judge, time_to_right

SURE = np.log(0.95)
DOUBT = np.log(0.5)


def lanes(*columns):
    return np.array(columns).T


def test_a_class_is_declared_once_it_has_been_sure_for_a_second():
    sure = [SURE] * 10
    rows = {  # fault, log p, class and time [s]
        "just long enough": ([3] * 12, [DOUBT, *sure, DOUBT], 3, 1.0),
        "a sample short": ([3] * 12, [*sure[:9], DOUBT, DOUBT, DOUBT], 0, np.inf),
        "interrupted": ([3] * 12, [*sure[:5], DOUBT, *sure[:6]], 0, np.inf),
        "another class": ([3] * 6 + [4] * 6, [SURE] * 12, 0, np.inf),
        "the first counts": ([3] * 12, [SURE] * 12, 3, 0.9),
    }
    fault = lanes(*(row[0] for row in rows.values()))
    found = declare(fault, lanes(*(row[1] for row in rows.values())))
    np.testing.assert_array_equal(found.named, [row[2] for row in rows.values()])
    np.testing.assert_allclose(found.time, [row[3] for row in rows.values()])


def test_a_declaration_is_the_same_as_that_of_the_stimuli():
    from training.stimuli.declaration import Declaration

    random = np.random.default_rng(0)
    log_probability = np.log(1e-9 + random.dirichlet(np.full(4, 0.02), size=(200, 30)))
    log_probability = np.repeat(log_probability[::8], 8, axis=0)
    live = Declaration(30, declaration.DECLARATION_PROBABILITY)
    for belief in log_probability:
        live.update(belief)
    faults = log_probability[:, :, 1:]
    found = declare(1 + faults.argmax(axis=2), faults.max(axis=2))
    np.testing.assert_array_equal(found.named, live.declared)
    assert len(set(found.named.tolist())) > 2


def test_who_says_unknown_is_neither_right_nor_wrong_unless_it_is_true():
    unknown = 3
    is_right_class = np.eye(4, dtype=bool)[[1, 1, 1, 1, 1, 3, 1]]
    declared = Declared(
        named=np.array([1, 2, unknown, 0, 1, unknown, 1]),
        time=np.array([5.0, 5.0, 5.0, np.inf, 1.0, 5.0, 50.0]),
    )
    onset = np.full(7, 2.0)
    judged = judge(declared, is_right_class, onset, 30.0, unknown)
    np.testing.assert_array_equal(judged.right, [1, 0, 0, 0, 0, 1, 0])
    # a right class before its fault is wrong
    np.testing.assert_array_equal(judged.wrong, [0, 1, 0, 0, 1, 0, 0])
    np.testing.assert_array_equal(judged.abstained, [0, 0, 1, 0, 0, 0, 0])
    # later than the horizon is never
    np.testing.assert_array_equal(judged.never, [0, 0, 0, 1, 0, 0, 1])
    assert np.all(np.sum(judged, axis=0) == 1)
    times = time_to_right(declared, judged, onset, 30.0)
    assert times.time.tolist() == [3.0, 30.0, 30.0, 30.0, 30.0, 3.0, 30.0]
    assert times.censored.tolist() == [False, True, True, True, True, False, True]
