"""What binds the learning agent: its budget, and the price of moving a healthy vehicle."""

import math

import numpy as np
import pytest

from auv_fault_env import classes
from diagnosers import Belief, Recursive
from training.active_env.rewards import DETECTED
from training.learning import budgeted
from training.learning.budgeted import (
    ALLOWANCE,
    BUDGET,
    N_DECISIONS,
    SLOW,
    BudgetedVecEnv,
    speed_dependent_classes,
)
from training.learning.outcomes import PRICE
from training.stimuli.base import EPISODE_TIME, LARGEST_OFFSET
from training.stimuli.policy import REACH
from training.stimuli.policy_inputs import BUDGETS, compressed_budget
from training.studies.stimulus_comparisons import SUBSETS

GONE = [{"fault": "propeller_loss:port", "onset": 0.0, "severity": 1.0}]
LOST = classes().index("propeller_loss:port")


class Certain(Recursive):
    """Doubts nothing, and holds that the port propeller is lost."""

    def initial(self, n_lanes):
        return ()

    def step(self, state, observation):
        # a probability of 1 would end the episode
        sure = np.full((len(observation), len(classes())), -40.0)
        sure[:, LOST] = -1e-9
        return state, Belief(sure, np.zeros_like(sure), np.zeros_like(sure))


@pytest.fixture
def begun(monkeypatch):
    """Begins episodes of one budget, or of drawn ones; returns environment and observation."""

    def begin(schedule=(), budget=0.1, n_lanes=3, diagnoser="null"):
        budgets = BUDGETS if budget is None else (budget, budget)
        monkeypatch.setattr(budgeted, "BUDGETS", budgets)
        env = BudgetedVecEnv(n_lanes, diagnoser)
        env.seed(1)
        env.set_options({"schedule": list(schedule), "mission": 0.4})
        return env, env.reset()

    return begin


def test_a_healthy_vehicle_pays_for_its_offsets_and_a_faulty_one_does_not(begun):
    actions = np.array([[0.0], [0.1], [-0.2]], np.float32)
    relative_cost = np.square(REACH * actions[:, 0])
    healthy, _ = begun()
    faulty, _ = begun(GONE)
    for _ in range(3):
        paid = -healthy.step(actions)[1]
        np.testing.assert_allclose(paid, PRICE * relative_cost, rtol=1e-4)
        undiagnosed = -faulty.step(actions)[1]
        assert 0.95 < undiagnosed.min() == undiagnosed.max() < 1.0


def test_a_fault_costs_the_time_until_the_right_diagnosis(begun):
    still = np.zeros((3, 1), np.float32)
    env, _ = begun([GONE[0] | {"onset": 1.5}], diagnoser=Certain())
    rewards = [env.step(still)[1] for _ in range(3)]
    np.testing.assert_allclose(rewards, 0.0, atol=1e-6)
    other = [{"fault": "increased_drag", "onset": 1.5, "severity": 1.0}]
    env, _ = begun(other, diagnoser=Certain())
    rewards = [float(env.step(still)[1][0]) for _ in range(3)]
    assert rewards == pytest.approx([0.0, -1.0, -1.0], abs=1e-6)


def test_detection_counts_up_to_its_level(begun):
    class Doubtful(Certain):
        def step(self, state, observation):
            state, belief = super().step(state, observation)
            belief.log_probability[:, 0] = 0.5 * DETECTED
            belief.log_probability[:, LOST] = math.log(0.6)
            rest = 0.4 - math.exp(0.5 * DETECTED)
            belief.log_probability[:, LOST + 1] = math.log(rest)
            return state, belief

    env, _ = begun(GONE, diagnoser=Doubtful())
    reward = env.step(np.zeros((3, 1), np.float32))[1]
    np.testing.assert_allclose(reward, 0.5 * 0.6 - 1.0, rtol=1e-5)


def test_no_episode_overdraws_its_budget_and_the_next_begins_with_all_of_it(begun):
    env, first = begun(budget=0.02)
    left = ALLOWANCE - env.n_truth
    whole = 0.02**2 * EPISODE_TIME
    np.testing.assert_allclose(first[:, left], np.log1p(whole / LARGEST_OFFSET**2), rtol=1e-6)
    spent = 0.0
    for k in range(1, N_DECISIONS + 1):
        observation, _, done, infos = env.step(np.full((3, 1), -1.0, np.float32))
        spent = spent + np.array([info["cost"] for info in infos])
        assert done.all() == (k == N_DECISIONS)
        last = observation
        if done.all():
            last = np.array([info["terminal_observation"] for info in infos])
        remaining = np.maximum(whole - spent, 0.0)
        seen = np.log1p(remaining / LARGEST_OFFSET**2)
        np.testing.assert_allclose(last[:, left], seen, atol=1e-4)
    np.testing.assert_allclose(spent, whole, rtol=1e-4)
    np.testing.assert_array_equal(observation[:, left], first[:, left])


def test_an_offset_stays_within_reach_allowance_and_the_largest(begun):
    env, _ = begun(budget=0.02)
    offsets = env.clipped_offsets(np.array([[1.0], [-0.5], [0.0]], np.float32))
    np.testing.assert_allclose(offsets[:, 0], [0.02 * REACH, -0.01 * REACH, 0.0], rtol=1e-6)
    env.allowance[:] = 0.03**2
    offsets = env.clipped_offsets(np.full((3, 1), -1.0, np.float32))
    np.testing.assert_allclose(offsets, -0.03, rtol=1e-6)
    env, _ = begun(budget=0.3)
    assert env.clipped_offsets(np.ones((3, 1), np.float32)) == pytest.approx(LARGEST_OFFSET)


def test_budgets_are_drawn_from_the_seed_and_shown(begun):
    env, first = begun(budget=None, n_lanes=300)
    _, again = begun(budget=None, n_lanes=300)
    np.testing.assert_array_equal(first, again)
    seen = first[:, BUDGET - env.n_truth]
    np.testing.assert_allclose(seen, compressed_budget(env.budget), rtol=1e-5, atol=1e-6)
    assert np.ptp(seen) == pytest.approx(math.log(BUDGETS[1] / BUDGETS[0]), rel=0.05)
    least, largest = BUDGETS
    assert least < env.budget.min() < 1.1 * least
    assert 0.9 * largest < env.budget.max() < largest
    assert np.median(env.budget) == pytest.approx(math.sqrt(least * largest), rel=0.2)


def test_the_truth_is_behind_the_features(begun):
    env, first = begun([GONE[0] | {"onset": 2.0, "severity": 1.0}])
    truth = first[:, -env.n_truth :]
    assert truth[0, :-2].argmax() == LOST and truth[0, :-2].sum() == 1.0
    np.testing.assert_allclose(truth[:, -2:], [[1.0, -2.0 / SLOW]] * 3, rtol=1e-6)
    later = env.step(np.zeros((3, 1), np.float32))[0]
    np.testing.assert_allclose(later[:, -1], -1.0 / SLOW, rtol=1e-6)
    env, first = begun()
    truth = first[:, -env.n_truth :]
    assert truth[0, 0] == 1.0 and truth[0, -2] == 0.0 and truth[0, -1] == -2.0
    assert first.shape[1] == env.observation_space.shape[0]


def test_the_last_observation_of_an_episode_has_its_own_truth(begun):
    env, _ = begun(GONE)
    for _ in range(N_DECISIONS):
        observation, _, done, infos = env.step(np.zeros((3, 1), np.float32))
    assert done.all()
    last = np.array([info["terminal_observation"] for info in infos])
    assert (last[:, -env.n_truth + LOST] == 1.0).all()
    assert last[:, -1] == pytest.approx(2.0)
    # the options counted for the first reset alone
    assert observation[:, -1].max() < 0.0


def test_outcomes_count_delay_and_healthy_cost(begun):
    env, _ = begun([GONE[0] | {"onset": 30.0}])
    for _ in range(N_DECISIONS):
        env.step(np.full((3, 1), 0.1, np.float32))
    for outcome in env.outcomes:
        assert outcome.is_faulty and outcome.budget == pytest.approx(0.1)
        assert outcome.delay == pytest.approx(35.0, abs=1.1)
        assert outcome.healthy_time == pytest.approx(30.0, abs=1.1)
        per_second = outcome.healthy_cost / outcome.healthy_time
        assert per_second == pytest.approx((0.1 * REACH * 0.1) ** 2, rel=1e-4)


def test_a_reset_discards_the_outcomes(begun):
    env, _ = begun()
    for _ in range(N_DECISIONS):
        env.step(np.zeros((3, 1), np.float32))
    assert [outcome.lane for outcome in env.outcomes] == [0, 1, 2]
    env.reset()
    assert env.outcomes == []


def test_the_faults_are_those_that_the_front_of_stimuli_compares():
    assert sorted(speed_dependent_classes()) == sorted(SUBSETS["confounded"])
