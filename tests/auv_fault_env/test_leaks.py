"""Nothing that an agent sees at the start tells the fault to come; the same classifier finds faults
where they show.
"""

import numpy as np
import pytest
from scipy import stats

from auv_fault_env import CATALOGUE
from auv_fault_env.env import PropulsionVectorEnv

LANES = 16_000
LATE = 320  # steps: every sampled fault has begun


def accuracy(features, labels):
    """Held-out accuracy of least squares on the standardised features and their products, one
    output per class.
    """
    scale = features.std(axis=0)
    training = len(labels) // 2
    scaled = (features - features.mean(axis=0))[:, scale > 0] / scale[scale > 0]
    one, two = np.triu_indices(scaled.shape[1])
    design = np.c_[np.ones(len(labels)), scaled, scaled[:, one] * scaled[:, two]]
    names, numbers = np.unique(labels, return_inverse=True)
    targets = np.eye(names.size)[numbers]
    weights, *_ = np.linalg.lstsq(design[:training], targets[:training], rcond=1e-9)
    guesses = (design[training:] @ weights).argmax(axis=1)
    return np.mean(guesses == numbers[training:])


def band(labels):
    """The 99.9 % band of guessing the most frequent label, on the held-out lanes."""
    _, counts = np.unique(labels, return_counts=True)
    n = len(labels) - len(labels) // 2
    return np.array(stats.binom.interval(0.999, n, counts.max() / labels.size)) / n


@pytest.fixture(scope="module")
def episodes():
    """Observations at the reset and after every onset, and the class of each lane's first fault."""
    env = PropulsionVectorEnv(LANES, parallel=False, truth="full")
    first, info = env.reset(seed=10_000)
    assert set(info["truth"]["label"]) == {"normal"}
    names = np.array(["normal", *(fault.diagnosis for fault in CATALOGUE.values())])
    labels = names[env.fleet.plan.fault[:, 0] + 1]
    assert ((labels == "normal") == np.isinf(info["truth"]["onset"])).all()
    late = first
    for _ in range(LATE):
        late, *_ = env.step(np.c_[late[:, 0], np.zeros((LANES, 2))])
    return first, late, labels


@pytest.fixture(scope="module", params=["which_class", "faulty_or_healthy"])
def task(request, episodes):
    """Observations at the reset, late ones and labels; the second task on as many faulty lanes as
    healthy ones.
    """
    first, late, labels = episodes
    if request.param == "which_class":
        return episodes
    faulty = labels != "normal"
    lanes = np.sort(
        np.r_[np.flatnonzero(~faulty), np.flatnonzero(faulty)[: np.count_nonzero(~faulty)]]
    )
    lanes = np.random.default_rng(0).permutation(lanes)
    return first[lanes], late[lanes], faulty[lanes]


def test_reset_observation_does_not_tell_the_fault(task):
    first, _, labels = task
    low, high = band(labels)
    assert low <= accuracy(first, labels) <= high


def test_the_same_classifier_finds_faults_after_their_onset(task):
    _, late, labels = task
    assert accuracy(late, labels) > band(labels)[1]


def test_the_same_classifier_finds_a_leak(task):
    first, _, labels = task
    _, numbers = np.unique(labels, return_inverse=True)
    leaky = first.astype(float)
    # one standard deviation on the port rpm of other than the first
    leaky[:, 8] += leaky[:, 8].std() * (numbers > 0)
    assert accuracy(leaky, labels) > band(labels)[1]


def test_reset_observation_is_that_of_the_healthy_twin():
    sampled = PropulsionVectorEnv(2000, parallel=False, truth="full")
    healthy = PropulsionVectorEnv(2000, parallel=False, truth="full")
    one, _ = sampled.reset(seed=3)
    two, _ = healthy.reset(seed=3, options={"schedule": []})
    assert one.tobytes() == two.tobytes()
