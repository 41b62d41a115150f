"""The price of the budget: taken off the rewards, and adapted after every rollout."""

import numpy as np
import pytest

from training.active_vector_env import ActiveDiagnosisVectorEnv
from training.constraint import RATE, PricedVecEnv
from training.vec_env import ActiveVecEnv

BUDGET, AMPLITUDE = 0.1, 0.2


def priced():
    env = PricedVecEnv(ActiveVecEnv(ActiveDiagnosisVectorEnv(3, 5, "null", AMPLITUDE, BUDGET)))
    env.seed(1)
    env.set_options({"schedule": [], "mission": 0.4})
    env.reset()
    return env


def test_rewards_are_less_by_the_priced_cost():
    free, dear = priced(), priced()
    dear.price = 0.5
    actions = np.array([[0.0], [0.5], [-1.0]], np.float32)
    spent = np.square(AMPLITUDE * actions[:, 0]) / BUDGET**2
    for _ in range(7):
        before, after = (env.step(actions) for env in (free, dear))
        np.testing.assert_allclose(after[1], before[1] - 0.5 * spent, atol=1e-6)
        np.testing.assert_array_equal(after[0], before[0])


@pytest.mark.parametrize(("action", "overdraft"), [(0.0, -1.0), (0.5, 0.0), (0.6, 0.44), (1.0, 1.0)])
def test_price_follows_the_overdraft(action, overdraft):
    env = priced()
    env.price = 0.1
    for _ in range(4):
        env.step(np.full((3, 1), action, np.float32))
    env.ascend()
    assert env.price == pytest.approx(0.1 + RATE * overdraft, abs=1e-6)  # 1 at most: the square would be 3 over


def test_price_never_falls_below_nothing_and_forgets_the_rollout_before():
    env = priced()
    env.step(np.zeros((3, 1), np.float32))
    env.ascend()
    assert env.price == 0.0
    env.step(np.ones((3, 1), np.float32))
    env.ascend()
    assert env.price == pytest.approx(RATE)


def test_reset_begins_to_count_anew():
    env = priced()
    for _ in range(5):
        env.step(np.ones((3, 1), np.float32))
    assert len(env.outcomes.ended) == 3
    env.reset()
    assert not env.outcomes.ended
