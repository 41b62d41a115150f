"""The anchors say nothing, and say it as they should."""

import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS
from auv_fault_env.errors import InputError
from diagnosers.references import Null, Random

OBSERVATIONS = np.random.default_rng(0).normal(size=(200, 20, len(CHANNELS)))


def beliefs(diagnoser, observations):
    diagnoser.reset(observations.shape[1])
    return np.array([diagnoser.update(observation).log_probability for observation in observations])


def test_null_keeps_its_prior():
    probability = np.exp(beliefs(Null(), OBSERVATIONS[:3]))
    np.testing.assert_allclose(probability[..., 0], 0.2)  # the healthy share of ScheduleSampler
    np.testing.assert_allclose(probability[..., 1:-1], 0.8 / (probability.shape[-1] - 2))


def test_random_is_a_function_of_observation_and_seed():
    one = beliefs(Random(), OBSERVATIONS)
    assert (one == beliefs(Random(), OBSERVATIONS)).all()
    assert (one[:, [3]] == beliefs(Random(), OBSERVATIONS[:, [3]])).all()
    assert (one != beliefs(Random(seed=1), OBSERVATIONS))[..., :-1].all()
    nudged = np.nextafter(OBSERVATIONS, np.inf)
    assert (one[..., 0] != beliefs(Random(), nudged)[..., 0]).all()


def test_random_spreads_widely_and_favours_no_class():
    log_probability = beliefs(Random(), OBSERVATIONS)
    normal = np.sort(log_probability[..., 0].ravel())
    np.testing.assert_allclose(np.quantile(normal, [0.1, 0.5, 0.9]), [-27.0, -15.0, -3.0], atol=1.0)
    wins = np.bincount(
        log_probability[..., 1:-1].argmax(axis=-1).ravel(), minlength=log_probability.shape[-1] - 2
    )
    expected = wins.sum() / len(wins)
    assert ((wins - expected) ** 2 / expected).sum() < 2.5 * len(wins)


@pytest.mark.parametrize("seed", [-1, 1.5, "0"])
def test_a_wrong_seed_is_refused(seed):
    with pytest.raises(InputError, match="seed: got"):
        Random(seed=seed)
