import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS, MAXIMUM_COMMAND
from auv_fault_env.errors import InputError
from diagnosers import Belief
from training.stimuli import BUDGET, STIMULI, Thesis

OBSERVATION = np.zeros((3, len(CHANNELS)))
BELIEF = Belief(*(np.zeros((3, 19)) for _ in range(3)))


def offsets(stimulus, n_samples=650):
    return np.array([stimulus.offset(k, OBSERVATION, BELIEF) for k in range(n_samples)])


@pytest.mark.parametrize("budget", [0.0, 0.02, BUDGET])
@pytest.mark.parametrize("name", STIMULI)
def test_no_stimulus_spends_more_than_its_budget(name, budget):
    spent = np.sqrt(np.mean(offsets(STIMULI[name](budget)) ** 2, axis=0))
    assert spent.shape == (3,)
    assert (spent <= budget * (1 + 1e-12)).all()


@pytest.mark.parametrize("name", STIMULI)
def test_a_stimulus_is_known_by_its_name_and_budget(name):
    stimulus = STIMULI[name](0.03)
    assert stimulus.name == name
    assert "0.03" in repr(stimulus) and type(stimulus).__name__ in repr(stimulus)
    assert stimulus == STIMULI[name](0.03) != STIMULI[name](0.04)


@pytest.mark.parametrize("budget", [-0.01, MAXIMUM_COMMAND + 0.1, float("nan")])
def test_a_budget_that_is_none_is_refused(budget):
    with pytest.raises(InputError, match="budget of thesis"):
        Thesis(budget)


def test_the_thesis_goes_slow_first_then_fast_for_ten_seconds_each():
    found = offsets(Thesis())[:, 0]
    assert BUDGET == pytest.approx(0.0762)  # 0.25 ft/s
    np.testing.assert_array_equal(found[:300], np.repeat([-BUDGET, BUDGET, -BUDGET], 100))


def test_about_three_quarters_of_a_foot_per_second_it_is_the_thesis_mission():
    from auv_fault_env.missions import MISSIONS

    legs = MISSIONS["thesis"].legs
    found = 0.75 * 0.3048 + offsets(Thesis(), 300)[:, 0]
    np.testing.assert_allclose(found[::100], [speed for _, speed in legs[:3]])
